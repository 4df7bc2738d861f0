"""Steps of the commissioning page: a command of `twin hil` each, with the fields for its options, in the tutorial's order."""

from __future__ import annotations

import math
import re
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hw_bridge.command.bench.motion import GENTLE, ROUND, SLOW
from hw_bridge.command.bench.step import SHARE
from hw_bridge.commission import EXAMPLES, SLOWEST_STOP, direction, homing
from hw_bridge.hardware import TARGET_SHARE
from twin.errors import TwinError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.commission import Axis

QUANTITY = re.compile(r"[-+]?[0-9.]+([eE][-+]?[0-9]+)? ?[A-Za-z°µ/^*0-9]*")  # the command says what it means
LONGEST = 40  # characters of it
NOT_HOMED = math.inf  # instead of a position
ROUNDING = 1e-9  # relative; of a limit that is shown in another unit
FILE_INDEPENDENT = frozenset({"status", "dump", "compare"})  # they concern the node itself
ALWAYS = "check"  # command that moves nothing, and must succeed also for a drive that was commissioned before
VARIANTS = frozenset({"--by-hand"})  # options that make another step of the same command


@dataclass(frozen=True)
class Entry:
    """A field for an option of the command. `per`: of a position (""), a speed ("/s"), an acceleration; None: a check box."""

    option: str
    label: str
    per: str | None = ""


BY, TO = Entry("by", "by"), Entry("to", "to (from home)")
VELOCITY, ACCELERATION = Entry("velocity", "speed", "/s"), Entry("acceleration", "acceleration", "/s^2")
DISTANCE, FROM_START = (
    Entry("distance", "at most, each way"),
    Entry("from-start", "count from here, not from home", None),
)


@dataclass(frozen=True)
class Step:
    """A command with its fields. `always`: options of this button. `is_bus_wide`: it names no node.

    `after`: command that must have succeeded before, unless the drive was commissioned earlier. `caption`: what it is for.
    """

    word: str
    button: str
    about: str
    entries: tuple[Entry, ...] = ()
    always: tuple[str, ...] = ()
    is_bus_wide: bool = False
    after: str = ""
    caption: str = ""

    @property
    def title(self) -> str:
        """Name of the step; the two kinds of `direction` differ by their button."""
        return f"{self.word}, {self.button}" if self.word == "direction" else self.word


READING = (
    Step(
        "scan", "scan", "Asks all node-IDs of the bus. Nothing is written.", is_bus_wide=True, caption="Find the nodes"
    ),
    Step(
        "status",
        "status",
        "State, limits, temperatures, voltages, and the last errors with a remedy.",
        caption="Read the drive",
    ),
    Step(
        "dump",
        "dump",
        "Saves all objects of the drive in a DCF file, before anything changes them.",
        caption="Save the drive",
    ),
    Step("compare", "compare", "Shows what differs between the drive and its dump.", caption="Compare with the save"),
    Step(
        "check",
        "check",
        "Lists what differs from the hardware file, and each object that a run writes, before and after.",
        (Entry("verbose", "also reasons, the drive's own settings, and the effect of each limit", None),),
        is_bus_wide=True,
        caption="Check the file",
    ),
)
STEPS = (  # in the order of the first-motion page
    *READING,
    Step(
        "direction",
        "push",
        "A push of slowly growing force both ways, a few increments far: does the encoder count the way "
        "the motor goes? Nothing holds the axis meanwhile.",
        after="check",
        caption="Does the encoder count with the motor?",
    ),
    Step(
        "direction",
        "by hand",
        "Power off: move it to where positions of the member grow, within 20 s. Is `inverted` right?",
        always=("--by-hand",),
        after="check",
        caption="Does the member count the same way?",
    ),
    Step(
        "jog",
        "power on for a jog",
        "Then it moves while you hold a button or an arrow key. Move it both ways, then press End.",
        (VELOCITY, ACCELERATION, DISTANCE, FROM_START),
        after="direction",
        caption="Move while a button is held",
    ),
    Step(
        "move",
        "move",
        "Goes there with a ramp, rests, and is disabled.",
        (BY, TO, VELOCITY, ACCELERATION, FROM_START),
        after="jog",
        caption="Go to a position",
    ),
    Step("home", "home", "", after="jog", caption="Find the reference position"),
    Step(
        "step",
        "step",
        "A small jump of its target, drawn beside the simulated drive's.",
        (BY, Entry("explain", "find the gains that explain a difference", None)),
        after="jog",
        caption="Measure the response",
    ),
)
ANY_TIME = (
    Step("reset", "reset", "Tells what a drive in Fault says of its cause, then resets it. Power stays off."),
    Step("restore", "restore", "Writes back what an interrupted command or run has left changed in the drive."),
    Step("enable", "enable", "Power on, the position held until End.", (FROM_START,), after="direction"),
    Step("disable", "disable", "Quick stop and power off, for a drive that another program left on."),
)


