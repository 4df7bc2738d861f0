"""Shared by commands that move a drive: arming, comparison of limits, one stop path, warnings at the end."""

from __future__ import annotations

import re
import sys
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from hw_bridge.command.bench.options import OptionError, paragraph
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.commission import Axis, PageWatchdog, SdoSession, SingleAxisSession
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master import Node, Reference

PAGE = "hw_bridge.attendance"  # of click's context
SERIAL = "hw_bridge.serial"  # of click's context
REFERENCE, START = "reference", "start"  # what positions count from, where the command line says so
REPEATED = ("jog", "enable", "direction")  # their next command after a stop is the same; of a target it may be another
REFERENCE_VALID = "The reference is kept."  # after a stop
LOST, NOT_HOMED = "lost", "not homed"  # of a reference: it was there before, or not
LINE_PERIOD = 100_000_000  # of the line with live values in a terminal [ns]
PAGE_PERIOD = 50_000_000  # and on a page, which draws them [ns]
LIVE_VALUES = re.compile(  # what `show_live` prints for a page
    r"(?P<mark>[<> ]) position +(?P<position>\S+) (?P<unit>\S+) (?P<origin>[a-z ]+), velocity +(?P<velocity>\S+ \S+), "
    r"current +(?P<current>\S+) A, (?P<state>.+?)   "
)
NO_DATA = "last known, no data"  # behind live values without process data, and for how long
# state and commands of `after_stop` as they are printed
STATE_AFTER_STOP = re.compile(r"^ *\S+: ((?:power is off|last state) .*?)\n *Next", re.MULTILINE | re.DOTALL)
COMMAND_AFTER_STOP = re.compile(r"^ *((?:Next|Then)[^:\n]*:)\s+twin hil (\w+)", re.MULTILINE)


def attach_page_watchdog(context: click.Context, _option: click.Parameter, end: int | None) -> None:
    """Attach the page watchdog: the socket's file descriptor comes from the process that shows this command on a page."""
    if end is not None:
        import socket

        from hw_bridge.commission import PageWatchdog

        context.meta[PAGE] = PageWatchdog(socket.socket(fileno=end))


def save_serial(context: click.Context, _option: click.Parameter, serial: str | None) -> None:
    """Save the serial number of the drive for which the page's steps are done."""
    context.meta[SERIAL] = serial


def assert_same_drive(drive: Node) -> None:
    """Raise SimulationError if another drive answers than that for which the page's steps are done."""
    from hw_bridge.master import restoration

    expected, serial = click.get_current_context().meta.get(SERIAL), f"{restoration.identity_of(drive).serial:X}"
    if expected and serial != expected:
        raise SimulationError(
            f"{drive.name}: another drive answers: serial number {serial}h, before {expected}h. Nothing was written. Do check "
            f"and the steps after it again."
        )


def page_watchdog() -> PageWatchdog | None:
    """The page watchdog, if a page shows this command."""
    watchdog: PageWatchdog | None = click.get_current_context().meta.get(PAGE)
    return watchdog


def ARM(command: Callable[..., Any]) -> Callable[..., Any]:  # noqa: N802 - beside the other options
    """Options of every command that moves a drive."""
    arm = click.option(
        "--arm",
        is_flag=True,
        help="Allow real drives to move. Confirms that nobody is in their way and the emergency stop is at hand.",
    )
    page = click.option(
        "--attended", type=click.IntRange(3), hidden=True, expose_value=False, callback=attach_page_watchdog
    )
    serial = click.option("--serial", hidden=True, expose_value=False, callback=save_serial)
    return arm(page(serial(command)))


def ORIGIN(command: Callable[..., Any]) -> Callable[..., Any]:  # noqa: N802 - beside the other options
    """Options for what positions and limits count from, passed as one `origin`."""
    homed = click.option(
        "--homed",
        "origin",
        flag_value=REFERENCE,
        help="Refuse to move unless the drive's reference (twin hil home) still holds.  [default: positions and limits "
        "count from the reference where it holds, else from the present position]",
    )
    start = click.option(
        "--from-start",
        "origin",
        flag_value=START,
        help="Positions and limits count from the present position, although the drive was homed: the limits move along.",
    )
    return homed(start(command))


