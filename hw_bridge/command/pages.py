"""Commissioning in the browser: the steps of `twin hil`, from a scan to a step response, on one page.

Over 400 lines: the cards of one page, in the order in which they stand on it.

Each step is a command (`typed`), with fields for its options; its output is shown. The page holds a button
and reports its presence; every decision about motion is made in the process of the command.
"""

from __future__ import annotations

import base64
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hw_bridge.command.bench.motion import ramp
from hw_bridge.command.typed import Typed
from hw_bridge.commission import EXAMPLES, axis, homing
from hw_bridge.hardware import NodeKeys
from twin.console import Panel
from twin.errors import TwinError

if TYPE_CHECKING:
    from hw_bridge.commission import Axis
    from twin.console import Host

TITLE = "Commissioning"
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")  # of a node
QUANTITY = re.compile(r"[-+]?[0-9.]+([eE][-+]?[0-9]+)? ?[A-Za-z°µ/^*0-9]*")  # the command says what it means
LONGEST = 40  # characters of it
SHOWN = {"m": ("mm", 1e3), "rad": ("deg", 57.29577951308232)}
NUMBERS = ("looks_one", "looks_two", "looks_3", "looks_4", "looks_5", "looks_6")  # icons of the steps
DONE = "icon=check done-icon=check color=positive done-color=positive"
ENDED = ("jog", "enable")  # by the person, in an orderly way


@dataclass(frozen=True)
class Entry:
    """A field for an option of the command. `per`: of a position (""), a speed ("/s"), an acceleration; None: a check box."""

    option: str
    label: str
    per: str | None = ""


BY, TO = Entry("by", "by"), Entry("to", "to (homed)")
VELOCITY, ACCELERATION = Entry("velocity", "speed", "/s"), Entry("acceleration", "acceleration", "/s^2")
HOMED = Entry("homed", "homed since power-on", None)


@dataclass(frozen=True)
class Step:
    """A command with its fields. `always`: options of this button."""

    word: str
    button: str
    about: str
    entries: tuple[Entry, ...] = ()
    always: tuple[str, ...] = ()


STEPS = (  # in the order of the first-motion page
    Step(
        "direction",
        "push",
        "A push of slowly growing force both ways, a few increments far: does the encoder count the way "
        "the motor goes? Nothing holds the axis meanwhile.",
    ),
    Step(
        "direction",
        "by hand",
        "Power off: move it to where positions of the member grow, within 20 s. Is `inverted` right?",
        always=("--by-hand",),
    ),
    Step(
        "jog",
        "power on for a jog",
        "Then it moves while you hold a button or an arrow key.",
        (VELOCITY, ACCELERATION, Entry("distance", "at most, each way"), HOMED),
    ),
    Step("move", "move", "Goes there with a ramp, rests, and is disabled.", (BY, TO, VELOCITY, ACCELERATION, HOMED)),
    Step("home", "home", ""),
    Step(
        "step",
        "step",
        "A small jump of its target, drawn beside the simulated drive's.",
        (BY, Entry("explain", "find the gains that explain a difference", None)),
    ),
)
ANY_TIME = (
    Step("reset", "reset", "Tells what a drive in Fault says of its cause, then resets it. Power stays off."),
    Step("enable", "enable", "Power on, its place held, until you end it.", (HOMED,)),
    Step("disable", "disable", "Quick stop and power off, for a drive that another program left on."),
)


def options(step: Step, values: dict[str, Any]) -> list[str]:
    """Convert the fields to command-line options; TwinError for invalid quantities. The command checks all of them."""
    arguments = list(step.always)
    for entry in step.entries:
        value = values.get(entry.option)
        if entry.per is None:
            arguments += [f"--{entry.option}"] * (value is True)
        elif isinstance(value, str) and (text := value.strip()):
            if len(text) > LONGEST or not QUANTITY.fullmatch(text):
                raise TwinError(f"{entry.label}: expected a number with its unit, such as '1 mm'.")
            arguments.append(f"--{entry.option}={text}")
    return arguments


