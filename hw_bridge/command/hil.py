"""`twin hil`: commissioning of a bench, from a drive in its box to first motion."""

from __future__ import annotations

import importlib
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.options import BUS, BusChoice, note_leftovers, paragraph, table
from hw_bridge.command.bench.single_axis import hardware as hardware_of
from hw_bridge.command.bench.single_axis import select_axis
from hw_bridge.commission import (
    DUPLICATE_ID,
    SdoSession,
    limit_effects,
    membership_problems,
    profile_title_of,
    scan,
)
from hw_bridge.hardware import stall_bounds
from hw_bridge.plant import bench_network
from twin.cli.options import build_option
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from hw_bridge.commission import PlannedRow
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master import Master, ModuleNode, Node

__all__ = ["bench_network", "command", "compare_bus", "profile_title_of"]

WRITE_HEAD = ("object", "name", "before", "after", "why")
RAW = re.compile(r" \([^()]*\)$")  # value in the drive's own unit, behind a quantity
OTHERS = "A jog or move writes and restores the same without those of homing, and 607Dh as its positions count (from start or home)."
PDO_OBJECT = re.compile(r"1[4-9AB]")  # 1400h to 1BFFh

COMMANDS = {  # file of hw_bridge.command.bench and what it does, in the order of commissioning
    "scan": ("look", "list the nodes: vendor, product, profile, state, errors"),
    "status": ("look", "show state, limits, temperatures and errors of a drive"),
    "monitor": ("look", "show state, position and current live"),
    "get": ("parameters", "read objects by index or name, with units"),
    "set": ("parameters", "write one object after a check, and read it back"),
    "dump": ("parameters", "save all parameters of a drive as a DCF file"),
    "compare": ("parameters", "list differences between a drive and a DCF file"),
    "restore": ("parameters", "undo the changes of a killed run, or write a DCF file"),
    "store": ("parameters", "store all parameters in nonvolatile memory (1010h)"),
    "defaults": ("parameters", "restore the delivery state (1011h)"),
    "enable": ("power", "switch power on and hold the position"),
    "disable": ("power", "stop a drive that another program left enabled"),
    "home": ("power", "describe the homing method, then home"),
    "jog": ("motion", "move while an arrow key is held"),
    "move": ("motion", "move by a distance or to a position, with a ramp"),
    "lss": ("lss", "set node-ID and bit rate by identity (CiA 305)"),
    "direction": ("direction", "check that encoder and motor have the same sign"),
    "step": ("step", "measure the step response, compare it with the twin's"),
}