def hardware(bus: BusChoice) -> HardwareKeys:
    """The hardware file; OptionError without one."""
    if bus.keys is None:
        raise OptionError("Name the hardware file, which has the limits: -f FILE, or set TWIN_HARDWARE.")
    return bus.keys


def assert_armed(bus: BusChoice, arm: bool) -> None:
    """Raise SimulationError unless only simulated drives can move, or --arm is given."""
    keys = hardware(bus)
    if not keys.is_software() and not arm:
        raise SimulationError(
            f"{bus.hardware}: {keys.interface} {keys.channel} may move real drives. Add --arm if nobody is in their way and "
            f"the emergency stop is at hand."
        )


def select_axis(bus: BusChoice, word: str) -> Axis:
    """Select a drive of the hardware file."""
    from hw_bridge.commission import axis

    keys = hardware(bus)
    assert bus.hardware is not None
    return axis(bus.hardware, keys, word)


def command_line(bus: BusChoice, word: str, name: str) -> str:
    """Command line of a command that moves a drive, as it can be typed."""
    arm = "" if hardware(bus).is_software() else " --arm"
    return f"twin hil {word} {name} -f {bus.hardware}{arm}"


@contextmanager
def single_axis_session(
    bus: BusChoice,
    axis: Axis,
    arm: bool,
    *,
    origin: str | None = None,
    forced: bool = False,
    start: float = 0.0,
    homes: bool = False,
    paced: bool = False,
    check: Callable[[float | None], None] | None = None,
) -> Iterator[SingleAxisSession]:
    """Session with one enabled drive for the duration of the block. Exit code 1 if there are warnings at the end.

    `check` may refuse before anything is written: it receives the position from the reference, None if it counts from here.
    """
    from hw_bridge.commission import SdoSession, SingleAxisSession, identity_text, restrict_to_node
    from hw_bridge.master import Reference

    assert_armed(bus, arm)
    keys = hardware(bus)
    name = axis.name
    if origin == REFERENCE and axis.keys.homing is None:
        raise SimulationError(
            f"{bus.hardware}: nodes.{name} has no `homing`, so that the drive has no reference (--homed, --to)."
        )
    with bus.network() as network:
        sdo_session = SdoSession(network, keys.nodes)
        reference = Reference(keys, name, axis.rotary)
        if check_before_power(sdo_session, axis, bus.hardware):
            reference.forget()  # after a Fault the drive is homed again
        drive = sdo_session.drive(name)
        if (page := page_watchdog()) is not None:
            say(identity_text(drive))
            assert_same_drive(drive)
        problem = reference.problem(drive)
        if origin == REFERENCE and problem:
            raise SimulationError(f"{name}: no reference: {problem} Home it: {command_line(bus, 'home', name)}")
        counts_from_reference = not (homes or problem or origin == START)
        here = reference.position(drive)
        if check is not None:
            check(here if counts_from_reference else None)
        if not homes and axis.keys.homing is not None and not keys.simulated:
            say_origin(axis, origin, problem, here, reference.is_recorded)
        session = SingleAxisSession(restrict_to_node(keys, name, homes), name, network, axis.rotary, forced)
        session.node.has_reference = not (homes or problem)  # until the stop, which finds whether it is lost
        session.master.before_power = reference.forget
        session.paced = paced
        if page is not None:
            session.paced = True  # it is watched, and can be stopped
            session.master.attend = partial(attend, page, session)
        elif homes and shows_live():
            session.master.attend = partial(show_live, session)
        with (
            reported_end(bus, session, reference, homes, not problem),
            session.enabled(start, axis.keys if counts_from_reference else None),
        ):
            yield session
    if session.master.notes:
        sys.exit(1)


