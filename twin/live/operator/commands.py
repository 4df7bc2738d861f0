"""Session commands, by name. Invalid messages yield a one-line error."""

from __future__ import annotations

import time as wall
from math import isfinite
from typing import TYPE_CHECKING, Any

from twin.errors import TwinError
from twin.live.pacing import checked_rate
from twin.live.recording_reader import RefusedError
from twin.scenario import EventSpec, short

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from twin.live.session import Session

    Message = dict[str, Any]

MAX_STEPS = 10**6  # steps at once


def execute(session: Session, message: Message) -> tuple[str, bool]:
    """Execute a message; return the reason of a refusal, or nothing, and whether the answer follows later."""
    kind = message.get("ask")
    try:
        call = COMMAND_HANDLERS.get(kind) if isinstance(kind, str) else None
        if call is None:
            raise RefusedError(f"{short(str(kind))} is not a command.")
        return "", bool(call(session, message))
    except KeyError as error:
        return f"{kind}: {error} is missing.", False
    except (TwinError, TypeError, ValueError, OverflowError) as error:
        return error.problems[0] if isinstance(error, TwinError) else f"{kind}: {error}.", False


def resume(session: Session, _: Message) -> None:
    """Continue the simulation."""
    refuse_ended(session, "resume")
    session.end_stepping()
    session.withdraw_message()
    session.phase = "running"
    session.begin_pace()


def pause(session: Session, _: Message) -> None:
    """Pause the simulation."""
    refuse_wall_clock(session, "pause")
    session.end_stepping()
    if session.phase == "running":
        session.phase = "paused"
        session.dead_man.release_hold()  # a control held through Run moves nothing


def step(session: Session, message: Message) -> bool:
    """Advance some communication steps, or to a communication point common to all members; answer at the end."""
    if session.wall_clock:
        raise RefusedError("step: the drives determine the time.")
    refuse_ended(session, "step")
    count = message.get("count", 1)
    if isinstance(count, bool) or not isinstance(count, int) or not 0 < count <= MAX_STEPS:
        raise RefusedError(f"step: {short(str(count))} is not a number of steps. Use 1 to {MAX_STEPS}.")
    if message.get("macro"):
        count = session.left_to_common(1) + (count - 1) * session.macro
    session.end_stepping()
    session.phase = "paused"
    session.left, session.stepping = count, message.get("number")
    return True


def pace(session: Session, message: Message) -> None:
    """Change the rate."""
    if session.wall_clock:
        raise RefusedError("pace: the drives determine the time.")
    rate = checked_rate(message.get("rate"))
    if rate > (fastest := session.executor.catalog.fastest_rate):
        raise RefusedError(f"pace: {rate:g} is above {fastest:g}. A scenario with controls runs at most at real time.")
    session.rate = session.pace.rate = rate
    session.begin_pace()


def reset(session: Session, message: Message) -> None:
    """Restart from the beginning, in a new folder, with the `values` of the message."""
    refuse_wall_clock(session, "reset")
    values = message.get("values", {})
    if not isinstance(values, dict):
        raise RefusedError("reset: values: expected names with their values.")
    session.first_values = values
    session.ending = session.again = True
    session.running = False


def stop(session: Session, _: Message) -> None:
    """End the session."""
    session.ending = True
    text = "STOP" if session.drives or session.executor.catalog.controls else "End"  # as on the button
    session.executor.add_done(session.simulated.time, "stop", text, "", by_operator=False)
    if session.phase != "ended":  # that message says why
        session.withdraw_message()


def set_value(session: Session, message: Message) -> None:
    """Set a parameter, or an input without a control."""
    session.executor.set(message["name"], message["value"])


def override(session: Session, message: Message) -> None:
    """Override a variable."""
    refuse_with_drives(session)
    session.executor.execute("override", message["name"], message["value"])


def release(session: Session, message: Message) -> None:
    """End an override."""
    refuse_with_drives(session)
    session.executor.execute("release", message["name"])


def trigger(session: Session, message: Message) -> None:
    """Apply an event of the scenario now."""
    key = message["key"]
    if not isinstance(key, str) or key not in session.prepared:
        raise RefusedError(f"there is no event {short(str(key))}.")
    refuse_with_drives(session)
    event = session.prepared[key][1]
    if isinstance(event, EventSpec) and event.kind == "set":
        session.executor.set(event.variable, event.value)  # inputs with a control are refused here, too
    elif isinstance(event, EventSpec):
        session.executor.execute(event.kind, event.variable, event.value)
    else:
        session.executor.refuse_full()
        session.strike(event)


def hold(session: Session, message: Message) -> None:
    """Renew the hold of an input; it goes to rest if the value is refused, and its press ends while nothing runs."""
    name, press, instant = message["name"], message["press"], message["instant"]
    if isinstance(press, bool) or not isinstance(press, int) or not 0 <= press < 2**63:
        raise RefusedError(f"hold: {short(str(press))} is not the number of a press.")
    if isinstance(instant, bool) or not isinstance(instant, int | float) or not isfinite(instant):
        raise RefusedError("hold: instant: expected a number of seconds.")
    try:
        name, value, rest = session.executor.check_hold(name, message["value"])
    except RefusedError:
        if isinstance(name, str):
            session.dead_man.release_hold(name)
        raise
    if session.phase != "running":
        session.dead_man.end_press(name, rest, press)
        return
    now = wall.monotonic()  # the same clock in all processes of a machine
    if session.dead_man.hold(name, value, rest, press, now - instant, now):
        session.confirm_hold(name)


def release_hold(session: Session, message: Message) -> None:
    """Move one input, or all, to rest."""
    name = message.get("name")
    session.dead_man.release_hold(name if isinstance(name, str) else "")


def refuse_ended(session: Session, what: str) -> None:
    """Raise RefusedError if a member has ended the simulation."""
    if session.phase == "ended":
        raise RefusedError(f"{what}: the simulation has ended. Reset it.")


def refuse_wall_clock(session: Session, what: str) -> None:
    """Raise RefusedError if drives determine the time and have started."""
    if session.wall_clock and session.has_stepped:
        raise RefusedError(f"{what}: the drives determine the time. Stop the session instead.")


def refuse_with_drives(session: Session) -> None:
    """Raise RefusedError if drives determine the time: they move only while an input is held."""
    if session.wall_clock:
        raise RefusedError(
            "overrides and events are disabled while drives determine the time. Hold a control to move an input."
        )


COMMAND_HANDLERS: Mapping[str, Callable[[Session, Message], object]] = {
    call.__name__: call
    for call in (resume, pause, step, pace, reset, stop, override, release, trigger, hold, release_hold)
} | {"set": set_value}
