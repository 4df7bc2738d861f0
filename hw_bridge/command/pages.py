"""Commissioning in the browser: the steps of `twin hil`, from who is on the bus to a step response, as one page.

Each is the command that one types (`typed`), with fields for its options; what it prints is shown. The page holds a button
and tells that it is looked at; everything that decides about motion is in the process of the command.
"""

from __future__ import annotations

import base64
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hw_bridge.command.bench.motion import ramp
from hw_bridge.command.typed import Typed
from hw_bridge.commission import EXAMPLES, axis, homing
from hw_bridge.hardware import NodeKeys
from hw_bridge.master import homing_conflict
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
ENDED = ("jog", "enable")  # by the person, in an orderly way


@dataclass(frozen=True)
class Entry:
    """A field: an option of the command. `per`: of a place (""), a speed ("/s"), an acceleration; None: yes or no."""

    option: str
    label: str
    per: str | None = ""


BY, TO = Entry("by", "by"), Entry("to", "to (homed)")
VELOCITY, ACCELERATION = Entry("velocity", "speed", "/s"), Entry("acceleration", "acceleration", "/s^2")
HOMED = Entry("homed", "homed since power-on", None)


@dataclass(frozen=True)
class Step:
    """A command with its fields. `always`: options that belong to this button."""

    word: str
    button: str
    about: str
    entries: tuple[Entry, ...] = ()
    always: tuple[str, ...] = ()


STEPS = (
    Step("reset", "reset", "Tells what a drive in Fault says of its cause, then resets it. Power stays off."),
    Step("direction", "by hand", "Power off: move it to where positions of the member grow, within 20 s. Is `inverted` right?",
         always=("--by-hand",)),
    Step("direction", "push", "A push of slowly growing force both ways, a few increments far: does the encoder count the way "
         "the motor goes? Nothing holds the axis meanwhile."),
    Step("enable", "enable", "Power on, its place held, until you end it.", (HOMED,)),
    Step("disable", "disable", "Quick stop and power off, for a drive that another program left on."),
    Step("jog", "power on for a jog", "Then it moves while you hold a button or an arrow key.",
         (VELOCITY, ACCELERATION, Entry("distance", "at most, each way"), HOMED)),
    Step("home", "home", ""),
    Step("move", "move", "Goes there with a ramp, rests, and is disabled.", (BY, TO, VELOCITY, ACCELERATION, HOMED)),
    Step("step", "step", "A small jump of its target, drawn beside the simulated drive's.",
         (BY, Entry("explain", "find the gains that explain a difference", None))),
)  # fmt: skip


def options(step: Step, values: dict[str, Any]) -> list[str]:
    """What was filled in, as it is typed; TwinError for what can be no quantity. The command checks all of it."""
    found = list(step.always)
    for entry in step.entries:
        value = values.get(entry.option)
        if entry.per is None:
            found += [f"--{entry.option}"] * (value is True)
        elif isinstance(value, str) and (text := value.strip()):
            if len(text) > LONGEST or not QUANTITY.fullmatch(text):
                raise TwinError(f"{entry.label}: expected a number with its unit, such as '1 mm'.")
            found.append(f"--{entry.option}={text}")
    return found


class Page:
    """The page in one browser."""

    def __init__(self, console: Host, is_operator: Callable[[], bool], typed: Typed) -> None:
        self.console, self.is_operator, self.typed = console, is_operator, typed
        self.folder = console.runs / "commissioning"

    async def ask(self, what: Callable[[], None]) -> None:
        """Do it if this page operates, outside of the server's loop; what was refused is told."""
        from nicegui import run, ui

        if not self.is_operator():
            ui.notify("This page only watches: another page operates.", type="warning", position="top")
            return
        try:
            await run.io_bound(what)
        except TwinError as error:
            ui.notify(str(error), type="warning", position="top", timeout=8000, multi_line=True)

    def begin(self, step: Step, one: Axis, values: dict[str, Any]) -> None:
        """Begin a step of an axis."""
        found, speed = options(step, values), (0.0, "")
        if step.word == "jog":
            unit, factor = SHOWN[one.unit]
            speed = (
                factor * ramp(one, values.get("velocity") or None, values.get("acceleration") or None)[0],
                f"{unit}/s",
            )
        if step.word == "step":
            self.folder.mkdir(parents=True, exist_ok=True)
            found.append(f"--plot={self.plot(one.name)}")
        self.typed.begin(step.word, one.name, found, speed)

    def plot(self, name: str) -> Path:
        """Where the response to a step is drawn."""
        return self.folder / f"{name}_step.svg"

    def dump(self, name: str) -> Path:
        """Where a drive's parameters are kept."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / f"{name}.dcf"


def fill(console: Host, is_operator: Callable[[], bool]) -> None:
    """The page: each drive with its steps, and what goes on."""
    from nicegui import ui

    typed = console.activities[TITLE]
    assert isinstance(typed, Typed)
    page, keys = Page(console, is_operator, typed), typed.keys
    with ui.element("div").classes("twin-desk"):
        with ui.element("div").classes("twin-card twin-hand"):
            now(page)
        with ui.element("div").classes("twin-card twin-curves"):
            bus = f"{keys.interface} {keys.channel}".strip() or "simulated: each command has a bus of its own"
            ui.label(keys.title or typed.file.name).classes("twin-h")
            ui.label(f"{typed.file}: {bus}").classes("twin-soft")
            kind, text = armed(typed)
            ui.html(f'<p class="twin-state twin-{kind}">{text}</p>', sanitize=False)
            ui.button("scan", on_click=lambda: page.ask(lambda: typed.begin("scan"))).props("dense no-caps outline")
        for _, name, station in keys.stations():
            if NAME.fullmatch(name):
                with ui.element("div").classes("twin-card twin-curves"):
                    node(page, name, station)


def armed(typed: Typed) -> tuple[str, str]:
    """Whether anything may move, and how it is shown."""
    if typed.keys.is_software():
        return "good", "simulated drives"
    return ("warn", "armed: drives may move") if typed.console.arm else ("good", "not armed: nothing moves from here")


def node(page: Page, name: str, station: object) -> None:
    """A drive or module: what is read of it, and a drive's steps."""
    from nicegui import ui

    typed = page.typed
    ui.label(name).classes("twin-h")
    with ui.row().classes("items-center full-width gap-1"):
        for word, more in (("status", False), ("dump", True), ("compare", True)):

            def read(word: str = word, more: bool = more) -> None:
                typed.begin(word, name, [str(page.dump(name))] if more else [])

            ui.button(word, on_click=lambda read=read: page.ask(read)).props("dense no-caps outline")
    if not isinstance(station, NodeKeys):
        return
    one = axis(typed.file, typed.keys, name)
    limits, told = station.limits, one.format_quantity
    low, high = limits.position
    ui.label(
        f"node {station.node}, {told(low)} to {told(high)}, {told(limits.velocity, '/s')}, "
        f"{told(limits.acceleration, '/s^2')}; limits are those of the hardware file"
    ).classes("twin-soft")
    for place in STEPS:
        with ui.expansion(f"{place.word}, {place.button}" if place.word == "direction" else place.word).classes(
            "full-width"
        ):
            step(page, place, one)


