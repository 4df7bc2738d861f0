"""Cards of the commissioning page: the live state, the state of the hardware file, the running command with its output."""

from __future__ import annotations

import base64
import re
import textwrap
import time
from html import escape
from typing import TYPE_CHECKING, Any

from hw_bridge.command.bench.options import WIDTH
from hw_bridge.command.bench.single_axis import LIVE_VALUES, STATE_AFTER_STOP
from hw_bridge.command.bench.step import SHOWN
from hw_bridge.command.commissioning_steps import READING
from hw_bridge.command.progress import STOPPED, Outcome, has_lost_page, labeled, lines_after_stop, outcome
from hw_bridge.command.state_watch import RETRY_PERIOD
from hw_bridge.command.typed import MOVES
from hw_bridge.commission import ATTENDED, HOLD
from hw_bridge.dictionary import State
from twin import web

if TYPE_CHECKING:
    from collections.abc import Callable

    from nicegui.element import Element
    from nicegui.elements.label import Label

    from hw_bridge.command.live_motion import LiveMotion
    from hw_bridge.command.pages import Page
    from hw_bridge.command.typed import Typed

(CHECK,) = (step for step in READING if step.word == "check")
ENDED = ("jog", "enable")  # by the person, in an orderly way
REFRESH_PERIOD = 0.2  # of the running command [s]
LATE_PERIOD = 1.5  # and of its chart while the page answers late: it draws less, to answer in time [s]
CURVES_PATH = "/commissioning/curves"
SPAN = 10.0  # of the chart while a drive moves [s]
CURVES_PERIOD = 0.5  # of its requests [s]: one that follows sends ten times as many, and the page must answer
TILES = ("state", "position", "velocity", "current")
LIVE = {"6041h": "state", "6064h": "position", "606Ch": "velocity", "6078h": "current", "603Fh": "error"}
RAW = re.compile(r" \([^()]*\)$")  # value in the drive's own unit, behind a quantity
ERROR = re.compile(r"(?:^|(?<=  ))error: ", re.MULTILINE)  # before the error that a command prints at its end
JOG_END = re.compile(r"(upper|lower) end \((.*)\)\s*$")  # at the end of the live values of a jog
BEFORE_POWER = (
    "An emergency stop that cuts the motor's supply is within reach.",
    "The carriage is in the middle of its stroke, nothing is in its way, nothing coupled to it that can break.",
    "Motor and loops are set up with the vendor's software; the inputs of STO (safe torque off) are closed, if it has any.",
    "STOP and Esc are Ctrl-C for the running command: quick stop, then power off. They do not replace the emergency stop.",
)
UNREPORTED = "It did not report the state of the drive: run status."
NEVER_STARTED = ("stopped before power", "interrupted before it began")  # in the output of a command that was stopped
CLOSE_PAGES = "Close other pages and programs, or copy the command above into a terminal, which needs no page."
TABLE_ROW = re.compile(r"  (?!\d+\.  |position ).*\S  +\S|  -{9}")
EXPIRED = (
    f"Stopped by the dead-man switch: this page answered later than {HOLD // 10**6} ms. "
    "Release the button, then hold it again."
)


def live_state(page: Page) -> None:
    """State, position, velocity, current and error of all nodes between commands, with a button that switches it."""
    from nicegui import ui

    typed = page.typed
    button = ui.button(on_click=lambda: page.run_as_operator(lambda: typed.switch_watch(not typed.watch.is_on)))
    button.props("dense no-caps outline no-wrap")
    values = ui.html("", sanitize=False)

    def look() -> None:
        button.text = "pause live state" if typed.watch.is_on else "read live state"
        if not typed.attended:  # else the card of the command draws it, with the same values
            page.live_line = state_text(typed)
        values.content = page.live_line

    look()
    ui.timer(0.25, look)


def state_text(typed: Typed) -> str:
    """The latest values as HTML, a line for each node: those of the running command, or of its end until the next reading."""
    watch, motion = typed.watch, typed.motion
    own = motion_line(typed) if motion.state else ""
    if typed.running:
        return own or f'<p class="twin-soft">twin hil {escape(typed.word)} runs: see its output.</p>'
    if watch.problem:
        text = f"Live state is off: {watch.problem} The page listens again every {RETRY_PERIOD:.0f} s."
        return f'<p class="twin-warn twin-state">{escape(text)}</p>'
    if not watch.is_on:
        reason = "It continues after the session." if watch.is_wanted else "It only reads, between commands."
        return f'<p class="twin-soft">Live state is off. {reason}</p>'
    if watch.rows:
        return state_lines(watch.rows)
    return own or '<p class="twin-soft">Listens for other programs, then reads ...</p>'


