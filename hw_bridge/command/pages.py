"""Commissioning in the browser: the steps of `twin hil`, from a scan to a step response, on one page.

Each step is a command (`commissioning_steps`, `typed`), with fields for its options; its output is shown (`running_card`). The page
holds a button and reports its presence; every decision about motion is made in the process of the command.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hw_bridge.command import commissioning_steps as steps
from hw_bridge.command.bench.motion import ramp
from hw_bridge.command.bench.step import SHOWN
from hw_bridge.command.commissioning_steps import ANY_TIME, READING, STEPS, Entry, Step
from hw_bridge.command.progress import Outcome
from hw_bridge.command.running_card import CHECK, CURVES_PATH, armed, changed_file, live_state, now
from hw_bridge.command.step_order import order_switch
from hw_bridge.command.typed import MOVES, Typed
from hw_bridge.commission import homing
from hw_bridge.hardware import NodeKeys
from twin import web
from twin.console import Panel
from twin.errors import TwinError

if TYPE_CHECKING:
    from nicegui.element import Element
    from nicegui.events import ValueChangeEventArguments

    from hw_bridge.commission import Axis
    from twin.console import Host

TITLE = "Commissioning"
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")  # of a node
LOOKS = {  # of a step's number, by what has become of it
    "open": "done-color=soft",
    "done": "icon=check done-icon=check color=positive done-color=positive",
    "failed": "icon=close error error-icon=close error-color=negative",
    "stopped": "icon=stop error error-icon=stop error-color=warning",
    "skipped": "icon=priority_high error error-icon=priority_high error-color=warning",
}
GATES = frozenset(step.after for step in STEPS if step.after) - {steps.ALWAYS}  # commands that may be skipped
FILE_PERIOD = 1.0  # between looks at the hardware file [s]
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
        self.live_line = ""  # of the drives, as it is shown
        self.read: object = None  # positions as last read, and whether the page is too slow
        self.updates: list[Callable[[], object]] = []  # when a command begins or ends, or a field changes

    def update(self) -> None:
        """Update all buttons and steps."""
        for update in self.updates:
            update()

    def update_positions(self) -> None:
        """Update all where a drive was read at another position, which bounds the next motion, or this page answers late."""
        positions = {name: self.typed.position(name) for name in self.typed.axes}
        if (positions, self.typed.late_text) != self.read:
            self.read = positions, self.typed.late_text
            self.update()

    async def run_as_operator(self, what: Callable[[], None]) -> None:
        """Run an action outside of the server's loop if this page is the operator's; show its error."""
        from nicegui import run, ui

        if not self.is_operator():
            ui.notify(self.console.operator_lock.watching, type="warning", position="top")
            return
        try:
            await run.io_bound(what)
        except TwinError as error:
            if not ui.context.client.is_deleted:  # the page was closed meanwhile
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
            files = {
                "step": f"--plot={self.plot(name)}",
                "dump": str(self.new_dump(name)),
                "compare": str(values.get("file") or next(iter(self.dumps(name)), "")),
            }
            arguments.append(files[step.word])
        self.typed.begin(step.word, "" if step.is_bus_wide else name, arguments, speed)

    def plot(self, name: str) -> Path:
        """Path of a step response's figure."""
        return self.folder / f"{name}_step.svg"

    def new_dump(self, name: str) -> Path:
        """Path for a parameter dump of a drive now: none is overwritten."""
        return self.folder / f"{name}_{time.strftime('%Y%m%d_%H%M%S')}.dcf"

    def dumps(self, name: str) -> list[Path]:
        """Dumps of a drive from this page, the latest first, then all DCF files in the folder of the hardware file."""
        own = self.folder.glob(f"{name}_{'[0-9]' * 8}_{'[0-9]' * 6}.dcf")
        return [*sorted(own, reverse=True), *sorted(self.typed.file.parent.glob("*.dcf"))]

    def is_done(self, step: Step, name: str) -> bool:
        """Whether a step of a drive has succeeded with this hardware file."""
        return self.typed.progress.time_of(step, name) is not None


def fill(console: Host, is_operator: Callable[[], bool]) -> None:
    """Build the page, again each time the hardware file has changed."""
    from nicegui import run, ui

    typed = console.activities[TITLE]
    assert isinstance(typed, Typed)
    shown = [typed.read_again]

    @ui.refreshable
    def desk() -> None:
        build(Page(console, is_operator, typed))

    async def look() -> None:
        await run.io_bound(typed.reload)
        if shown[0] != typed.read_again and not typed.running:
            shown[0] = typed.read_again
            desk.refresh()

    desk()
    ui.timer(FILE_PERIOD, look)


