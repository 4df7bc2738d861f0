"""`twin hil scan`, `status`, `monitor`: nodes on the bus and their status. Only read."""

from __future__ import annotations

import json
import sys
from types import MappingProxyType
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench import options
from hw_bridge.command.bench.options import NODE, PROFILE, WIDTH, OptionError, on_a_bus, paragraph, table
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.master import Reference, Station

LISTENING = 1_000_000_000  # before anything is sent, with --alone [ns]
SERIAL = ((0x1018, 4),)
NO_REFERENCES: Mapping[str, Reference | None] = MappingProxyType({})
NO_ANSWER = (
    "No node answers. Is the power on? Do CAN_H, CAN_L and GND reach the drive, with 120 ohm at both ends? Has it this bit "
    "rate (--bitrate)? A drive without a node-ID answers only LSS: twin hil lss."
)


@click.command("scan")
@on_a_bus
def scan_command(bus: BusChoice) -> None:
    """Scan all node-IDs: vendor, product, revision, profile, state, errors. Nothing is written.

    With a hardware file, exit code 1 if one of its nodes does not answer, or another node does.

    \b
    twin hil scan -i socketcan -c can0
    twin hil scan -i slcan -c /dev/ttyACM0 --bitrate 500000
    twin hil scan -f my_bench.yaml
    """
    from hw_bridge.commission import membership_problems, scan
    from hw_bridge.hardware import HardwareKeys

    with bus.sdo_session() as sdo_session:
        nodes = scan(sdo_session)
        names = {key.node: name for name, key in sdo_session.keys.items()}
        master = bus.keys.master if bus.keys is not None else HardwareKeys.model_fields["master"].default
        for item in nodes:
            name = f" ({names[item.node]})" if item.node in names else ""
            if item.node == master and item.problem:
                say(f"node {item.node}: heartbeat of a program that commands drives, such as twin hil or twin run")
                continue
            say(f"node {item.node}{name}: {item.title or 'not understood'}")
            vendor, product, revision, serial = item.identity
            if item.problem:
                paragraph(item.problem, 2)
                continue
            say(f"  vendor {vendor:X}h, product {product:X}h, revision {revision:X}h, serial {serial:X}h")
            if item.state:
                say(f"  {item.state}")
            if item.fault:
                paragraph(item.fault, 2)
            options.note_leftovers(bus, sdo_session.node(str(item.node)), 2)
        if not nodes:
            paragraph(NO_ANSWER)
            sys.exit(1)
        if bus.keys is None:
            return
        problems = membership_problems([item.node for item in nodes if item.node != bus.keys.master], names)
        for text in problems:
            paragraph(f"differs: {text}")
        if problems:
            sys.exit(1)


@click.command("status")
@NODE
@PROFILE
@on_a_bus
def status_command(bus: BusChoice, node: str, profile: str | None) -> None:
    """Show state, limits, temperatures, voltages and errors of NODE, with the remedy of each error.

    NODE is a node-ID, or a name of the hardware file. Nothing is written. Exit code 1 if it is in Fault.

    \b
    twin hil status 1 -i socketcan -c can0
    twin hil status servomotor -f my_bench.yaml
    """
    from hw_bridge.commission import identity_text, status
    from hw_bridge.dictionary import State, state_of

    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node, profile or "")
        report = status(station, reference_of(bus, station))
        say(identity_text(station))
        changed = {name.removesuffix(".0") for name in options.note_leftovers(bus, station)}
        width = max((len(name) for rows in report.groups.values() for name, _ in rows), default=0)
        for group, rows in report.groups.items():
            if rows:
                say(group)
                marks = ["  (of the killed run)" * (name.split()[0] in changed) for name, _ in rows]
                table([(f"{name:{width}}", value + mark) for (name, value), mark in zip(rows, marks, strict=True)], 2)
        say("errors")
        for text in report.errors or ["none"]:
            paragraph(text, 2)
        if 0x6041 in station.mirror and state_of(station.sdo.number(0x6041) & 0xFFFF) in (State.FAULT, State.REACTION):
            sys.exit(1)