@contextmanager
def reported_end(
    bus: BusChoice, session: SingleAxisSession, reference: Reference, homes: bool, was_homed: bool
) -> Iterator[None]:
    """Print how the block ended: the drive's state and reference, what was recovered, and the master's warnings."""
    name, keys = session.node.name, hardware(bus)
    can_home = homes or was_homed or (keys.nodes[name].homing is not None and not keys.simulated)
    lost = f"The reference is {LOST}." if was_homed else f"It is {NOT_HOMED}."
    lost = lost if can_home else ""
    try:
        yield
        show_final(session)
        text = "" if save_reference(session, reference, was_homed) else lost
        if not session.master.notes:
            where = f", at {session.node.format_length(session.node.position)} {session.origin}"
            paragraph(f"{name}: stopped and disabled{where}. {text}")
        if text:
            say(f"Home it: {command_line(bus, 'home', name)}")
    except KeyboardInterrupt:
        show_final(session)
        say()  # a motion leaves its last line open
        text = REFERENCE_VALID if save_reference(session, reference, was_homed) else lost
        state, *commands = after_stop(bus, session, text, "") or [f"{name}: stopped before power."]
        paragraph(state)
        for command in commands:
            say(command)
        raise
    except SimulationError as error:
        show_final(session)
        if page_watchdog() is not None or session.next_line:
            say()  # the error does not overwrite the last live values
        text = REFERENCE_VALID if save_reference(session, reference, was_homed) else lost
        state, *commands = after_stop(bus, session, text) or [""]
        lines = [
            f"{label}: {unbroken('twin ' + line)}"
            for label, _, line in (line.partition(": twin ") for line in commands)
        ]
        raise SimulationError("\n  ".join(filter(None, (str(error), state, *lines)))) from error
    finally:
        for text in session.master.recovered:
            paragraph(text)
        for note in session.master.notes:
            paragraph(bus.complete(f"warning: {note}"))


def unbroken(line: str) -> str:
    """A command that an error message does not wrap: it stays on one line, to be copied."""
    return line.replace(" ", "\N{NO-BREAK SPACE}")


def say_origin(axis: Axis, origin: str | None, problem: str, here: float, was_recorded: bool) -> None:
    """Print what positions and limits count from, where that is not the reference, or where it stands outside of the limits.

    `was_recorded`: why a reference that this program has found is not valid any more is printed, too.
    """
    name, (low, high) = axis.name, axis.keys.limits.position
    if problem:
        paragraph(f"{name}: {NOT_HOMED}. Limits count from here: an end stop may be nearer.")
        if was_recorded:
            paragraph(f"note: {name}: its reference is no longer valid: {problem}")
    elif origin == START:
        paragraph(f"note: {name}: --from-start: positions and limits count from here, an end stop may be nearer.")
    elif not low <= here <= high:
        paragraph(
            f"note: {name}: it is at {axis.format_quantity(here)}, outside of limits.position: it may only go inside, and has "
            "no software limits of its own in this command."
        )


def save_reference(session: SingleAxisSession, reference: Reference, was_homed: bool) -> bool:
    """Record the reference after a stop; return whether the drive has one.

    The stop has found whether the drive confirmed it, restarted, or reported an error of its sensor. After a Fault the
    drive is homed again in any case. The record of a drive that was refused before it had process data stays as it is.
    """
    from hw_bridge.dictionary import State

    node = session.node
    if not node.started:
        return was_homed
    node.has_reference &= node.state not in (State.FAULT, State.REACTION)
    if not node.has_reference:
        reference.forget()
    elif not reference.is_recorded:
        reference.save(node)
    return node.has_reference