def build(page: Page) -> None:
    """Build live state, the running command, and each drive with its steps."""
    from nicegui import ui

    typed, keys = page.typed, page.typed.keys
    with ui.element("div").classes("twin-desk"):
        if not keys.simulated:
            with ui.element("div").classes("twin-card twin-live"):
                live_state(page)
        with ui.element("div").classes("twin-card twin-hand") as card:
            now(page, card)

        def update() -> None:
            for name, is_set in (("twin-moves", typed.attended), ("twin-checklist", not typed.line)):
                card.classes(**{"add" if is_set else "remove": name})

        page.updates.append(update)
        with ui.element("div").classes("twin-card twin-curves"):
            bus = f"{keys.interface} {keys.channel}".strip() or "simulated: each command has a bus of its own"
            ui.label(keys.title or typed.file.name).classes("twin-h")
            ui.label(f"{typed.file}: {bus}").classes("twin-soft")
            if typed.read_again:
                changed_file(page)
            kind, text = armed(typed)
            ui.html(f'<p class="twin-state twin-{kind}">{text}</p>', sanitize=False)
            if keys.simulated:
                ui.label(SIMULATED).classes("twin-soft")
        for _, name, station in keys.stations():
            if NAME.fullmatch(name):
                with ui.element("div").classes("twin-card twin-curves"):
                    ui.label(name).classes("twin-h")
                    if isinstance(station, NodeKeys):
                        drive(page, typed.axes[name])
                    else:
                        with ui.row().classes("items-center full-width gap-1"):
                            for command_step in READING:
                                step_button(page, command_step, name, {})
    page.update()
    ui.timer(FILE_PERIOD, page.update_positions)


def drive(page: Page, drive_axis: Axis) -> None:
    """Limits and steps of a drive."""
    from nicegui import ui

    typed, name = page.typed, drive_axis.name
    ui.label(steps.limits_text(drive_axis)).classes("twin-soft")
    notice = ui.label("").classes("twin-state twin-warn").props("role=alert")

    order_switch(page, name)

    def is_done(command_step: Step) -> bool:
        return page.is_done(command_step, name)

    first = steps.next_step(drive_axis, typed.keys.simulated, is_done) or max(
        STEPS, key=lambda each: typed.progress.time_of(each, name) or 0.0
    )
    items: list[tuple[Step, Element]] = []
    with (
        ui.stepper(value=first.title)
        .props("vertical header-nav flat active-icon=none done-icon=none")
        .classes("full-width") as stepper
    ):
        for number, command_step in enumerate(STEPS, 1):
            # the library calls each step before the chosen one done: here it is, once its command has succeeded
            with ui.step(command_step.title).props(f"prefix={number}") as item:
                step(page, command_step, drive_axis)
            items.append((command_step, item))
    ui.label("At any time").classes("twin-soft")
    for command_step in ANY_TIME:
        with ui.expansion(command_step.title).classes("full-width") as expansion:
            step(page, command_step, drive_axis)
        items.append((command_step, expansion))
    done_before = {each.title for each in STEPS if is_done(each)}

    def mark() -> None:
        notice.text = typed.exchanged.get(name, "")
        notice.visible = bool(notice.text) and not is_done(CHECK)
        for number, (command_step, item) in enumerate(items, 1):
            look, item.props["caption"] = step_state(page, command_step, drive_axis)
            if command_step not in STEPS:
                continue
            for other in LOOKS.values():
                item.props(remove=other)
            item.props(LOOKS[look])
            item.classes(add="twin-running" if item.props["caption"] == "running" else "", remove="twin-running")
            item.props(f"prefix={number}" if look == "open" else "", remove="" if look == "open" else "prefix")
            if look == "done" and command_step.title not in done_before and stepper.value == command_step.title:
                stepper.value = (
                    steps.next_step(drive_axis, typed.keys.simulated, is_done, number) or command_step
                ).title
        done_before.clear()
        done_before.update(each.title for each in STEPS if is_done(each))

    page.updates.append(mark)


def step_state(page: Page, command_step: Step, drive_axis: Axis) -> tuple[str, str | None]:
    """Look and caption of a step's number: what has become of it with this hardware file."""
    typed, name = page.typed, drive_axis.name
    done_at = typed.progress.time_of(command_step, name)
    latest = typed.progress.latest_outcome(command_step, name)
    look = "failed" if latest is Outcome.FAILED else "done" if done_at else "stopped" if latest else "open"
    if typed.running and steps.is_step(command_step, name, typed.line):
        return look, "running"
    if reason := steps.unavailable(command_step, drive_axis, typed.keys.simulated):
        return look, reason.partition(". ")[0]
    if look in ("failed", "stopped"):
        return look, "failed" if look == "failed" else "not complete"
    if look == "open" and (other := steps.alternative(command_step, lambda each: page.is_done(each, name))):
        return look, f"skipped: {other.title} is done"
    if look == "open" and name in page.commissioned and command_step.word in GATES:
        return "skipped", "skipped: not checked"
    return look, (
        command_step.caption if done_at is None else time.strftime("done %Y-%m-%d %H:%M", time.localtime(done_at))
    )


