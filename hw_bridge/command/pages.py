"""Commissioning in the browser: the steps of `twin hil`, from a scan to a step response, on one page.

Each step is a command (`commissioning_steps`, `typed`), with fields for its options; its output is shown. The page holds a button
and reports its presence; every decision about motion is made in the process of the command.

Over 400 lines: one page, from its live state to the last step; what a step is and does is in `commissioning_steps` and `typed`.
"""

from __future__ import annotations

import base64
import re
import time
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hw_bridge.command import commissioning_steps as steps
from hw_bridge.command.bench.motion import ramp
from hw_bridge.command.bench.single_axis import STOPPED_IN_STATE
from hw_bridge.command.commissioning_steps import ANY_TIME, READING, STEPS, Entry, Step
from hw_bridge.command.typed import Typed
from hw_bridge.commission import HOLD, axis, homing
from hw_bridge.hardware import NodeKeys
from twin.console import Panel
from twin.errors import TwinError

if TYPE_CHECKING:
    from nicegui.element import Element
    from nicegui.events import ValueChangeEventArguments

    from hw_bridge.commission import Axis
    from twin.console import Host

TITLE = "Commissioning"
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")  # of a node
SHOWN = {"m": ("mm", 1e3), "rad": ("deg", 57.29577951308232)}
DONE = "icon=check done-icon=check color=positive done-color=positive"
ENDED = ("jog", "enable")  # by the person, in an orderly way
REFRESH_PERIOD = 0.1  # of the running command [s]
LIVE = {"6041h": "state", "6064h": "position", "606Ch": "velocity", "6078h": "current", "603Fh": "error"}
RAW = re.compile(r" \([^()]*\)$")  # value in the drive's own unit, behind a quantity
ERROR = re.compile(r"(?:^|(?<=  ))error: ", re.MULTILINE)  # before the error that a command prints at its end
JOG_END = re.compile(r"(upper|lower) end \((.*)\)\s*$")  # at the end of the live values of a jog
EXPIRED = (
    f"Stopped by the dead-man switch: this page answered later than {HOLD // 10**6} ms. "
    "Release the button, then hold it again."
)
STOPPED = 130  # exit code after Ctrl-C, which STOP and Esc send
SIMULATED = (
    "Each command starts new simulated drives: positions count from 0 again, and nothing stays set. "
    "State and position are shown while a command moves a drive; between commands there is none."
)


class Page:
    """The page in one browser."""

    def __init__(self, console: Host, is_operator: Callable[[], bool], typed: Typed) -> None:
        self.console, self.is_operator, self.typed = console, is_operator, typed
        self.folder = console.runs / "commissioning"
        self.commissioned: set[str] = set()  # drives whose steps need no order
        self.updates: list[
            Callable[[], None]
        ] = []  # of buttons and steps, when a command begins, ends or a field changes

    def update(self) -> None:
        """Update all buttons and steps."""
        for update in self.updates:
            update()

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

    def begin(self, step: Step, name: str, values: dict[str, Any], drive_axis: Axis | None = None) -> None:
        """Begin a step of a drive or module."""
        arguments, speed = steps.options(step, values), (0.0, "")
        if step.word == "jog" and drive_axis is not None:
            unit, factor = SHOWN[drive_axis.unit]
            speed = (
                factor * ramp(drive_axis, values.get("velocity") or None, values.get("acceleration") or None)[0],
                f"{unit}/s",
            )
        if step.word in ("step", "dump", "compare"):
            self.folder.mkdir(parents=True, exist_ok=True)
            arguments.append(f"--plot={self.plot(name)}" if step.word == "step" else str(self.dump(name)))
        self.typed.begin(step.word, "" if step.is_bus_wide else name, arguments, speed)

    def plot(self, name: str) -> Path:
        """Path of a step response's figure."""
        return self.folder / f"{name}_step.svg"

    def dump(self, name: str) -> Path:
        """Path of a drive's parameter dump."""
        return self.folder / f"{name}.dcf"