class Page:
    """The page in one browser."""

    def __init__(self, console: Host, is_operator: Callable[[], bool], typed: Typed) -> None:
        self.console, self.is_operator, self.typed = console, is_operator, typed
        self.folder = console.runs / "commissioning"

    async def run_as_operator(self, what: Callable[[], None]) -> None:
        """Run an action outside of the server's loop if this page is the operator's; show its error."""
        from nicegui import run, ui

        if not self.is_operator():
            ui.notify("This page only watches: another page operates.", type="warning", position="top")
            return
        try:
            await run.io_bound(what)
        except TwinError as error:
            ui.notify(str(error), type="warning", position="top", timeout=8000, multi_line=True)

    def begin(self, step: Step, drive_axis: Axis, values: dict[str, Any]) -> None:
        """Begin a step of an axis."""
        arguments, speed = options(step, values), (0.0, "")
        if step.word == "jog":
            unit, factor = SHOWN[drive_axis.unit]
            speed = (
                factor * ramp(drive_axis, values.get("velocity") or None, values.get("acceleration") or None)[0],
                f"{unit}/s",
            )
        if step.word == "step":
            self.folder.mkdir(parents=True, exist_ok=True)
            arguments.append(f"--plot={self.plot(drive_axis.name)}")
        self.typed.begin(step.word, drive_axis.name, arguments, speed)

    def plot(self, name: str) -> Path:
        """Path of a step response's figure."""
        return self.folder / f"{name}_step.svg"

    def dump(self, name: str) -> Path:
        """Path of a drive's parameter dump."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / f"{name}.dcf"


def fill(console: Host, is_operator: Callable[[], bool]) -> None:
    """Build the page: each drive with its steps, and the running command."""
    from nicegui import ui

    typed = console.activities[TITLE]
    assert isinstance(typed, Typed)
    page, keys = Page(console, is_operator, typed), typed.keys
    with ui.element("div").classes("twin-desk"):
        with ui.element("div").classes("twin-card twin-hand"):
            if not keys.simulated:
                live_state(page)
            now(page)
        with ui.element("div").classes("twin-card twin-curves"):
            bus = f"{keys.interface} {keys.channel}".strip() or "simulated: each command has a bus of its own"
            ui.label(keys.title or typed.file.name).classes("twin-h")
            ui.label(f"{typed.file}: {bus}").classes("twin-soft")
            kind, text = armed(typed)
            ui.html(f'<p class="twin-state twin-{kind}">{text}</p>', sanitize=False)
            ui.button("scan", on_click=lambda: page.run_as_operator(lambda: typed.begin("scan"))).props(
                "dense no-caps outline"
            )
        for _, name, station in keys.stations():
            if NAME.fullmatch(name):
                with ui.element("div").classes("twin-card twin-curves"):
                    node(page, name, station)


def armed(typed: Typed) -> tuple[str, str]:
    """Whether anything may move, and its label."""
    if typed.keys.is_software():
        return "good", "simulated drives"
    return ("warn", "armed: drives may move") if typed.console.arm else ("good", "not armed: nothing moves from here")


def node(page: Page, name: str, station: object) -> None:
    """Card of a drive or module: read commands, and a drive's steps."""
    from nicegui import ui

    typed = page.typed
    ui.label(name).classes("twin-h")
    with ui.row().classes("items-center full-width gap-1"):
        for word, more in (("status", False), ("dump", True), ("compare", True)):

            def read(word: str = word, more: bool = more) -> None:
                typed.begin(word, name, [str(page.dump(name))] if more else [])

            ui.button(word, on_click=lambda read=read: page.run_as_operator(read)).props("dense no-caps outline")
    if not isinstance(station, NodeKeys):
        return
    drive_axis = axis(typed.file, typed.keys, name)
    limits, to_text = station.limits, drive_axis.format_quantity
    low, high = limits.position
    ui.label(
        f"node {station.node}, {to_text(low)} to {to_text(high)}, {to_text(limits.velocity, '/s')}, "
        f"{to_text(limits.acceleration, '/s^2')}; limits are those of the hardware file"
    ).classes("twin-soft")
    with ui.stepper(value=title(STEPS[0])).props("vertical header-nav flat").classes("full-width"):
        items = []
        for command_step, icon in zip(STEPS, NUMBERS, strict=True):
            # the library calls each step before the chosen one done: here it is, once its command has succeeded
            look = f"icon={icon} active-icon={icon} done-icon={icon} done-color=soft"
            with ui.step(title(command_step)).props(look) as item:
                step(page, command_step, drive_axis)
            items.append((command_step, item))
    ui.label("At any time").classes("twin-soft")
    for command_step in ANY_TIME:
        with ui.expansion(title(command_step)).classes("full-width"):
            step(page, command_step, drive_axis)

    def mark_done() -> None:
        for command_step, item in items:
            if is_done(typed, command_step, name):
                item.props(DONE)

    ui.timer(0.5, mark_done)