def after_stop(
    bus: BusChoice, session: SingleAxisSession, reference: str, condition: str = ", once the cause is removed"
) -> list[str]:
    """Return lines on how a motion that did not end by itself has left the drive, and the next commands in their order.

    Empty if the drive was never reached. A motion to a target is not recommended again: it may count from another position.
    """
    from hw_bridge.dictionary import State, cia402

    node = session.node
    if not node.started:
        return []
    word = click.get_current_context().info_name
    state, command = "last state {}. Check it before you touch it", f"twin hil status {node.name} -f {bus.hardware}"
    if node.state in cia402.AT_REST and not session.master.notes:
        state = f"power is off ({{}}), at {node.format_length(node.position)} {session.origin}"
        if node.state is State.FAULT:
            command = f"twin hil reset -f {bus.hardware}"
        elif word in REPEATED:
            command = command_line(bus, word, node.name)
    lines = [f"{node.name}: {state.format(node.state)}. {reference}".rstrip(), f"Next{condition}: {command}"]
    if reference and reference != REFERENCE_VALID:
        lines.append(f"Then: {command_line(bus, 'home', node.name)}")
    return lines


def attend(page: PageWatchdog, session: SingleAxisSession) -> None:
    """Check in a cycle that the page is present, and show it the live values."""
    page.look()
    show_live(session, is_page=True)


def show_final(session: SingleAxisSession) -> None:
    """Show the page the values after the stop: its last ones are of the motion."""
    if page_watchdog() is not None and session.node.started:
        with suppress(OSError):  # the page's server has ended: the reference is recorded all the same
            show_live(session, is_page=True, is_final=True)


def show_live(session: SingleAxisSession, is_page: bool = False, is_final: bool = False) -> None:
    """Print position, velocity, current and the session's note on one line, again and again; on a page also the state."""
    from hw_bridge.dictionary import cia402

    node, now = session.node, session.network.now
    if not is_final and (now < session.next_line or session.counts_anew()):
        return
    session.next_line = now + (PAGE_PERIOD if is_page else LINE_PERIOD)
    speed = 0.0 if is_final else session.ramp.velocity
    mark = {1: ">", -1: "<"}.get((speed > 0) - (speed < 0), " ")
    velocity = node.velocity if is_final else session.mean_velocity()
    position, speed_text = node.format_length(node.position), f"{node.format_length(velocity)}/s"
    if is_page:
        is_off = is_final and node.state in cia402.AT_REST  # its latest current is of before
        current = f"current {'-' if is_off else f'{node.current:.3f}':>6} A"
        values = f"position {position:>10} {session.origin}, velocity {speed_text:>9}, {current}, {node.state}"
    else:
        values = f"{position:>10} {session.origin:<14} {speed_text:>12} {node.current:6.2f} A"
    note = f"{NO_DATA} {1e-9 * node.silent * session.cycle:.2f} s" if node.silent > 1 else session.note
    sys.stdout.write(f"\r{mark} {values}   {note:<27}{chr(13) if is_page else ''}")
    sys.stdout.flush()


def shows_live() -> bool:
    """Whether a motion to a target shows its live values on a line of a terminal."""
    return page_watchdog() is None and sys.stdout.isatty()


def end_live(session: SingleAxisSession) -> None:
    """Remove the line of live values from a terminal: what follows says where the drive is."""
    if session.next_line and page_watchdog() is None:
        sys.stdout.write("\r\033[K")


def check_before_power(sdo_session: SdoSession, axis: Axis, path: object) -> bool:
    """Before power: refuse an earlier error, which would hide a later one, and compare limits with the drive's own.

    Return whether the drive is in Fault, which the master refuses with its cause.
    """
    from hw_bridge.commission import BOOT, assert_not_driven, limits, pending_error
    from hw_bridge.dictionary import State, state_of

    if not sdo_session.network.wall_clock:
        sdo_session.wait(BOOT)
    node = sdo_session.drive(axis.name)
    node.rotary = axis.rotary
    in_fault = state_of(node.sdo.number(0x6041) & 0xFFFF) in (State.FAULT, State.REACTION)
    assert_not_driven(node)
    if not in_fault and (text := pending_error(node)):
        raise SimulationError(f"{text} Reset it first: twin hil reset -f {path}")
    wider_limits = list(limits.wider(node, limits.compare(node)))
    if absurd := [text for text, is_absurd in wider_limits if is_absurd]:
        raise SimulationError(absurd)
    for text, _ in wider_limits:
        paragraph(f"note: {text}")
    return in_fault
