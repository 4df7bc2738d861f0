"""Panel of the operator: inputs and tunable parameters in display units, events, overrides, executed commands."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from html import escape
from typing import TYPE_CHECKING, Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from twin.console.curves import elements, shown_value, start_value, value_text
from twin.errors import TwinError
from twin.live import EXPIRED, OVER, RefusedError
from twin.scenario import number

if TYPE_CHECKING:
    from twin.console.page import PageContext
    from twin.live import CatalogControl, CatalogEvent, CatalogSignal, ExecutedCommand, LiveSession

MAX_COMMANDS = 200  # listed commands, the latest
MAX_MATCHES = 12  # listed search results
HELD, RELEASED = ": held", ": released"  # after the label of a control, in the text of its command
REFUSAL_SHOWN = 6.0  # time after which the message below a field that was left disappears [s]
SEND_TEXT = "(event) => emit(event.target.value)"  # of a text field


def panel(context: PageContext, more: Callable[[], None]) -> None:
    """Create the panel with its sections; `more` adds those that follow the parameters."""
    live, catalog = context.console.live, context.console.catalog
    assert live is not None
    assert catalog is not None
    settable = {name: signal for signal in catalog.signals.values() if signal.settable for name in elements(signal)}
    changing = [section("Inputs and parameters", lambda: values(context, live, settable), opened=not catalog.controls)]
    more()
    if catalog.events:
        changing.append(section("Events of the scenario", lambda: events(context, live, catalog.events)))
    changing.append(section("Override outputs", lambda: overrides(context, live)))
    section("Executed commands", lambda: done(context, live), opened=True)

    def lock() -> None:
        if live.state.phase in (*OVER, "finishing"):  # nothing can be changed after the end
            for expansion in changing:
                expansion.props("inert").classes("disabled")

    lock()
    ui.timer(0.3, lock)


def section(title: str, fill: Callable[[], None], opened: bool = False, lazy: bool = True) -> ui.expansion:
    """Create a section of a panel, which `fill` fills when it is first opened, or at once unless `lazy`."""
    expansion = ui.expansion(title, value=opened).classes("full-width")
    filled = [False]

    def update() -> None:
        if (expansion.value or not lazy) and not filled[0]:
            filled[0] = True
            with expansion:
                fill()

    expansion.on_value_change(update)
    update()
    return expansion


def events(context: PageContext, live: LiveSession, listed: Sequence[CatalogEvent]) -> None:
    """Create a button for each event of the scenario."""
    for event in listed:
        ui.button(
            f"{event.text} ({event.description})" if event.description else event.text,
            on_click=context.on_press(lambda: live.trigger, event.key),
        ).props("flat dense no-caps align=left").classes("full-width twin-event").tooltip(event.text)


def values(context: PageContext, live: LiveSession, settable: dict[str, CatalogSignal]) -> None:
    """Create the list of settable values: those that the scenario lists first, or search results."""
    if not settable:
        ui.label("No value can be set while the session runs.").classes("twin-soft")
        return
    assert context.console.catalog is not None
    listed = context.console.catalog.parameters
    search = (
        ui.input(placeholder=f"search {len(settable)} inputs and parameters")
        .props("dense outlined clearable debounce=150 aria-label='search inputs and parameters'")
        .classes("full-width")
    )

    marks: dict[str, ui.label] = {}  # nominal values beside the names, shown while they are changed
    was_changed = [False]

    @ui.refreshable
    def rows() -> None:
        marks.clear()
        words = (search.value or "").casefold().split()
        changed = live.state.values
        names = settable if words else [name for name in dict.fromkeys((*listed, *changed)) if name in settable]
        matches = [
            name for name in names if all(word in f"{name} {settable[name].description}".casefold() for word in words)
        ]
        for name in matches[:MAX_MATCHES]:
            marks[name] = row(context, live, name, settable[name], listed.get(name))
        if not matches:
            ui.label("No value matches." if words else "Search for a value by a part of its name.").classes("twin-soft")
        if len(matches) > MAX_MATCHES:
            ui.label(f"and {len(matches) - MAX_MATCHES} more: refine the search").classes("twin-soft")

    def update() -> None:
        changed = live.changed_values
        if was_changed[0] and not changed:
            rows.refresh()  # the fields show nominal values again
        was_changed[0] = bool(changed)
        for name, mark in marks.items():
            mark.visible = name in changed

    search.on_value_change(rows.refresh)
    search.on("keydown.escape", lambda: search.set_value(""))
    rows()
    update()
    ui.timer(0.3, update)


def row(
    context: PageContext, live: LiveSession, name: str, signal: CatalogSignal, ends: tuple[float, float] | None = None
) -> ui.label:
    """Create one value: a switch, or a field with its unit, and a slider between `ends` or the declared bounds [SI].

    Return the label with its nominal value, which is hidden.
    """
    now = live.state.values.get(name, start_value(name, signal))
    with ui.element("div").classes("twin-value full-width"):
        if signal.description:
            ui.tooltip(signal.description).props(
                "anchor='center left' self='center right' max-width=260px"
            )  # covers no row
        # a long name breaks behind a dot or an underscore
        with ui.element("div").classes("twin-name"):
            ui.html(re.sub(r"([._])", r"\1<wbr>", escape(name)), sanitize=False)
            mark = ui.label(f"nominal {value_text(signal, start_value(name, signal))}").classes("twin-warn")
        mark.visible = False
        if signal.type == "Boolean":
            ui.switch(value=bool(now), on_change=lambda said: context.run(live.set, name, said.value is True)).props(
                f'dense aria-label="{name}"'
            )
            return mark
        if signal.items:
            items = {value: text for text, value in signal.items.items()}
            ui.select(
                items,
                value=now if now in items else None,
                on_change=lambda said: context.run(live.set, name, said.value),
            ).props(f'dense options-dense aria-label="{name}"')
            return mark
        number_field(context, live, name, signal, shown_value(signal, now), ends)
    return mark


def number_field(
    context: PageContext,
    live: LiveSession,
    name: str,
    signal: CatalogSignal,
    shown: float,
    ends: tuple[float, float] | None,
) -> None:
    """Create a text field for a number, which refuses values outside of its slider or the declared bounds, and its slider.

    The text is parsed when Enter is pressed or the field is left. Nothing is written into a field that has the focus: an
    update that the server sends between two keys would replace what is typed, and another number would be executed.
    """
    edges = (signal.minimum, signal.maximum) if ends is None else ends
    low, high = (None if edge is None else shown_value(signal, edge) for edge in edges)
    applied = [shown]
    entry: list[str | None] = [None]  # text that is being executed
    field = ui.input(value=f"{shown:.9g}").without_auto_validation()
    field.props(
        f'dense outlined inputmode=decimal autocomplete=off suffix="{signal.display_unit}" '
        f'no-error-icon hide-bottom-space aria-label="{name}"'
    )

    def restore() -> None:
        write_text(field, f"{applied[0]:.9g}")

    async def apply_entry(text: str) -> bool:
        """Execute a text; return False if it is refused."""
        try:
            value = parse_entry(text, signal.display_unit, low, high)
        except TwinError as error:
            field.error = f"{error} Still {applied[0]:g} {signal.display_unit}".rstrip() + "."
            return False
        field.error, entry[0] = None, text
        is_done = await context.run(live.set, name, _executed(signal, value))
        entry[0] = None
        if is_done:
            applied[0] = value
            field.props("bg-color=positive")
            ui.timer(0.6, lambda: field.props(remove="bg-color"), once=True)
        if slider is not None:
            slider.set_value(min(max(applied[0], slider.props["min"]), slider.props["max"]))
        return is_done  # the message of the session's refusal is shown by `run`

    async def enter(event: GenericEventArguments) -> None:
        if await apply_entry(event.args):
            field.run_method("blur")  # keys move controls again

    async def leave(event: GenericEventArguments) -> None:
        if event.args != entry[0]:
            with suppress(TwinError):
                if parse_entry(event.args, signal.display_unit) == applied[0]:
                    restore()  # in the unit shown
                    return
            if not await apply_entry(event.args):
                ui.timer(REFUSAL_SHOWN, lambda: setattr(field, "error", None), once=True)
            restore()

    # the text comes with the event: the server's copy of it may be older
    field.on("keydown.enter", enter, js_handler=SEND_TEXT)
    field.on("blur", leave, js_handler=SEND_TEXT)
    field.on("keydown.escape", lambda: write_text(field, f"{applied[0]:.9g}", has_focus=True))
    slider: ui.slider | None = None
    if name == signal.name and low is not None and high is not None and high > low:
        slider = ui.slider(min=low, max=high, step=(high - low) / 200, value=min(max(shown, low), high))
        slider.props(f'dense aria-label="{name}, slider"')

        async def slide() -> None:
            await apply_entry(f"{slider.value:.9g}")
            restore()

        slider.on("change", slide)


def write_text(field: ui.input, text: str, *, has_focus: bool = False) -> None:
    """Write into a field unless it has the focus, which only the browser knows; with `has_focus` in any case."""
    condition = "true" if has_focus else "!element.$el.contains(document.activeElement)"
    field.client.run_javascript(
        f"const element = getElement({field.id}); if (element && {condition}) element.inputValue = {json.dumps(text)};"
    )


def parse_entry(text: str, symbol: str, low: float | None = None, high: float | None = None) -> float:
    """Return a typed number in the unit `symbol`: plain, or with a unit of its own. RefusedError says why it is refused."""
    plain = text.strip().replace("\N{MINUS SIGN}", "-")
    if "," in plain:
        raise RefusedError(f"{plain}: write a decimal point, not a comma.")
    try:
        value = number(plain, symbol, "value")
    except TwinError as error:
        raise RefusedError(str(error).removeprefix("value: ") if plain else "Expected a number.") from None
    if low is not None and value < low:
        raise RefusedError(f"{plain} is refused: at least {bound_text(low, ROUND_CEILING)} {symbol}".rstrip() + ".")
    if high is not None and value > high:
        raise RefusedError(f"{plain} is refused: at most {bound_text(high, ROUND_FLOOR)} {symbol}".rstrip() + ".")
    return value


def bound_text(bound: float, rounding: str) -> str:
    """Return a bound; one of more than four digits is rounded to three, to a number that is accepted."""
    is_short = abs(bound) >= 1000.0 or f"{bound:.4g}" == f"{bound:g}"
    return f"{bound:g}" if is_short else f"{Context(3, rounding).create_decimal(f'{bound:g}'):f}"


def _executed(signal: CatalogSignal, value: float) -> float | int:
    """Return a value of the display unit in the variable's own unit."""
    own = (value - signal.offset) / signal.factor
    return round(own) if signal.type.lstrip("U").startswith("Int") else own