def step(page: Page, command_step: Step, drive_axis: Axis) -> None:
    """Description, fields and button of a step."""
    from nicegui import ui

    values = dict[str, Any]()
    about, homing_keys = [command_step.about] if command_step.about else [], drive_axis.keys.homing
    if command_step.word == "home" and homing_keys is not None:
        sequence, bounds = homing.explained(drive_axis, page.typed.keys)
        reference = drive_axis.format_quantity(homing_keys.at)
        about = [f"Method {homing_keys.method}, the reference position is {reference}:"]
        about += [*(f"{number}. {text}" for number, text in enumerate(sequence, 1)), bounds]
    for text in about:
        ui.label(text).classes("twin-soft")
    with ui.row().classes("full-width gap-2 twin-entries"):
        if command_step.word == "compare":
            dump_choice(page, drive_axis.name, values)
        for entry in command_step.entries:
            field(page, command_step, entry, values, drive_axis)
        step_button(page, command_step, drive_axis.name, values, drive_axis)


def field(page: Page, command_step: Step, entry: Entry, values: dict[str, Any], drive_axis: Axis) -> None:
    """Check box or text field of an option; the text field holds the command's own default."""
    from nicegui import ui

    def change(event: ValueChangeEventArguments[Any]) -> None:
        values[entry.option] = event.value
        page.update()

    if entry in (steps.TO, steps.FROM_START) and drive_axis.keys.homing is None:
        return
    if entry.per is None:
        ui.checkbox(entry.label, on_change=change).props("dense")
        return
    values[entry.option] = steps.default(command_step, entry, drive_axis)
    text = ui.input(
        entry.label,
        value=values[entry.option],
        validation=lambda text: problem(page, command_step, entry, text or "", values, drive_axis),
        on_change=change,
    )
    text.props(f"maxlength={steps.LONGEST} dense outlined stack-label hide-bottom-space").classes("twin-entry")

    def update() -> None:  # another field or a command may change what it may hold
        reason = steps.closed(entry, values, page.typed.position(drive_axis.name))
        text.props(f'hint="{reason or steps.hint(command_step, entry, drive_axis)}"').set_enabled(not reason)
        text.validate(return_result=False)

    page.updates.append(update)


def problem(
    page: Page, command_step: Step, entry: Entry, text: str, values: dict[str, Any], drive_axis: Axis
) -> str | None:
    """What is wrong with the text of a field, for the position where the drive is as far as read."""
    position = page.typed.position(drive_axis.name)
    if position is not None and values.get(steps.FROM_START.option):
        position = steps.NOT_HOMED
    return steps.problem(command_step, entry, text, drive_axis, position)


def dump_choice(page: Page, name: str, values: dict[str, Any]) -> None:
    """Selection of the dump to compare with, the latest at first and after each dump."""
    from nicegui import ui

    choice = ui.select({}, label="dump", on_change=lambda event: values.update(file=event.value))
    choice.props("dense outlined stack-label").classes("full-width")

    def update() -> None:
        paths = [str(path) for path in page.dumps(name)]
        if paths != list(choice.options):
            choice.set_options({path: Path(path).name for path in paths}, value=next(iter(paths), None))
        choice.visible = bool(paths)

    page.updates.append(update)


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
    caution = ui.label("").classes("twin-state twin-warn")

    def update() -> None:
        is_skipping = name in page.commissioned
        caution.text = steps.caution(command_step, lambda each: page.is_done(each, name)) if is_skipping else ""
        caution.visible = bool(caution.text)
        reason.text = refusal(page, command_step, name, values, drive_axis)
        reason.visible = bool(reason.text)
        is_wrong = drive_axis is not None and any(
            problem(page, command_step, entry, values[entry.option] or "", values, drive_axis)
            for entry in command_step.entries
            if entry.per is not None and entry.option in values
        )
        button.set_enabled(not typed.running and not reason.text and not is_wrong)

    page.updates.append(update)


def refusal(page: Page, command_step: Step, name: str, values: dict[str, Any], drive_axis: Axis | None) -> str:
    """Why a step cannot begin, apart from a running command and wrong fields; empty if it can."""
    if drive_axis is not None and (reason := steps.unavailable(command_step, drive_axis, page.typed.keys.simulated)):
        return reason
    if page.typed.file_problem:
        return "Correct the hardware file first."
    if command_step.word in MOVES and page.typed.late_text:
        return page.typed.late_text
    if page.typed.needs_arm(command_step.word) and not command_step.always:
        return "Real drives, not armed: end this console and start it with --arm."
    if command_step.word == "compare" and not page.dumps(name):
        return "Dump first."
    if before := steps.prerequisite(command_step, lambda each: page.is_done(each, name), name in page.commissioned):
        return before
    return steps.missing(command_step, values)


def begin_activity(console: Host) -> Typed:
    """Create the runner of the commands, and serve the curves of their motion."""
    from nicegui import app

    typed = Typed(console)
    web.frames.route(app, CURVES_PATH, lambda _: typed.motion)
    return typed


PANEL = Panel(TITLE, fill, hardware=True, path="/bench", activity=begin_activity)