def limits_text(drive_axis: Axis) -> str:
    """Node and limits of a drive."""
    limits, to_text = drive_axis.keys.limits, drive_axis.format_quantity
    low, high = limits.position
    return (
        f"node {drive_axis.keys.node}, {to_text(low)} to {to_text(high)}, {to_text(limits.velocity, '/s')}, "
        f"{to_text(limits.acceleration, '/s^2')}; limits are those of the hardware file"
    )


def default(step: Step, entry: Entry, axis: Axis) -> str:
    """Value that the command uses for this drive if the option is missing; empty if it has none."""
    limits = axis.keys.limits
    if entry is VELOCITY:
        return axis.format_quantity(SLOW * limits.velocity, "/s")
    if entry is ACCELERATION:
        return axis.format_quantity(GENTLE * limits.acceleration, "/s^2")
    if entry is DISTANCE:
        return axis.format_quantity(ROUND[axis.unit])
    return axis.format_quantity(0.1 * limits.following_error) if step.word == "step" else ""


def bounds(step: Step, entry: Entry, axis: Axis) -> tuple[float, float]:
    """Least and greatest value that the command accepts, in SI units."""
    limits = axis.keys.limits
    low, high = limits.position
    if entry is VELOCITY:
        fastest = SLOWEST_STOP * limits.acceleration if step.word == "jog" else math.inf
        return 0.0, min(TARGET_SHARE * limits.velocity, fastest)
    if entry is ACCELERATION:
        return 0.0, limits.acceleration
    if entry is DISTANCE:
        return 0.0, math.inf
    if entry is TO:
        return low, high
    most = SHARE * limits.following_error if step.word == "step" else high - low
    return -most, most


def hint(step: Step, entry: Entry, axis: Axis) -> str:
    """Permitted values, in the unit of the drive."""
    low, high = bounds(step, entry, axis)
    if not math.isfinite(high):
        return "within the limits"
    if entry is BY and step.word == "move":
        return f"before homing up to {axis.format_quantity(ROUND[axis.unit])}"
    most = axis.format_quantity(high, entry.per or "")
    return f"up to {most}" if low == 0.0 and entry is not TO else f"{axis.format_quantity(low)} to {most}"


def problem(step: Step, entry: Entry, text: str, axis: Axis, position: float | None = None) -> str | None:
    """What is wrong with the text of a field, before the command checks it.

    `position`: from the reference as last read, `NOT_HOMED`, or None if it is unknown.
    """
    if not (text := text.strip()):
        is_optional = step.word == "move" and entry in (BY, TO)
        return None if is_optional else f"Expected a value: {hint(step, entry, axis)}."
    try:
        value = axis.si(quantity(entry, text, axis.unit), entry.label, entry.per or "")
    except TwinError as error:
        return str(error)
    low, high = bounds(step, entry, axis)
    if entry is BY and step.word == "move" and position is not None:
        is_homed, to_text = position != NOT_HOMED, axis.format_quantity
        reach = ROUND[axis.unit]
        low, high = (end - position for end in axis.keys.limits.position) if is_homed else (-reach, reach)
        if not low - ROUNDING <= value <= high + ROUNDING:
            why = f"it is at {to_text(position)}" if is_homed else "it is not homed, and an end stop may be nearer"
            return f"Expected {to_text(low)} to {to_text(high)}: {why}."
    slack = ROUNDING * abs(high)
    expected = (
        f"{axis.format_quantity(low)} to {axis.format_quantity(high)}" if entry is BY else hint(step, entry, axis)
    )
    is_inside = low - slack <= value <= high + slack and (value != 0.0 or entry is TO)
    return None if is_inside else f"Expected {expected}{'' if value else ', not 0'}."


def missing(step: Step, values: dict[str, Any]) -> str:
    """What has to be filled in before the command can start, or nothing."""
    if step.word != "move":
        return ""
    by, to = (str(values.get(entry.option) or "").strip() for entry in (BY, TO))
    if bool(by) == bool(to):
        return "Fill in either “by” or “to”." if TO.option in values else "Fill in “by”."
    return f"“to” counts from home: clear “{FROM_START.label}”." if to and values.get(FROM_START.option) else ""