def step(page: Page, place: Step, one: Axis) -> None:
    """What a step does, its fields, its button."""
    from nicegui import ui

    refused, values = "", dict[str, Any]()
    about = [place.about] if place.about else []
    if place.word == "home":
        refused = homing_conflict(one.name, one.keys, one.format_quantity)
        if one.keys.homing is not None:
            about = [f"Method {one.keys.homing.method}, then it is at {one.format_quantity(one.keys.homing.at)}:"]
            about += [f"{number}. {text}" for number, text in enumerate(homing.explained(one.keys), 1)]
    for text in about:
        ui.label(text).classes("twin-soft")
    with ui.row().classes("items-center full-width gap-2"):
        for entry in place.entries:
            if entry.per is None:
                ui.checkbox(
                    entry.label, on_change=lambda said, key=entry.option: values.update({key: said.value})
                ).props("dense")
            else:
                ui.input(
                    entry.label, placeholder=EXAMPLES[f"{one.unit}{entry.per}"],
                    on_change=lambda said, key=entry.option: values.update({key: said.value}),
                ).props(f"dense outlined maxlength={LONGEST}").classes("twin-entry")  # fmt: skip
        button = ui.button(place.button, on_click=lambda: page.ask(lambda: page.begin(place, one, values)))
        button.props("dense no-caps outline")
    if refused:
        ui.label(refused).classes("twin-bad")
    elif page.typed.needs_arm(place.word) and not place.always:
        refused = "not armed"
        ui.label("Real drives, not armed: end this console and start it with --arm.").classes("twin-soft")
    button.set_enabled(not refused)


def now(page: Page) -> None:
    """What goes on: the command as it is typed, the button to hold, what is printed, what was typed before."""
    from nicegui import ui

    typed, seen = page.typed, dict[str, Any]()

    @ui.refreshable
    def hand() -> None:
        begun(page)

    hand()
    text = ui.label("").classes("twin-told twin-bench-said")
    drawn = ui.html("", sanitize=False)
    before = ui.html("", sanitize=False)

    def look() -> None:
        if seen.get("changed") == typed.changed:
            return
        seen["changed"] = typed.changed
        text.text = typed.text
        stage = (typed.running, typed.line, typed.controls)
        if seen.get("stage") == stage:
            return
        seen["stage"] = stage
        hand.refresh()
        drawn.content = picture(page)
        before.content = listed(typed)

    look()
    ui.timer(0.1, look)


def begun(page: Page) -> None:
    """The command that goes on, with the button of a jog and an orderly end."""
    from nicegui import ui

    from twin.console import Desk, control

    typed = page.typed
    if not typed.line:
        ui.label("Each button runs the command that you would type; it is shown here.").classes("twin-soft")
        return
    with ui.row().classes("items-center full-width no-wrap"):
        ui.label(typed.line).classes("twin-told col")
        if typed.running and typed.word in ENDED:
            ui.button("end", on_click=lambda: page.ask(typed.end)).props("dense no-caps outline")
        elif typed.running:
            ui.spinner(size="20px")
    for name in typed.controls:
        speed, unit = typed.speed
        Desk([control(name, name, "Held: it moves.", ("ArrowRight", "ArrowLeft"), unit, speed)])


def picture(page: Page) -> str:
    """The response to a step that was just drawn."""
    typed = page.typed
    path = page.plot(typed.node)
    if typed.running or typed.word != "step" or not typed.done or typed.done[0][2] or not path.is_file():
        return ""
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<img class="full-width" alt="response to the step" src="data:image/svg+xml;base64,{data}">'


def listed(typed: Typed) -> str:
    """What was typed before, the latest first."""
    from html import escape

    rows = []
    for begun, line, code in list(typed.done):
        clock = time.strftime("%H:%M:%S", time.localtime(begun))
        failed = f' <b class="twin-bad">exit code {code}</b>' if code else ""
        rows.append(f'<li><span class="twin-soft">{clock}</span> {escape(line)}{failed}</li>')
    return f'<ul class="twin-typed">{"".join(rows)}</ul>'


PANEL = Panel(TITLE, fill, hardware=True, path="/bench", activity=Typed)