def overrides(context: PageContext, live: LiveSession) -> None:
    """Create the list of overrides."""
    catalog = context.console.catalog
    assert catalog is not None
    names = [
        signal.name
        for signal in catalog.signals.values()
        if signal.kind == "output" and not signal.shape and signal.type != "String"
    ]
    signal = (
        ui.select(names, with_input=True, label="output").props("dense options-dense outlined").classes("full-width")
    )
    with ui.row().classes("items-center full-width no-wrap"):
        text = (
            ui.input(placeholder="value")
            .props("dense outlined maxlength=60 aria-label='value of the override'")
            .classes("col")
        )
        signal.on_value_change(
            lambda: text.props(f'suffix="{catalog.signals[signal.value].display_unit if signal.value else ""}"')
        )

        async def override() -> None:
            if isinstance(signal.value, str) and isinstance(text.value, str) and text.value.strip():
                chosen, value = catalog.signals[signal.value], read(text.value)
                try:
                    if not (chosen.type == "Boolean" or chosen.items or isinstance(value, bool)):
                        value = _executed(chosen, parse_entry(text.value, chosen.display_unit))
                except TwinError as error:
                    context.notify(str(error))
                    return
                await context.run(live.override, chosen.name, value)

        ui.button("override", on_click=override).props("dense no-caps outline")
    column = ui.column().classes("full-width gap-0")
    shown: list[Any] = [None]

    def update() -> None:
        now = dict(live.state.overridden)
        if now != shown[0]:
            shown[0] = now
            column.clear()
            with column:
                for name, value in now.items():
                    with ui.row().classes("items-center full-width no-wrap"):
                        ui.label(f"{name} = {value}").classes("col ellipsis")
                        ui.button("release", on_click=context.on_press(lambda: live.release, name)).props(
                            "flat dense no-caps"
                        )

    ui.timer(0.3, update)