def closed(entry: Entry, values: dict[str, Any], position: float | None) -> str:
    """Why a field of `by` and `to` cannot be filled in now; empty if it can, or to be cleared. `position`: as of `problem`."""
    other = {BY: TO, TO: BY}.get(entry)
    if other is None or TO.option not in values or str(values[entry.option] or "").strip():
        return ""
    if str(values.get(other.option) or "").strip():
        return f"or clear “{other.label}”"
    return "the drive is not homed" if entry is TO and position == NOT_HOMED else ""


def quantity(entry: Entry, text: str, unit: str = "m") -> str:
    """The text if it has the form of a quantity; else TwinError. `unit`: of positions, for the example."""
    if len(text) > LONGEST or not QUANTITY.fullmatch(text):
        example = EXAMPLES[f"{unit}{entry.per or ''}"]
        raise TwinError(f"{entry.label}: expected a number with its unit, such as {example!r}.")
    return text


def options(step: Step, values: dict[str, Any]) -> list[str]:
    """Convert the fields to command-line options; TwinError for invalid quantities. The command checks all of them."""
    arguments = list(step.always)
    for entry in step.entries:
        value = values.get(entry.option)
        if entry.per is None:
            arguments += [f"--{entry.option}"] * (value is True)
        elif isinstance(value, str) and (text := value.strip()):
            arguments.append(f"--{entry.option}={quantity(entry, text)}")
    return arguments


def is_step(step: Step, name: str, line: str) -> bool:
    """Whether a command line is this step of this drive."""
    words = shlex.split(line)
    return (
        words[2:3] == [step.word]
        and (step.is_bus_wide or name in words[3:5])
        and VARIANTS.intersection(words) == VARIANTS.intersection(step.always)
    )


def unavailable(step: Step, axis: Axis, simulated: bool) -> str:
    """Why this drive has not got a step; empty if it has."""
    if step.word == "home" and axis.keys.homing is None:
        return f"{axis.name}: {homing.NO_HOMING}"
    if step.always and simulated:
        return "A simulated drive cannot be pushed by hand. This step is for real ones."
    if step.word == "direction" and not step.always and not direction.can_push(axis.keys.drive):
        return f"{axis.keys.drive.title} has no cst to push with. Use “by hand”, then a short jog."
    return ""


def missing_steps(step: Step, is_done: Callable[[Step], bool]) -> dict[str, str]:
    """Commands that must succeed before this step, in their order, with their steps. One of each command is enough."""
    missing_before, word = dict[str, str](), step.after
    while word:
        before = {f"{number} ({each.title})": each for number, each in enumerate(STEPS, 1) if each.word == word}
        if not any(map(is_done, before.values())):
            missing_before = {word: " or ".join(before), **missing_before}
        word = next(each.after for each in before.values())
    return missing_before


def prerequisite(step: Step, is_done: Callable[[Step], bool], is_lifted: bool = False) -> str:
    """Which steps must succeed before this one; empty if none. `is_lifted`: the drive was commissioned before."""
    before = [text for word, text in missing_steps(step, is_done).items() if word == ALWAYS or not is_lifted]
    return f"Do step {', then '.join(before)} first." if before else ""


def caution(step: Step, is_done: Callable[[Step], bool]) -> str:
    """Warning at the button of a step whose order was lifted: what was skipped, and what may happen; empty if nothing was."""
    before = {word: text for word, text in missing_steps(step, is_done).items() if word != ALWAYS}
    risk = ": it may move the wrong way" if "direction" in before else ""
    return f"Not checked: {', '.join(before)}{risk}." if before else ""


def alternative(step: Step, is_done: Callable[[Step], bool]) -> Step | None:
    """Another step of the same command that has succeeded, so that this one may be skipped; None if there is none."""
    return next((each for each in STEPS if each.word == step.word and each != step and is_done(each)), None)


def next_step(axis: Axis, simulated: bool, is_done: Callable[[Step], bool], begin: int = 0) -> Step | None:
    """The first step, from number `begin` on, that the drive has and of whose command none is done; None if there is none."""
    done_words = {step.word for step in STEPS if is_done(step)}
    return next(
        (step for step in STEPS[begin:] if step.word not in done_words and not unavailable(step, axis, simulated)), None
    )