def title(command_step: Step) -> str:
    """Name of a step; the two kinds of `direction` differ by their button."""
    return f"{command_step.word}, {command_step.button}" if command_step.word == "direction" else command_step.word


def is_done(typed: Typed, command_step: Step, name: str) -> bool:
    """Whether a step of this drive has succeeded since the server was started."""
    by_hand = "--by-hand"
    return any(
        code == 0
        and line.startswith(f"twin hil {command_step.word} {name} ")
        and (by_hand in line) == (by_hand in command_step.always)
        for _, line, code in list(typed.done)
    )


def step(page: Page, command_step: Step, drive_axis: Axis) -> None:
    """Description, fields and button of a step."""
    from nicegui import ui

    refused, values = "", dict[str, Any]()
    about = [command_step.about] if command_step.about else []
    if command_step.word == "home":
        if drive_axis.keys.homing is None:
            refused = f"{drive_axis.name}: {homing.NO_HOMING}"
        else:
            about = [
                f"Method {drive_axis.keys.homing.method}, then it is at {drive_axis.format_quantity(drive_axis.keys.homing.at)}:"
            ]
            about += [f"{number}. {text}" for number, text in enumerate(homing.explained(drive_axis.keys), 1)]
    for text in about:
        ui.label(text).classes("twin-soft")
    with ui.row().classes("items-center full-width gap-2"):
        for entry in command_step.entries:
            if entry.per is None:
                ui.checkbox(
                    entry.label, on_change=lambda event, key=entry.option: values.update({key: event.value})
                ).props("dense")
            else:
                ui.input(
                    entry.label,
                    placeholder=EXAMPLES[f"{drive_axis.unit}{entry.per}"],
                    on_change=lambda event, key=entry.option: values.update({key: event.value}),
                ).props(f"dense outlined maxlength={LONGEST}").classes("twin-entry")
        button = ui.button(
            command_step.button,
            on_click=lambda: page.run_as_operator(lambda: page.begin(command_step, drive_axis, values)),
        )
        button.props("dense no-caps outline")
    if refused:
        ui.label(refused).classes("twin-bad")
    elif page.typed.needs_arm(command_step.word) and not command_step.always:
        refused = "not armed"
        ui.label("Real drives, not armed: end this console and start it with --arm.").classes("twin-soft")
    button.set_enabled(not refused)


def live_state(page: Page) -> None:
    """State, position and current of all nodes between commands, with a button that switches it."""
    from nicegui import ui

    typed = page.typed
    with ui.row().classes("items-center full-width no-wrap gap-2"):
        button = ui.button(
            on_click=lambda: page.run_as_operator(lambda: typed.switch_watch(not typed.watch.is_on))
        ).props("dense no-caps outline no-wrap")
        ui.label("Only reads, between commands. Leave it off while another program has the drives.").classes(
            "twin-soft"
        )
    values = ui.html("", sanitize=False).classes("twin-safety full-width")

    def look() -> None:
        button.text = "stop reading" if typed.watch.is_on else "read live state"
        values.content = state_text(typed)

    look()
    ui.timer(0.25, look)