def fill(console: Host, is_operator: Callable[[], bool]) -> None:
    """Build the page: live state, the running command, and each drive with its steps."""
    from nicegui import ui

    typed = console.activities[TITLE]
    assert isinstance(typed, Typed)
    page, keys = Page(console, is_operator, typed), typed.keys
    with ui.element("div").classes("twin-desk"):
        if not keys.simulated:
            with ui.element("div").classes("twin-card twin-live"):
                live_state(page)
        with ui.element("div").classes("twin-card twin-hand"):
            now(page)
        with ui.element("div").classes("twin-card twin-curves"):
            bus = f"{keys.interface} {keys.channel}".strip() or "simulated: each command has a bus of its own"
            ui.label(keys.title or typed.file.name).classes("twin-h")
            ui.label(f"{typed.file}: {bus}").classes("twin-soft")
            kind, text = armed(typed)
            ui.html(f'<p class="twin-state twin-{kind}">{text}</p>', sanitize=False)
            if keys.simulated:
                ui.label(SIMULATED).classes("twin-soft")
        for _, name, station in keys.stations():
            if NAME.fullmatch(name):
                with ui.element("div").classes("twin-card twin-curves"):
                    ui.label(name).classes("twin-h")
                    if isinstance(station, NodeKeys):
                        drive(page, axis(typed.file, keys, name))
                    else:
                        with ui.row().classes("items-center full-width gap-1"):
                            for command_step in READING:
                                step_button(page, command_step, name, {})
    page.update()


def armed(typed: Typed) -> tuple[str, str]:
    """Whether anything may move, and its label."""
    if typed.keys.is_software():
        return "good", "simulated drives"
    return ("warn", "armed: drives may move") if typed.console.arm else ("good", "not armed: nothing moves from here")


def drive(page: Page, drive_axis: Axis) -> None:
    """Limits and steps of a drive."""
    from nicegui import ui

    typed, name, limits, to_text = page.typed, drive_axis.name, drive_axis.keys.limits, drive_axis.format_quantity
    low, high = limits.position
    ui.label(
        f"node {drive_axis.keys.node}, {to_text(low)} to {to_text(high)}, {to_text(limits.velocity, '/s')}, "
        f"{to_text(limits.acceleration, '/s^2')}; limits are those of the hardware file"
    ).classes("twin-soft")

    def change(event: ValueChangeEventArguments[Any]) -> None:
        (page.commissioned.add if event.value else page.commissioned.discard)(name)
        page.update()

    ui.switch("commissioned before: steps in any order", on_change=change).props("dense")
    items: list[tuple[Step, Element]] = []
    with (
        ui.stepper(value=STEPS[0].title)
        .props("vertical header-nav flat active-icon=none done-icon=none")
        .classes("full-width") as stepper
    ):
        for number, command_step in enumerate(STEPS, 1):
            # the library calls each step before the chosen one done: here it is, once its command has succeeded
            look = f"prefix={number} done-color=soft"
            with ui.step(command_step.title).props(look) as item:
                step(page, command_step, drive_axis)
            items.append((command_step, item))
    ui.label("At any time").classes("twin-soft")
    for command_step in ANY_TIME:
        with ui.expansion(command_step.title).classes("full-width") as expansion:
            step(page, command_step, drive_axis)
        items.append((command_step, expansion))

    done_steps: list[Step] = []

    def mark() -> None:
        for command_step, item in items:
            runs = typed.running and steps.is_step(command_step, name, typed.line)
            item.props["caption"] = (
                "running"
                if runs
                else steps.unavailable(command_step, drive_axis, page.typed.keys.simulated).partition(". ")[0] or None
            )
            is_new = command_step in STEPS and command_step not in done_steps
            if is_new and steps.is_done(command_step, name, list(typed.done)):
                done_steps.append(command_step)
                item.props(DONE, remove="prefix")
                if stepper.value == command_step.title:
                    stepper.value = next_step(command_step, drive_axis, typed.keys.simulated)

    page.updates.append(mark)


def next_step(before: Step, drive_axis: Axis, simulated: bool) -> str:
    """Title of the next step that the drive has; the same if there is none."""
    later = STEPS[STEPS.index(before) + 1 :]
    return next((each.title for each in later if not steps.unavailable(each, drive_axis, simulated)), before.title)