def read(text: str) -> Any:
    """Parse a number, true or false; other texts, e.g. with a unit, are returned unchanged."""
    plain = text.strip()
    with suppress(ValueError):
        return float(plain)
    return {"true": True, "false": False}.get(plain.lower(), plain)


def done(context: PageContext, live: LiveSession) -> None:
    """Create the list of executed commands, latest first, and the download of the session as a scenario."""

    def download() -> None:
        try:
            text = live.scenario_text()
        except (OSError, TwinError) as error:
            context.notify(str(error))
            return
        name = context.console.catalog.scenario if context.console.catalog else "session"
        ui.download.content(text, f"{name}_operated.yaml")

    ui.button("download as scenario", icon="download", on_click=download).props("flat dense no-caps").classes(
        "twin-download"
    ).tooltip("twin run with this file repeats the session to the bit")
    column = ui.column().classes("twin-done full-width gap-0")
    catalog = context.console.catalog
    controls = {control.input: control for control in catalog.controls} if catalog is not None else {}
    count = [-1]

    def update() -> None:
        if len(live.done) != count[0]:
            count[0] = len(live.done)
            column.clear()
            with column:
                for command in condense(live.done, controls)[: -MAX_COMMANDS - 1 : -1]:
                    with ui.row().classes("no-wrap full-width gap-2"):
                        ui.label(f"{command.time:.3f} s").classes("twin-soft twin-figures")
                        ui.label(command.text).classes("twin-line" + " twin-soft" * (not command.by_operator))
                if not live.done:
                    ui.label("No commands yet.").classes("twin-soft")

    update()
    ui.timer(0.25, update)