def motion_line(typed: Typed) -> str:
    """Values that the latest command printed of its drive, as those of a reading."""
    motion = typed.motion
    position = f"{motion.position} {motion.origin}"
    state = f"{motion.state}, last known" if motion.no_data_since else motion.state
    values = (("6041h", state), ("6064h", position), ("606Ch", motion.velocity), ("6078h", motion.current or "-"))
    title = "values of the running command" if typed.running else "values at the end of the command"
    return state_lines({typed.node: [(f"{index} {title}", value) for index, value in values]})


def state_lines(nodes: dict[str, list[tuple[str, str]]]) -> str:
    """State, position, velocity, current and error of each node as a line of HTML."""
    lines = []
    for name, rows in nodes.items():
        shown = [
            (LIVE.get(title[:5], title), title, value) for title, value in rows if title[:5] in LIVE or len(rows) == 1
        ]
        text = "".join(
            f'<span title="{escape(title)}">{escape(label)} <b>{escape(RAW.sub("", value))}</b></span>'
            for label, title, value in shown
        )
        lines.append(f"<p><b>{escape(name)}</b>{text}</p>")
    return "".join(lines)


def changed_file(page: Page) -> None:
    """Sentence that the hardware file was read again, until it is checked."""
    from nicegui import ui

    typed = page.typed
    kind, text = file_state(typed)
    notice = ui.label(text).classes(f"twin-state twin-{kind}").props("role=alert")

    def update() -> None:
        notice.visible = bool(typed.file_problem) or not page.is_done(CHECK, "")

    page.updates.append(update)


def file_state(typed: Typed) -> tuple[str, str]:
    """Kind and sentence of a hardware file that was read again."""
    clock = time.strftime("%H:%M:%S", time.localtime(typed.read_again))
    if typed.file_problem:
        return "bad", f"Changed at {clock}, and cannot be used: {typed.file_problem} What is shown below is of before."
    return (
        "warn",
        f"{typed.file.name} has changed and was read again at {clock}: do check and the steps after it again.",
    )


def armed(typed: Typed) -> tuple[str, str]:
    """Whether anything may move, and its label."""
    if typed.keys.is_software():
        return "good", "simulated drives"
    return ("warn", "armed: drives may move") if typed.console.arm else ("good", "not armed: nothing moves from here")


def now(page: Page, card: Element) -> None:
    """Content of the card of the running command: command line, button, output, history."""
    from nicegui import ui

    typed, last_shown = page.typed, dict[str, Any]()

    @ui.refreshable
    def running_command() -> None:
        show_running(page, lambda: card.classes(toggle="twin-folded"))

    running_command()
    end = ui.label("").props("role=status")
    tiles, update_tiles = motion_tiles(typed.motion)
    with ui.element("div").classes("full-width") as frame:  # the chart's own classes must stay as its script set them
        chart = web.Chart(CURVES_PATH, motion_panes("mm")).style("height: 300px")
    text = ui.html("", sanitize=False).classes("twin-told twin-bench-said")
    plot = ui.html("", sanitize=False)
    before = ui.html("", sanitize=False)

    def look() -> None:
        if last_shown.get("changed") == typed.changed and (typed.text or not typed.running):
            return
        kind, end.text = motion_state(typed)
        end.classes(replace=f"twin-state twin-{kind}")
        end.visible = bool(end.text)
        stage = (typed.running, typed.line, typed.controls)
        is_late = typed.attended and typed.lateness and last_shown.get("stage") == stage
        if is_late and time.monotonic() - last_shown["drawn"] < LATE_PERIOD:
            return
        last_shown["drawn"] = time.monotonic()
        last_shown["changed"] = typed.changed
        update_tiles()
        page.live_line = state_text(typed)
        text.content = output_lines(wrapped(typed.text if typed.running else parts(typed)[0]))
        if typed.attended and time.monotonic() - last_shown.get("curves", 0.0) > CURVES_PERIOD:
            last_shown["curves"] = time.monotonic()
            latest = max(typed.motion.span()[1], SPAN)
            chart.show(latest - SPAN, latest)
        if last_shown.get("stage") == stage:
            return
        last_shown["stage"] = stage
        card.classes(remove="twin-folded")  # how a command ended is never hidden
        running_command.refresh()
        tiles.visible = typed.attended
        frame.visible = typed.attended or (not typed.running and typed.motion.has_samples)
        if typed.attended and typed.node in typed.axes:
            chart.panes = motion_panes(SHOWN[typed.axes[typed.node].unit][0])
            chart.show_panes()
        elif frame.visible:
            chart.show(None, None)
        plot.content = picture(page)
        before.content = listed(typed)
        page.update()

    look()
    ui.timer(REFRESH_PERIOD, look)