def step(page: Page, command_step: Step, drive_axis: Axis) -> None:
    """Description, fields and button of a step."""
    from nicegui import ui

    values = dict[str, Any]()
    about, homing_keys = [command_step.about] if command_step.about else [], drive_axis.keys.homing
    if command_step.word == "home" and homing_keys is not None:
        about = [f"Method {homing_keys.method}, then it is at {drive_axis.format_quantity(homing_keys.at)}:"]
        about += [f"{number}. {text}" for number, text in enumerate(homing.explained(drive_axis.keys), 1)]
    for text in about:
        ui.label(text).classes("twin-soft")
    with ui.row().classes("full-width gap-2 twin-entries"):
        for entry in command_step.entries:
            field(page, command_step, entry, values, drive_axis)
        step_button(page, command_step, drive_axis.name, values, drive_axis)


def field(page: Page, command_step: Step, entry: Entry, values: dict[str, Any], drive_axis: Axis) -> None:
    """Check box or text field of an option; the text field holds the command's own default."""
    from nicegui import ui

    def change(event: ValueChangeEventArguments[Any]) -> None:
        values[entry.option] = event.value
        page.update()

    if entry in (steps.TO, steps.HOMED) and drive_axis.keys.homing is None:
        return
    if entry.per is None:
        ui.checkbox(entry.label, on_change=change).props("dense")
        return
    values[entry.option] = steps.default(command_step, entry, drive_axis)
    text = ui.input(
        entry.label,
        value=values[entry.option],
        validation=lambda text: steps.problem(command_step, entry, text or "", drive_axis),
        on_change=change,
    )
    text.props(f'hint="{steps.hint(command_step, entry, drive_axis)}" maxlength={steps.LONGEST}')
    text.props("dense outlined stack-label hide-bottom-space").classes("twin-entry")


def step_button(
    page: Page, command_step: Step, name: str, values: dict[str, Any], drive_axis: Axis | None = None
) -> None:
    """Button that begins a step: disabled while a command runs, and beside the reason why it cannot begin."""
    from nicegui import ui

    typed = page.typed
    button = ui.button(
        command_step.button,
        on_click=lambda: page.run_as_operator(lambda: page.begin(command_step, name, values, drive_axis)),
    )
    button.props("dense no-caps outline")
    reason = ui.label("").classes("twin-soft")

    def update() -> None:
        reason.text = refusal(page, command_step, name, values, drive_axis)
        reason.visible = bool(reason.text)
        is_wrong = drive_axis is not None and any(
            steps.problem(command_step, entry, values[entry.option] or "", drive_axis)
            for entry in command_step.entries
            if entry.per is not None and entry.option in values
        )
        button.set_enabled(not typed.running and not reason.text and not is_wrong)

    page.updates.append(update)


def refusal(page: Page, command_step: Step, name: str, values: dict[str, Any], drive_axis: Axis | None) -> str:
    """Why a step cannot begin, apart from a running command and wrong fields; empty if it can."""
    if drive_axis is not None and (reason := steps.unavailable(command_step, drive_axis, page.typed.keys.simulated)):
        return reason
    if page.typed.needs_arm(command_step.word) and not command_step.always:
        return "Real drives, not armed: end this console and start it with --arm."
    if command_step.word == "compare" and not page.dump(name).is_file():
        return "Dump first."
    if name not in page.commissioned and (before := steps.prerequisite(command_step, name, page.typed.done)):
        return before
    return steps.missing(command_step, values)


def live_state(page: Page) -> None:
    """State, position, velocity, current and error of all nodes between commands, with a button that switches it."""
    from nicegui import ui

    typed = page.typed
    button = ui.button(on_click=lambda: page.run_as_operator(lambda: typed.switch_watch(not typed.watch.is_on)))
    button.props("dense no-caps outline no-wrap")
    values = ui.html("", sanitize=False)

    def look() -> None:
        button.text = "stop reading" if typed.watch.is_on else "read live state"
        values.content = state_text(typed)

    look()
    ui.timer(0.25, look)