def reference_of(bus: BusChoice, station: Station) -> Reference | None:
    """Reference of a drive with `homing` in the hardware file; also sets whether its positions are angles."""
    from hw_bridge.commission import axis
    from hw_bridge.master import Node, Reference

    if bus.keys is None or bus.hardware is None or not isinstance(station, Node):
        return None
    if station.name not in bus.keys.nodes or bus.keys.nodes[station.name].homing is None:
        return None
    station.rotary = axis(bus.hardware, bus.keys, station.name).rotary
    return Reference(bus.keys, station.name, station.rotary)


@click.command("monitor")
@click.argument("nodes", nargs=-1, metavar="[NODE]...")
@click.option(
    "--every",
    type=click.FloatRange(0.05, 60.0),
    default=0.2,
    show_default=True,
    metavar="S",
    help="Sampling interval [s].",
)
@click.option(
    "--for", "duration", type=click.FloatRange(0.0), metavar="S", help="End after this time [s].  [default: until q]"
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print each sample as one line of JSON: node, then name and value."
)
@click.option(
    "--alone", is_flag=True, help="Listen first; end as soon as another program commands or reads one of the nodes."
)
@on_a_bus
def monitor_command(
    bus: BusChoice, nodes: tuple[str, ...], every: float, duration: float | None, as_json: bool, alone: bool
) -> None:
    """Show state, position, velocity, current and errors of nodes as they change, until q or Ctrl-C.

    Without NODE: all drives of the hardware file. In a pipe each sample is printed on a line of its own. Values are read
    by SDO only, so it may run during `twin run`.
    """
    from hw_bridge.commission import Keyboard
    from hw_bridge.master import ForeignMasterMonitor

    with bus.sdo_session() as sdo_session, Keyboard.open_if_terminal() as keyboard:
        stations = [sdo_session.node(station) for station in nodes or sdo_session.keys]
        if not stations:
            raise OptionError("Name at least one NODE, or --hardware FILE with its nodes.")
        references = {station.name: reference_of(bus, station) for station in stations}
        others = ForeignMasterMonitor(
            bus.keys.master if bus.keys else 0, {station.number: station.name for station in stations}, reads=True
        )
        if alone:
            sdo_session.network.hear = others.hear
            sdo_session.wait(LISTENING)
        begin, count, learned = sdo_session.network.now, 0, set[str]()
        while duration is None or sdo_session.network.now - begin <= duration * 1e9:
            if others.text:
                raise SimulationError(
                    f"{others.text.replace(' Stop it.', '')} Two programs must not disturb each other."
                )
            values = current_values(stations, learned, SERIAL if as_json else (), references)
            lines = [json.dumps(values)] if as_json else status_lines(values, (sdo_session.network.now - begin) / 1e9)
            if count and sys.stdout.isatty():
                sys.stdout.write(f"\x1b[{count}F\x1b[J")
            for text in lines:
                say(text)
            count = len(lines)
            sdo_session.wait(round(every * 1e9))
            if keyboard is not None and {"q", "quit"} & set(keyboard.pressed()):
                return


def current_values(
    stations: list[Station],
    learned: set[str],
    more: tuple[tuple[int, int], ...] = (),
    references: Mapping[str, Reference | None] = NO_REFERENCES,
) -> dict[str, list[tuple[str, str]]]:
    """Name and value of the monitored objects of each node, and of `more`; `learned`: names of those whose scale was read."""
    from hw_bridge.commission import monitored_rows, objects
    from hw_bridge.master import SilentError

    values = {}
    for station in stations:
        try:
            if station.name not in learned:
                objects.learn(station)
            values[station.name] = monitored_rows(station, more, references.get(station.name))
            learned.add(station.name)
        except SilentError:
            values[station.name] = [("no answer", "check its power and wiring")]
            learned.discard(station.name)  # another drive may be connected meanwhile
        except SimulationError as error:
            values[station.name] = [("no answer", str(error)[:60])]
    return values


def status_lines(values: dict[str, list[tuple[str, str]]], now: float) -> list[str]:
    """Current values of nodes, as lines."""
    lines = [f"{now:8.1f} s   q ends it"]
    for name, rows in values.items():
        lines += [name, *(f"  {title:32.32} {value}"[:WIDTH] for title, value in rows)]
    return lines