def motion_state(typed: Typed) -> tuple[str, str]:
    """Kind and sentence of what a running motion does: its page is late, a jog is ready, stopped, at an end; empty without one."""
    if since := typed.motion.no_data_since:
        return "warn", f"No data since {since}: curves end there, values are the last known."
    if typed.attended and typed.word != "jog" and (late := typed.lateness):
        return (
            "warn",
            f"This page answers late: {late:.1f} s. After {ATTENDED:g} s the motion is stopped. Close other pages.",
        )
    if not typed.running or typed.word != "jog":
        is_silent = typed.running and not typed.text  # before its first line
        return "neutral", f"starts, {time.monotonic() - typed.began:.0f} s" * is_silent
    if not typed.controls:
        if typed.motion.has_samples and typed.motion.state != State.ENABLED:
            return "warn", f"{typed.motion.state}: keys have no effect. The command restores the drive and ends."
        return "neutral", "powering on ... Keys have no effect yet."
    if typed.has_expired:
        return "warn", EXPIRED
    if reached := JOG_END.search(typed.text):
        return "warn", f"At the {reached[1]} end of this jog, by {reached[2]}: only the other direction moves."
    if typed.motion.direction:
        return "warn", f"moves to {typed.motion.direction} positions while the button is held"
    return "good", "ready: hold an arrow key or a button"


def show_running(page: Page, fold: Callable[[], object]) -> None:
    """The running command, with the button of a jog and an orderly end."""
    from nicegui import ui

    from twin.console import Desk, control

    typed = page.typed
    if not typed.line:
        ui.label("Before the power is on").classes("twin-h")
        for text in BEFORE_POWER:
            ui.label(f"- {text}")
        ui.label("Each button runs the command that you would type; it is shown here.").classes("twin-soft")
        return
    with ui.row().classes("items-center full-width no-wrap gap-1"):
        ui.label(typed.line).classes("twin-told col")
        with ui.element("div").classes("twin-fold"):
            icon_button("unfold_less", "fold or unfold", fold)
        icon_button("content_copy", "copy the command", lambda: ui.clipboard.write(typed.line))
        if typed.running and typed.word in ENDED:
            ui.button("End", on_click=lambda: page.run_as_operator(typed.end)).props("dense no-caps outline")
        elif typed.attended:  # a spinner is drawn sixty times a second, and the page must answer
            ui.label("runs").classes("twin-state twin-warn")
        elif typed.running:
            ui.spinner(size="20px")
        elif typed.done:
            icon_button("download", "download record", lambda: ui.download.content(typed.record(), "commissioning.txt"))
    if not typed.running and typed.done:
        kind, text = result(typed)
        with ui.column().classes(f"twin-result full-width gap-0 twin-{kind}"):
            for line in text.split("\n"):
                ui.label(line)
    for name in typed.controls:
        speed, unit = typed.speed
        Desk([control(name, name, "Held: it moves.", ("ArrowRight", "ArrowLeft"), unit, speed)])


def icon_button(icon: str, title: str, action: Callable[[], object]) -> None:
    """Button with an icon, and its title for pointers and readers."""
    from nicegui import ui

    ui.button(icon=icon, on_click=action).props(f'flat dense size=sm aria-label="{title}" title="{title}"')


def motion_tiles(motion: LiveMotion) -> tuple[Element, Callable[[], None]]:
    """State, position, velocity and current of the drive that moves, and the function that updates them."""
    from nicegui import ui

    labels: dict[str, Label] = {}
    with ui.row().classes("full-width gap-4 twin-tiles") as tiles:
        for title in TILES:
            with ui.column().classes("gap-0"):
                with ui.row().classes("gap-1"):
                    ui.label(title).classes("twin-soft")
                    if title == "position":
                        labels["origin"] = ui.label().classes("twin-soft")
                labels[title] = ui.label().classes("twin-h twin-figures")

    def update() -> None:
        for title, label in labels.items():
            label.text = getattr(motion, title) or "-" * (title in TILES)
        tiles.classes(**{"add" if motion.no_data_since else "remove": "twin-stale"})

    update()
    return tiles, update


