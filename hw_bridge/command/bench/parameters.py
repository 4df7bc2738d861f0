"""`twin hil get`, `set`, `dump`, `compare`, `restore`, `store`, `defaults`: parameters of a drive."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.options import NODE, PROFILE, OptionError, on_a_bus, paragraph, table
from twin.cli import say
from twin.errors import SimulationError
from twin.files import write_atomically

if TYPE_CHECKING:
    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.commission import SdoSession
    from hw_bridge.dictionary import Entry, Value
    from hw_bridge.master import Station

FILE = click.argument("file", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.dcf")
SWITCHING = click.option(
    "--arm", is_flag=True, help="Confirm that valves and brakes may switch and nobody is in their way."
)
YES = click.option("--yes", is_flag=True, help="Do not ask for confirmation.")
LOST = "It is lost when the drive is switched off."
RAM = f"{LOST} Keep it: twin hil store"


@click.command("get")
@NODE
@click.argument("names", nargs=-1, required=True, metavar="OBJECT...")
@PROFILE
@on_a_bus
def get_command(bus: BusChoice, node: str, names: tuple[str, ...], profile: str | None) -> None:
    """Read objects of NODE, by index (6064h, 607Dh.1) or by name, with units.

    \b
    twin hil get 1 position_actual_value 2344h.1 -i socketcan -c can0
    twin hil get 1 software_position_limit -f my_bench.yaml
    """
    from hw_bridge.commission import objects
    from hw_bridge.master import SdoError

    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node, profile or "")
        objects.learn(station)
        failed = False
        for name in names:
            for entry in objects.find(station.mirror.entries(), name) or [objects.raw_entry(name)]:
                try:
                    value = objects.format_value(station, entry, objects.upload(station, entry))
                except SdoError as error:
                    value, failed = str(error), True
                title = f"{entry.title}: " if entry.title else ""
                table([(f"{entry.index:04X}h.{entry.sub}", f"{title}{entry.label}", value)])
        if failed:
            sys.exit(1)


@click.command("set", context_settings={"ignore_unknown_options": True})
@NODE
@click.argument("name", metavar="OBJECT")
@click.argument("value")
@click.option("--store", is_flag=True, help="Also store all parameters of the drive in its nonvolatile memory.")
@click.option("--dry-run", is_flag=True, help="Show the value before and the new one; write nothing.")
@SWITCHING
@PROFILE
@on_a_bus
def set_command(
    bus: BusChoice, node: str, name: str, value: str, store: bool, dry_run: bool, arm: bool, profile: str | None
) -> None:
    """Show an object of NODE before and after, write it, read it back, and print the command that sets it back.

    VALUE has a unit where the object has one: "200 mm/s", 26h, "-5 mm".

    Access and range are checked before anything is sent. Objects that move a drive (6040h, targets, modes) are refused, and
    so is a drive that another program drives. Objects that switch an output (60FEh, 6200h, pin functions) and vendor
    objects outside the profile need --arm. `150 raw` is a value in the drive's own units.

    \b
    twin hil set 1 quick_stop_deceleration "5 m/s^2" -f my_bench.yaml
    twin hil set 3 3001h.2 "3 A" --store -i socketcan -c can0
    """
    from hw_bridge.command.bench.single_axis import select_axis
    from hw_bridge.commission import assert_not_driven, limits, nvm, objects
    from hw_bridge.master import Node

    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node, profile or "")
        objects.learn(station)
        entries = objects.find(station.mirror.entries(), name) or [objects.raw_entry(name)]
        if len(entries) > 1:
            names = ", ".join(objects.name(entry) for entry in entries)
            raise OptionError(f"{name} is several objects: {names}.")
        entry = entries[0]
        number = objects.parse_value(station, entry, value)
        if entry.index in limits.DECELERATIONS and isinstance(station, Node):
            is_named = station.name in bus.stations
            unit = select_axis(bus, station.name).unit if is_named else station.profile.motor.unit
            limits.assert_can_stop(station, entry, number, unit)
        switching_needs_arm(bus, station, entry, arm)
        assert_not_driven(station)
        if left := nvm.unrestored_objects(station, bus.journals):
            text = nvm.unrestored_text(station, left)
            if store:
                raise SimulationError(text)
            paragraph(f"warning: {bus.complete(text)}")
        before = objects.upload(station, entry)
        address = f"{entry.index:04X}h.{entry.sub}"
        values = " -> ".join(objects.format_value(station, entry, each) for each in (before, number))
        paragraph(f"{station.name}: {address} {entry.label}: {values}.")
        if dry_run:
            say("Nothing is written (--dry-run).")
            return
        objects.download(station, entry, number)
        undo = bus.complete(f"twin hil set {station.number} {address} '{before} raw'")
        say(f"Back: {undo}{' --store' * store}{' --arm' * arm}")
        if store:
            nvm.store(station, bus.journals)
            say("All parameters are stored.")
        else:
            paragraph(LOST if left else bus.complete(f"{RAM} {station.number}"))


def switching_needs_arm(bus: BusChoice, node: Station, entry: Entry, arm: bool) -> None:
    """Raise SimulationError for an object that may switch an output at once on a real bus, unless armed."""
    from hw_bridge.profiles import acting

    if acting.switches(node.profile, entry.index, entry.sub) and not arm and not bus.is_software:
        is_described = acting.is_described(node.profile, entry.index, entry.sub)
        why = "switches outputs at once" if is_described else "is not in the profile, and may act at once"
        raise SimulationError(
            f"{node.name}: {entry.index:04X}h.{entry.sub} {why}. Nothing was written. Add --arm if nobody is in the way of "
            f"what is connected: valves, brakes."
        )


@click.command("dump")
@NODE
@FILE
@click.option("--force", is_flag=True, help="Overwrite FILE.dcf if it exists.")
@PROFILE
@on_a_bus
def dump_command(bus: BusChoice, node: str, file: Path, force: bool, profile: str | None) -> None:
    """Write all parameters of NODE into a DCF file (CiA 306), which other tools read too. The drive is only read.

    An existing file is refused without --force: it may be the only copy of the values before a change.

    \b
    twin hil dump 1 before.dcf -i socketcan -c can0
    """
    from hw_bridge.commission import dcf, identity_text, objects

    if file.exists() and not force:
        raise SimulationError(
            f"{file}: exists, and may be the only copy of the drive's former values. Give another name, or --force."
        )
    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node, profile or "")
        objects.learn(station)
        text, refused = dcf.dump(station, bus.keys.bit_rate if bus.keys is not None else bus.bit_rate)
        write_atomically(file, text.encode("latin-1"))
        dcf.save_dump(station, bus.journals, text)
        count = text.count("ParameterValue=")
        say(identity_text(station))
        say(f"{file}: {count} values of {station.name}.")
        for text in refused:
            paragraph(f"note: not there: {text}")


@click.command("compare")
@NODE
@FILE
@PROFILE
@on_a_bus
def compare_command(bus: BusChoice, node: str, file: Path, profile: str | None) -> None:
    """List the differences between NODE and a DCF file. Nothing is written. Exit code 1 if anything differs."""
    from hw_bridge.commission import dcf, identity_text, objects

    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node, profile or "")
        objects.learn(station)
        wanted = dcf.load(file, station.number)
        if problem := dcf.identity_mismatch(station, wanted):
            paragraph(f"differs: {problem}")
            sys.exit(1)
        differences = dcf.differences(station, wanted)
        rows = difference_rows(station, differences)
        say(identity_text(station))
        if rows:
            table([("object", "name", "drive", "file"), *rows], head=True)
            for text in dcf.output_notes(station, wanted):
                paragraph(f"note: {text}")
            sys.exit(1)
        say(f"{station.name}: all values equal {file}.")


def difference_rows(node: Station, differences: list[tuple[Entry, Value, Value]]) -> list[tuple[str, str, str, str]]:
    """Object, name, value of the drive and of the file."""
    from hw_bridge.commission import objects

    return [
        (
            f"{e.index:04X}h.{e.sub}",
            e.label[:28],
            objects.format_value(node, e, own),
            objects.format_value(node, e, value),
        )
        for e, own, value in differences
    ]


@click.command("restore")
@click.argument("node", required=False, metavar="[NODE]")
@click.argument("file", required=False, type=click.Path(dir_okay=False, path_type=Path), metavar="[FILE.dcf]")
@click.option("--store", is_flag=True, help="Also store all parameters in the nonvolatile memory.")
@SWITCHING
@PROFILE
@on_a_bus
def restore_command(
    bus: BusChoice, node: str | None, file: Path | None, store: bool, arm: bool, profile: str | None
) -> None:
    """Undo the changes of a killed run in NODE, from the run's journal. With FILE: write the values of a dump.

    Without NODE: all nodes that answer and have a journal. Every value is read back. Pin functions and vendor objects
    outside the profile need --arm. With FILE, node-ID, bit rate, output levels and objects that move the drive are not
    written; run compare first. Refused while another program drives NODE. Exit code 1 if the drive refuses a value.

    \b
    twin hil restore -f my_bench.yaml
    twin hil restore 1 before.dcf -i socketcan -c can0
    """
    with bus.sdo_session() as sdo_session:
        if file is not None and node is not None:
            restore_file(bus, sdo_session, node, file, store, arm, profile)
            return
        from hw_bridge.commission import scan

        nodes = [str(scanned.node) for scanned in scan(sdo_session) if not scanned.problem] if node is None else [node]
        results = [restore_unfinished(bus, sdo_session, item, profile, arm) for item in nodes]
    if not any(result is not None for result in results):
        say("No run left anything to restore.")
    if any(result is False for result in results):
        sys.exit(1)


def restore_unfinished(
    bus: BusChoice, sdo_session: SdoSession, node: str, profile: str | None, arm: bool = False
) -> bool | None:
    """Restore what a run left in one node; return whether all is restored, None where there is no journal."""
    from hw_bridge.commission import nvm, objects

    station = sdo_session.node(node, profile or "")
    objects.learn(station)
    if (restored := nvm.restore_journal(sdo_session, station, bus.journals, arm or bus.is_software)) is None:
        return None
    for text in (*restored.foreign, *restored.failed):
        paragraph(f"not restored: {text}")
    paragraph(f"{station.name}: {restored.counts}")
    if restored.restored:
        paragraph(f"As before: {', '.join(restored.restored)}.", 2)
    return not restored.foreign and not restored.failed


def restore_file(
    bus: BusChoice, sdo_session: SdoSession, node: str, file: Path, store: bool, arm: bool, profile: str | None
) -> None:
    """Write what differs from a DCF file."""
    from hw_bridge.commission import dcf, nvm, objects

    station = sdo_session.node(node, profile or "")
    objects.learn(station)
    wanted = dcf.load(file, station.number)
    changed, refused = dcf.restore(
        sdo_session,
        station,
        wanted,
        lambda entry: switching_needs_arm(bus, station, entry, arm),
    )
    for text in changed:
        say(f"changed: {text}")
    for text in refused:
        paragraph(f"refused: {text}")
    for text in dcf.output_notes(station, wanted):
        paragraph(f"note: {text}")
    say(f"{station.name}: {len(changed)} changed, {len(refused)} refused.")
    if store and not refused:
        nvm.store(station, bus.journals)
        say("All parameters are stored.")
    elif changed:
        paragraph(bus.complete(f"{RAM} {station.number}"))
    if refused:
        sys.exit(1)


def is_terminal() -> bool:
    """Whether stdin is a terminal."""
    return sys.stdin.isatty()


@click.command("store")
@NODE
@click.argument("file", required=False, type=click.Path(dir_okay=False, path_type=Path), metavar="[FILE.dcf]")
@YES
@on_a_bus
def store_command(bus: BusChoice, node: str, file: Path | None, yes: bool) -> None:
    """Store all parameters of NODE in its nonvolatile memory (1010h.1). Show what differs from FILE or its last dump.

    A terminal asks for confirmation then. Refused while a program drives NODE, and while NODE has values that a run wrote and did not restore.
    """
    from hw_bridge.commission import dcf, nvm, objects

    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node)
        nvm.assert_can_store(station, bus.journals)
        objects.learn(station)
        source = file if file is not None else dcf.last_dump(station, bus.journals)
        if source is None:
            paragraph(
                "note: there is no dump of this drive to compare with. Take one before you change it: "
                f"{bus.complete(f'twin hil dump {node}')} before.dcf"
            )
        else:
            wanted = dcf.load(source, station.number)
            if problem := dcf.identity_mismatch(station, wanted):
                raise SimulationError(problem)
            rows = difference_rows(station, dcf.differences(station, wanted))
            say(f"{station.name}: {len(rows)} objects differ from {'its last dump' if file is None else file}:")
            table([("object", "name", "drive", "dump"), *rows] if rows else [], 2, head=True)
        if not yes and is_terminal():
            click.confirm(f"{station.name} keeps these values when it is switched off. Go on?", abort=True)
        nvm.store(station, bus.journals)
        say(f"{station.name}: all parameters are stored.")


@click.command("defaults")
@NODE
@click.option("--restart", is_flag=True, help="Restart the drive now, so that they take effect.")
@YES
@on_a_bus
def defaults_command(bus: BusChoice, node: str, restart: bool, yes: bool) -> None:
    """Restore the delivery state of NODE (1011h.1). It takes effect at the next start of the drive.

    Save the present parameters first: twin hil dump. Node-ID and bit rate may be reset too.
    """
    from hw_bridge.commission import nvm

    with bus.sdo_session() as sdo_session:
        station = sdo_session.node(node)
        if not yes:
            click.confirm(
                f"{station.name} ({station.profile.title}) forgets motor, loops and limits. Go on?", abort=True
            )
        nvm.defaults(station)
        if restart:
            nvm.restart(sdo_session, station)
            say(f"{station.name}: has its defaults.")
        else:
            say(f"{station.name}: has its defaults when it is started anew (--restart, or switch it off and on).")