def state_text(typed: Typed) -> str:
    """The latest reading as HTML, a line for each node; why there is none."""
    watch = typed.watch
    if watch.problem:
        return f'<p class="twin-bad">Live state: {escape(watch.problem)}</p>'
    if not watch.is_on:
        return (
            '<p class="twin-soft">Live state is off. It only reads, between commands. '
            "Leave it off while another program has the drives.</p>"
        )
    if not watch.rows:
        reason = "It continues after the command." if typed.running else "Waiting for the first reading."
        return f'<p class="twin-soft">{reason}</p>'
    lines = []
    for name, rows in watch.rows.items():
        shown = [
            (LIVE.get(title[:5], title), title, value) for title, value in rows if title[:5] in LIVE or len(rows) == 1
        ]
        text = "".join(
            f'<span title="{escape(title)}">{escape(label)} <b>{escape(RAW.sub("", value))}</b></span>'
            for label, title, value in shown
        )
        lines.append(f"<p><b>{escape(name)}</b>{text}</p>")
    return "".join(lines)


def now(page: Page) -> None:
    """Card of the running command: command line, button, output, history."""
    from nicegui import ui

    typed, last_shown = page.typed, dict[str, Any]()

    @ui.refreshable
    def running_command() -> None:
        show_running(page)

    running_command()
    end = ui.label("").props("role=status")
    text = ui.label("").classes("twin-told twin-bench-said")
    plot = ui.html("", sanitize=False)
    before = ui.html("", sanitize=False)

    def look() -> None:
        if last_shown.get("changed") == typed.changed:
            return
        last_shown["changed"] = typed.changed
        text.text = typed.text if typed.running else parts(typed)[0]
        kind, end.text = jog_state(typed)
        end.classes(replace=f"twin-state twin-{kind}")
        end.visible = bool(end.text)
        stage = (typed.running, typed.line, typed.controls)
        if last_shown.get("stage") == stage:
            return
        last_shown["stage"] = stage
        running_command.refresh()
        plot.content = picture(page)
        before.content = listed(typed)
        page.update()

    look()
    ui.timer(REFRESH_PERIOD, look)


def jog_state(typed: Typed) -> tuple[str, str]:
    """Kind and sentence of what a running jog does: ready, stopped by its dead-man switch, at an end; empty without one."""
    if not typed.running or typed.word != "jog":
        return "neutral", ""
    if not typed.controls:
        return "neutral", "powering on ... Keys have no effect yet."
    if typed.has_expired:
        return "warn", EXPIRED
    if reached := JOG_END.search(typed.text):
        return "warn", f"At the {reached[1]} end of this jog, by {reached[2]}: only the other direction moves."
    return "good", "ready: hold an arrow key or a button"


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
            ui.button("End", on_click=lambda: page.run_as_operator(typed.end)).props("dense no-caps outline")
        elif typed.running:
            ui.spinner(size="20px")
    if not typed.running and typed.done:
        kind, text = result(typed)
        ui.label(text).classes(f"twin-state twin-{kind}")
        ui.button("download record", on_click=lambda: ui.download.content(typed.record(), "commissioning.txt")).props(
            "dense no-caps flat"
        )
    for name in typed.controls:
        speed, unit = typed.speed
        Desk([control(name, name, "Held: it moves.", ("ArrowRight", "ArrowLeft"), unit, speed)])


def result(typed: Typed) -> tuple[str, str]:
    """Kind and sentence of how the latest command ended: its error, if it printed one."""
    what, code = f"{typed.word} {typed.node}".strip(), typed.done[0][2]
    if code == 0:
        return "good", f"✓ {what}: done"
    if code == STOPPED:
        state = re.search(STOPPED_IN_STATE, typed.text)
        drive_state = (
            f"State of the drive: {state[1]}." if state else "It did not report the state of the drive: run status."
        )
        return "neutral", f"{what}: stopped by STOP or Esc. {drive_state}"
    error = parts(typed)[1]
    return "bad", f"✗ {what}: {' '.join(error.split()) if error else f'ended with exit code {code}'}"


def parts(typed: Typed) -> tuple[str, str]:
    """Output of the latest command, and the error that it ended with."""
    output, *errors = ERROR.split(typed.text) if typed.done and typed.done[0][2] else [typed.text]
    return output, errors[-1] if errors else ""


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
        failed = " <b>stopped</b>" if code == STOPPED else f' <b class="twin-bad">exit code {code}</b>' if code else ""
        rows.append(f'<li><span class="twin-soft">{clock}</span> {escape(line)}{failed}</li>')
    return f'<ul class="twin-typed">{"".join(rows)}</ul>'


PANEL = Panel(TITLE, fill, hardware=True, path="/bench", activity=Typed)