def motion_panes(unit: str) -> list[web.Pane]:
    """Panes of the chart: position in this unit, and current."""
    return [
        web.Pane("position", unit, [web.ChartCurve("position", "position")]),
        web.Pane("current", "A", [web.ChartCurve("current", "current", color=1)]),
    ]


def result(typed: Typed) -> tuple[str, str]:
    """Kind and sentence of how the latest command ended: its error, if it printed one."""
    what, code = f"{typed.word} {typed.node}".strip(), typed.done[0][2]
    if code == 0 and outcome(typed.word, code, typed.text, typed.motion.directions) is Outcome.NEUTRAL:
        return "neutral", f"{what}: ended, not complete: move it in both directions, then press End."
    if code == 0:
        count = len(labeled(typed.text, "note"))
        return ("warn", f"✓ {what}: done, {count} note{'s' * (count > 1)}") if count else ("good", f"✓ {what}: done")
    lines = lines_after_stop(typed.text)
    if code == STOPPED:
        kind = "bad" if lines and lines[0].startswith("Last state") else "warn"
        if not lines and typed.word in MOVES:
            was_off = any(map(typed.text.count, NEVER_STARTED))
            kind, lines = ("warn", ["Nothing was enabled."]) if was_off else ("bad", [UNREPORTED])
        return kind, "\n".join([f"{what}: stopped by STOP or Esc.", *lines])
    if has_lost_page(typed.text):
        silent = f"this page did not answer for {ATTENDED:g} s (closed, reloaded or stalled)"
        return "warn", "\n".join([f"{what}: stopped: {silent}.", *lines, CLOSE_PAGES])
    if code < 0:
        return "bad", (
            f"✗ {what}: was killed (signal {-code}) and restored nothing. A drive that it moved misses its heartbeat and stops "
            "by itself: look at its state, then reset and restore."
        )
    error = STATE_AFTER_STOP.split(parts(typed)[1])[0]
    error = error or " ".join(labeled(typed.text, "differs") + labeled(typed.text, "not restored"))
    cause = f"✗ {what}: {' '.join(error.split()) if error else f'ended with exit code {code}'}"
    return "bad", "\n".join([cause, *lines])


def parts(typed: Typed) -> tuple[str, str]:
    """Output of the latest command, and the error that it ended with."""
    output, *errors = ERROR.split(typed.text) if typed.done and typed.done[0][2] else [typed.text]
    return output, errors[-1] if errors else ""


def output_lines(text: str) -> str:
    """Output as HTML: sentences have the width of the page again, rows of a table stay as they are."""
    lines = list[tuple[str, bool]]()
    length = 0  # of the latest printed line
    for line in text.split("\n"):
        is_row, words = bool(TABLE_ROW.match(line)), line.split()
        is_open = lines and not lines[-1][1] and not lines[-1][0].endswith((".", ":"))
        if words and is_open and not is_row and length + 1 + len(words[0]) > WIDTH:
            lines[-1] = f"{lines[-1][0]} {line.strip()}", False  # the terminal's width has parted them
        else:
            lines.append((line, is_row))
        length = len(line)
    return "".join(f"<div{' class=twin-row' * is_row}>{escape(line)}\n</div>" for line, is_row in lines)


def wrapped(text: str) -> str:
    """Output with its lines of live values at the width of a terminal, as all others have."""
    lines = text.split("\n")
    return "\n".join(textwrap.fill(line, WIDTH) if LIVE_VALUES.match(line) else line for line in lines)


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
    for (begin_time, line, code), output in zip(list(typed.done), list(typed.outputs), strict=False):
        clock = time.strftime("%H:%M:%S", time.localtime(begin_time))
        failed = (
            " <b>stopped</b>"
            if code == STOPPED or has_lost_page(output)
            else f' <b class="twin-bad">exit code {code}</b>'
            if code
            else ""
        )
        rows.append(f'<li><span class="twin-soft">{clock}</span> {escape(line)}{failed}</li>')
    return f'<ul class="twin-typed">{"".join(rows)}</ul>'