class Commands(click.Group):
    """A group whose other commands are in files of their own, imported when called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All, in the order of commissioning."""
        return [*COMMANDS, *super().list_commands(ctx)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's file."""
        if cmd_name not in COMMANDS:
            return super().get_command(ctx, cmd_name)
        module = importlib.import_module(f"hw_bridge.command.bench.{COMMANDS[cmd_name][0]}")
        command: click.Command = getattr(module, f"{cmd_name}_command")
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's
        """List the commands, importing none of them."""
        here = [(name, subcommand.get_short_help_str(60)) for name, subcommand in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl([*((name, text) for name, (_, text) in COMMANDS.items()), *here])


@click.group("hil", cls=Commands, short_help="commission drives: scan, parameters, home, jog, check")
def command() -> None:
    """Commission drives: scan the bus, read and write parameters, home and move a single drive.

    No real drive moves without --arm. Commands that move need a hardware file with limits.

    \b
    twin hil scan -i socketcan -c can0                list the nodes
    twin hil check -f my_bench.yaml                   compare bus and file
    twin hil move servomotor --by "1 mm" -f my_bench.yaml --arm
    """


@dataclass
class Findings:
    """Result of a check: what differs, notes, and tables by their heading: a brief one for each node, and all."""

    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    brief: list[tuple[str, Sequence[Sequence[str]]]] = field(default_factory=list)
    tables: list[tuple[str, Sequence[Sequence[str]]]] = field(default_factory=list)

    def add(self, other: Findings) -> None:
        """Append the findings of one node."""
        self.problems += other.problems
        self.notes += other.notes
        self.brief += other.brief
        self.tables += other.tables

    def show(self, verbose: bool = True) -> None:
        """Print what an operator must read first, then the tables, without `verbose` the brief ones."""
        for text in self.problems:
            paragraph(f"differs: {text}")
        for text in self.notes:
            paragraph(f"note: {text}")
        for heading, rows in self.tables if verbose else self.brief:
            paragraph(heading)
            table(rows, 2, head=rows[:1] in ([WRITE_HEAD], [WRITE_HEAD[:-1]]))
        if not verbose and self.brief:
            paragraph(f"{OTHERS} --verbose adds reasons, the drive's own settings, and the effect of each limit.")

    @property
    def verdict(self) -> str:
        """Last line of the check."""
        problems, notes = len(self.problems), len(self.notes)
        if problems:
            return f"Bus and hardware file differ. Above the tables: differences {problems}, notes {notes}."
        return f"Bus and hardware file agree.{f' Notes above the tables: {notes}.' if notes else ''}"


@command.command("check", short_help="compare the bus with a hardware file")
@BUS[0]
@click.option("--verbose", is_flag=True, help="Also reasons, the drive's own settings, and the effect of each limit.")
@build_option
def check(hardware: Path | None, verbose: bool, build: Path) -> None:
    """Scan all node-IDs, identify each drive, compare with the hardware file. Nothing moves, nothing is written.

    Prints what differs, notes, and each object that a run writes, before and after. Exit code 1 if anything differs.
    """
    bus = BusChoice(hardware, build=build)
    keys = hardware_of(bus)
    absent: dict[str, Collection[int]] = {}
    findings = compare_bus(keys, build, {name: select_axis(bus, name).rotary for name in keys.nodes}, absent)
    findings.tables += [
        (f"{', '.join(names)}: effect of each limit", rows) for names, rows in limit_effects.grouped(keys, absent)
    ]
    for texts in (findings.problems, findings.notes):
        texts[:] = map(bus.complete, texts)
    findings.show(verbose)
    paragraph(findings.verdict)
    if findings.problems:
        sys.exit(1)


def compare_bus(
    keys: HardwareKeys,
    build: Path,
    rotary: Mapping[str, bool] | None = None,
    absent: dict[str, Collection[int]] | None = None,
) -> Findings:
    """Compare the bus with the hardware file; print its nodes. `rotary`: which members turn.

    `absent` receives, by drive, the objects of a run that it does not have.
    """
    from hw_bridge.master import Master, active_drives

    network = bench_network(keys, build)
    sdo_session = SdoSession(network)
    master = Master(keys, network)
    for name, drive in master.nodes.items():
        drive.rotary = (rotary or {}).get(name, False)
    try:
        master.wait(500_000_000)
        nodes = {scanned.node: scanned.description for scanned in scan(sdo_session, [keys.master])}
        for number, text in nodes.items():
            paragraph(f"node {number}: {text}")
        expected = {station.number: station for station in master.stations.values()}
        findings = Findings(membership_problems(nodes, {number: node.name for number, node in expected.items()}))
        for number, node in expected.items():
            if number not in nodes:
                continue
            if nodes[number].endswith(DUPLICATE_ID):
                findings.problems.append(f"{node.name}: node {number}: {nodes[number]}. Give one of them another.")
            elif differing := master.compare(node):
                findings.problems += differing
            else:
                findings.add(unready(master, node))
        if absent is not None:
            absent |= {name: drive.absent for name, drive in master.nodes.items()}
        answering = [node for node in master.nodes.values() if node.number in nodes and not node.doubled]
        findings.problems += active_drives(answering, master.wait)
        findings.problems += [master.foreign_master.text] if master.foreign_master.action else []
        return findings
    finally:
        master.network.close()


def unready(master: Master, station: Node | ModuleNode) -> Findings:
    """Return why a matching node could not be run now, what a run would write, and notes."""
    from hw_bridge.commission import inspect, limit_note, limits, planned_rows, softer_stop, write_heading
    from hw_bridge.master import Node, setup

    left = unrestored(master, station)
    plan = master.plan(station)
    rows = planned_rows(plan)
    findings = Findings(
        [*left, *plan.refused, *plan.problems],
        [*plan.sizes(), *plan.notes],
        [(write_heading(plan, rows), brief(rows)), *limit_note(plan, rows)],
        [(write_heading(plan, rows), [WRITE_HEAD, *rows])],
    )
    if not isinstance(station, Node):
        return findings
    inspection = inspect(station)
    findings.tables += [
        (f"{station.name}: {group}, unchanged unless the hardware file sets it:", values)
        for group, values in inspection.groups.items()
    ]
    findings.notes += [*limits.defaulted(station), *inspection.notes, *softer_stop(plan)]
    findings.notes.append(stall_bounds.bound(master.keys, station.name, station.keys, station.rotary, station.mirror))
    fault = setup.faults(station)
    for text, is_absurd in limits.wider(station, limits.compare(station)):
        (findings.problems if is_absurd else findings.notes).append(text)
    findings.problems += [fault] if fault else []
    return findings


def unrestored(master: Master, station: Node | ModuleNode) -> list[str]:
    """Return what a killed command has left: an error that is still told, and objects that its journal names.

    The plan then begins from the values before that command, as the next run does.
    """
    from hw_bridge.commission import nvm, pending_error
    from hw_bridge.master import Node, restoration, setup

    problems = []
    if isinstance(station, Node) and not setup.faults(station) and (text := pending_error(station)):
        problems.append(f"{text} Reset it first: twin hil reset -f FILE")
    if master.keys.simulated:
        return problems
    try:
        left = nvm.unrestored_objects(station, restoration.folder_of(master.keys))
    except SimulationError as error:  # it is damaged, or a running program holds it
        return [*problems, str(error)]
    station.unrestored = {change.address: change.before for change in left if change.before}
    if left:
        text = nvm.unrestored_text(station, left)
        problems.append(f"{text} -f FILE. The next run does it first, too. `before` is the value that is restored.")
    return problems


def brief(rows: Sequence[PlannedRow]) -> list[Sequence[str]]:
    """Return the rows without reasons and the drive's own numbers; the mapping of process data is one row."""
    mapping = [row.object for row in rows if PDO_OBJECT.match(row.object)]
    others = [row for row in rows if row.object not in mapping]
    shown: list[Sequence[str]] = [
        (row.object, row.name[:28], RAW.sub("", row.before), RAW.sub("", row.after)) for row in others
    ]
    if mapping:
        shown.append((f"{len(mapping)} more", f"PDOs, {min(mapping)} to {max(mapping)}", "", "mapping of the run"))
    return [WRITE_HEAD[:-1], *shown]


@command.command("reset", short_help="leave Fault, once the cause is known")
@click.argument("node", required=False, metavar="[NODE]")
@BUS[0]
@build_option
def reset(node: str | None, hardware: Path | None, build: Path) -> None:
    """Tell what each drive in Fault, or NODE alone, says (603Fh, 1003h), then reset it. Power stages stay off, nothing moves.

    A run never does this by itself. Exit code 1 if a drive is another one, or stays in Fault.
    """
    from hw_bridge.master import Master

    bus = BusChoice(hardware, build=build)
    keys = hardware_of(bus)
    master = Master(keys, bench_network(keys, build))
    try:
        master.wait(500_000_000)
        chosen = [*master.nodes.values()] if node is None else [master.nodes[select_axis(bus, node).name]]
        results = [reset_drive(master, drive) for drive in chosen]
        for drive, is_free in zip(chosen, results, strict=True):
            if is_free:
                note_leftovers(bus, drive)
    finally:
        master.network.close()
    if not all(results):
        sys.exit(1)


def reset_drive(master: Master, node: Node) -> bool:
    """Reset one drive if it matches and is in Fault; return whether it is not in Fault now."""
    from hw_bridge.commission import assert_not_driven, pending_error
    from hw_bridge.dictionary import State
    from hw_bridge.master import setup

    try:
        if problems := master.compare(node):
            paragraph(f"differs: {' '.join(problems)}")
            return False
        if not (fault := setup.faults(node)) and (fault := pending_error(node).replace(" reports ", " reported ")):
            assert_not_driven(node)  # a reset begins with 6040h = 0: a moving axis would coast or fall
        if not fault:
            paragraph(f"{node.name}: is not in Fault.")
            return True
        state = setup.reset(node)
    except SimulationError as error:
        paragraph(f"differs: {error}")
        return False
    paragraph(fault)
    paragraph(f"Reset: {state}.{' Its cause is still there.' if state is State.FAULT else ''}")
    return state is not State.FAULT