def state_text(typed: Typed) -> str:
    """The latest reading as HTML; why there is none."""
    watch = typed.watch
    if watch.problem:
        return f'<p class="twin-bad">Live state: {escape(watch.problem)}</p>'
    if not watch.is_on:
        return ""
    if not watch.rows:
        reason = "It continues after the command." if typed.running else "Waiting for the first reading."
        return f'<p class="twin-soft">{reason}</p>'
    articles = []
    for name, rows in watch.rows.items():
        listed_rows = "".join(f"<dt>{escape(title)}</dt><dd>{escape(value)}</dd>" for title, value in rows)
        articles.append(f"<article><b>{escape(name)}</b><dl>{listed_rows}</dl></article>")
    return "".join(articles)


def now(page: Page) -> None:
    """Card of the running command: command line, button, output, history."""
    from nicegui import ui

    typed, last_shown = page.typed, dict[str, Any]()

    @ui.refreshable
    def running_command() -> None:
        show_running(page)

    running_command()
    text = ui.label("").classes("twin-told twin-bench-said")
    plot = ui.html("", sanitize=False)
    before = ui.html("", sanitize=False)

    def look() -> None:
        if last_shown.get("changed") == typed.changed:
            return
        last_shown["changed"] = typed.changed
        text.text = typed.text
        stage = (typed.running, typed.line, typed.controls)
        if last_shown.get("stage") == stage:
            return
        last_shown["stage"] = stage
        running_command.refresh()
        plot.content = picture(page)
        before.content = listed(typed)

    look()
    ui.timer(0.1, look)


def show_running(page: Page) -> None:
    """The running command, with the button of a jog and an orderly end."""
    from nicegui import ui

    from twin.console import Desk, control

    typed = page.typed
    if not typed.line:
        ui.label("Each button runs the command that you would type; it is shown here.").classes("twin-soft")
        return
    with ui.row().classes("items-center full-width no-wrap"):
        ui.label(typed.line).classes("twin-told col")
        if typed.running and typed.word in ENDED:
            ui.button("end", on_click=lambda: page.run_as_operator(typed.end)).props("dense no-caps outline")
        elif typed.running:
            ui.spinner(size="20px")
    if not typed.running and typed.done:
        kind, text = result(typed)
        ui.label(text).classes(f"twin-state twin-{kind}")
    for name in typed.controls:
        speed, unit = typed.speed
        Desk([control(name, name, "Held: it moves.", ("ArrowRight", "ArrowLeft"), unit, speed)])


def result(typed: Typed) -> tuple[str, str]:
    """Kind and sentence of how the latest command ended: its error, if it printed one."""
    what, code = f"{typed.word} {typed.node}".strip(), typed.done[0][2]
    if code == 0:
        return "good", f"✓ {what}: done"
    _, marker, error = typed.text.rpartition("error: ")
    return "bad", f"✗ {what}: {' '.join(error.split()) if marker else f'ended with exit code {code}'}"


def picture(page: Page) -> str:
    """The latest step response as an image."""
    typed = page.typed
    path = page.plot(typed.node)
    if typed.running or typed.word != "step" or not typed.done or typed.done[0][2] or not path.is_file():
        return ""
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<img class="full-width" alt="response to the step" src="data:image/svg+xml;base64,{data}">'


def listed(typed: Typed) -> str:
    """History of commands, the latest first."""
    rows = []
    for begin_time, line, code in list(typed.done):
        clock = time.strftime("%H:%M:%S", time.localtime(begin_time))
        failed = f' <b class="twin-bad">exit code {code}</b>' if code else ""
        rows.append(f'<li><span class="twin-soft">{clock}</span> {escape(line)}{failed}</li>')
    return f'<ul class="twin-typed">{"".join(rows)}</ul>'


PANEL = Panel(TITLE, fill, hardware=True, path="/bench", activity=Typed)