def condense(done: Sequence[ExecutedCommand], controls: Mapping[str, CatalogControl]) -> list[ExecutedCommand]:
    """Return the commands with only begin and end of each hold, which sets values thirty times a second and others along."""
    companions = {name for control in controls.values() for name in control.along}
    condensed_commands: list[ExecutedCommand] = []
    moving: dict[str, bool] = {}
    for command in done:
        name, equals, value = command.text.removeprefix("set ").partition(" = ")
        expired, _, cause = command.text.partition(": ")
        control = controls.get(expired if command.kind == EXPIRED else name)
        if name in companions and equals:
            continue
        if control is None or not (equals or command.kind == EXPIRED):
            condensed_commands.append(command)
            continue
        given = read(value.removesuffix(control.display_unit))
        rest = control.rest if isinstance(given, bool) else control.factor * control.rest + control.offset
        now = bool(equals) and given != (rest if isinstance(rest, bool) else float(f"{rest:.6g}"))
        if now != moving.get(control.input, False):
            if now:
                shown = f"{given:.3g} {control.display_unit}".rstrip() if isinstance(given, float) else value
                text = HELD if isinstance(given, bool) else f"{HELD} at {shown}"
            elif command.kind == EXPIRED:
                text = f"{RELEASED} by the dead-man switch: {cause}"
            else:
                text = RELEASED
            condensed_commands.append(replace(command, text=f"{control.label}{text}"))
        moving[control.input] = now
    return condensed_commands
