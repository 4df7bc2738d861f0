"""What people see of a run: the table in the terminal, and report.html, one file that needs nothing else."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.results import Ending, Evaluation, Event, Expectation, Figure, Outcome, Plot, coherent, failures
from twin.run.report_plots import drawn
from twin.run.variant_matrix import matrix

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rich.console import Console, ConsoleOptions, Group, RenderableType
    from rich.table import Table
    from rich.text import Text

    from twin.coupling import Catalog
    from twin.results import Signals
    from twin.scenario import Case

UNLIMITED = 10_000  # columns

VERDICTS = {  # word in the table, color in the terminal
    "pass":    ("pass", "green"),
    "fail":    ("FAIL", "bold red"),
    "none":    ("no value", "bold red"),
    "info":    ("-", "dim"),
    "other":   ("other settings", "yellow"),  # than the paper's
    "skipped": ("skipped", "dim"),
}  # fmt: skip

SECTIONS = {  # of report.html, as its table of contents names them
    "matrix": "Variants", "figures": "Figures", "expectations": "Expectations", "notes": "Notes", "hardware": "Hardware",
    "plots": "Plots", "half": "Half the step", "system": "System", "events": "Events", "parameters": "Parameters",
    "versions": "What ran",
}  # fmt: skip


@dataclass(frozen=True)
class ParameterRow:
    """A parameter as the report shows it. `given`: the scenario sets it; `variants`: where, if not in all."""

    member: str
    name: str
    value: str
    unit: str = ""
    description: str = ""
    source: str = ""
    given: bool = False
    variants: str = ""


@dataclass(frozen=True)
class EventRow:
    """An event as the report shows it. `variants`: where, if not in all; `only`: these as names."""

    time_ns: clock.Time
    what: str
    variants: str = ""
    only: tuple[str, ...] = ()

    @property
    def mark(self) -> Event:
        """The event as a plot shows it."""
        return Event(clock.seconds(self.time_ns), self.what, self.only)

    @property
    def time(self) -> str:
        """`1.5 s`."""
        return clock.text(self.time_ns)


def cells(one: Figure) -> dict[str, str]:
    """A metric of one variant as text."""
    tolerance = one.metric.tolerance
    return {
        "metric": one.metric.name,
        "variant": one.variant,
        "verdict": one.verdict,
        "paper": one.metric.shown(one.paper),
        "mean": "no value" if one.verdict == "none" else one.metric.shown(one.mean, one.scale),
        "worst": one.metric.shown(one.worst, one.scale),
        "ratio": "-" if one.ratio is None else f"{one.ratio:.2f}",
        "tolerance": f"± {100 * tolerance:g} %" if tolerance is not None and one.paper is not None else "-",
        "description": one.metric.description,
        "definition": definition(one),
    }


def definition(one: Figure) -> str:
    """What the number is: `std of sensor.force - 0.2, from 4 s`."""
    return f"{one.metric.reduce.replace('_', ' ')} of {one.metric.signal.text}{one.metric.window.text}"


def table(evaluation: Evaluation) -> Group:
    """Figures beside the paper's, and what became of the expectations, for a terminal of any width."""
    from rich.console import Group
    from rich.text import Text

    parts: list[Any] = [Figures([cells(one) for one in evaluation.figures])] if evaluation.figures else []
    for one in evaluation.outcomes:
        word, color = VERDICTS[one.verdict]
        name = f"{one.name}: " if named(one) else ""
        parts.append(Text.assemble((f"{word:<8}", color), name, one.detail))
    return Group(*parts)


class Figures:
    """Rows of `cells` in the widest layout that the terminal has columns for: no name and no number is ever shortened.

    One row for each variant, beside its metric; below its metric; as a sentence below its metric.
    """

    def __init__(self, rows: list[dict[str, str]]) -> None:
        self.rows = rows
        self.compared = any(row["paper"] != "-" for row in rows)
        keys = ("paper", "mean", "worst", "ratio", "tolerance") if self.compared else ("mean", "worst")
        self.titles = {key: "twin" if key == "mean" and self.compared else key for key in keys}

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterable[RenderableType]:
        """What rich calls to print it."""
        for grid in (self.beside(), self.below()):
            if console.measure(grid, options=options.update(max_width=UNLIMITED)).maximum <= options.max_width:
                yield grid
                return
        yield self.sentences(options.max_width)

    def verdict(self, row: dict[str, str]) -> Text:
        """The verdict in its color."""
        from rich.text import Text

        return Text(*VERDICTS[row["verdict"]])

    def grouped(self) -> dict[str, list[dict[str, str]]]:
        """The rows of each metric."""
        found: dict[str, list[dict[str, str]]] = {}
        for row in self.rows:
            found.setdefault(row["metric"], []).append(row)
        return found

    def beside(self) -> Table:
        """Metric and variant in columns of their own."""
        from rich import box
        from rich.table import Table
        from rich.text import Text

        grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
        for title in ("metric", "variant"):
            grid.add_column(title, no_wrap=True)
        for title in self.titles.values():
            grid.add_column(title, justify="right", no_wrap=True)
        if self.compared:
            grid.add_column("verdict", no_wrap=True)
        for name, rows in self.grouped().items():
            for row in rows:
                texts = [name if row is rows[0] else "", row["variant"], *(row[key] for key in self.titles)]
                grid.add_row(*map(Text, texts), *([self.verdict(row)] if self.compared else []))
            grid.add_section()
        return grid

    def below(self) -> Table:
        """The metric on a line of its own, its variants below it."""
        from rich.table import Table
        from rich.text import Text

        widths = {key: max(len(row[key]) for row in [self.titles, *self.rows]) for key in self.titles}
        first = max(len(row["variant"]) for row in self.rows) + 2

        def line(variant: str, texts: Iterable[str]) -> str:
            places = [text.rjust(width) for text, width in zip(texts, widths.values(), strict=True)]
            return "  ".join([variant.ljust(first), *places])

        grid = Table.grid()
        grid.add_column(no_wrap=True)
        grid.add_row("")
        grid.add_row(Text(line("", self.titles.values()) + "  verdict" * self.compared, "bold"))
        for name, rows in self.grouped().items():
            grid.add_row(Text(name))
            for row in rows:
                text = Text(line(f"  {row['variant']}", (row[key] for key in self.titles)))
                grid.add_row(Text.assemble(text, "  ", self.verdict(row)) if self.compared else text)
        grid.add_row("")
        return grid

    def sentences(self, width: int) -> Group:
        """`PI: paper 0.0362 N, twin 0.0357 N, ...`, broken between values."""
        from rich.console import Group
        from rich.text import Text

        parts: list[Text] = [Text("")]
        for name, rows in self.grouped().items():
            parts.append(Text(name, overflow="fold"))
            for row in rows:
                values = [f"{title} {row[key]}" for key, title in self.titles.items() if row[key] != "-"]
                # textwrap does not break at these blanks
                text = ", ".join(value.replace(" ", "\N{NO-BREAK SPACE}") for value in values)
                lines = textwrap.wrap(text, max(width - 4, 1), break_on_hyphens=False)
                title = Text(f"  {row['variant']}", overflow="fold")
                parts.append(Text.assemble(title, ": ", self.verdict(row)) if self.compared else title)
                parts += [Text("    " + one.replace("\N{NO-BREAK SPACE}", " "), overflow="fold") for one in lines]
        return Group(*parts, Text(""))


def named(one: Outcome) -> bool:
    """Whether an expectation has a name of its own, one that its detail does not tell anyway."""
    return not one.name.startswith(one.detail.partition(" ")[0].rstrip(":"))


def parameters(
    cases: Sequence[Case], catalogs: Mapping[str, Catalog], sources: Mapping[str, str] | None = None
) -> list[ParameterRow]:
    """Every parameter of every variant, equal ones once. `sources`: member.parameter -> where it is from."""
    found: dict[tuple[str, str], dict[tuple[str, str, bool], list[str]]] = {}
    descriptions: dict[tuple[str, str], str] = {}
    for case in cases:
        for member, variables in catalogs[case.variant].items():
            values = case.values(member, variables)
            for name, variable in variables.items():
                if variable.causality not in ("parameter", "structuralParameter"):
                    continue
                given = any(key.partition("[")[0] == name for key in case.members[member].parameters)
                if name == "seed" and not given:
                    continue  # another one in every run
                unit = variable.display_unit or variable.unit
                text = value_text(values.get(name, variable.start), variable.unit, unit)
                found.setdefault((member, name), {}).setdefault((text, unit, given), []).append(case.variant)
                descriptions[member, name] = variable.description
    count = len({case.variant for case in cases})
    return [
        ParameterRow(
            member,
            name,
            text,
            unit,
            descriptions[member, name],
            (sources or {}).get(f"{member}.{name}", ""),
            given,
            "" if len(variants) == count else ", ".join(variants),
        )
        for (member, name), texts in found.items()
        for (text, unit, given), variants in texts.items()
    ]


def value_text(value: Any, unit: str, display: str) -> str:
    """A value in its display unit, long arrays shortened."""
    if value is None:
        return ""
    array = np.asarray(value)
    if array.dtype.kind == "f" and display != unit:
        (factor, offset), (shown_factor, shown_offset) = coherent(unit), coherent(display)
        array = (array * factor + offset - shown_offset) / shown_factor
    texts = [f"{item:.6g}" if isinstance(item, float) else str(item) for item in array.ravel().tolist()]
    if array.ndim == 0:
        return texts[0]
    return f"[{', '.join(texts)}]" if len(texts) <= 6 else f"[{', '.join(texts[:3])}, … {texts[-1]}] ({len(texts)})"


def events(cases: Sequence[Case]) -> list[EventRow]:
    """What happens when, those of all variants once."""
    found: dict[tuple[clock.Time, str], list[str]] = {}
    for case in cases:
        happens = [
            (event.time_ns, f"{event.kind} {event.variable}" + ("" if event.kind == "release" else f" = {event.value}"))
            for event in case.events
        ]
        for key in (*happens, *((fault.time_ns, f"fault {fault.text}") for fault in case.faults)):
            names = found.setdefault(key, [])
            if case.variant not in names:
                names.append(case.variant)
    count = len({case.variant for case in cases})
    rows = sorted(found.items(), key=lambda item: item[0][0])
    some = ((time, what, () if len(names) == count else tuple(names)) for (time, what), names in rows)
    return [EventRow(time, what, ", ".join(names), names) for time, what, names in some]


def html(
    summary: Mapping[str, Any],
    evaluation: Evaluation,
    tables: Mapping[tuple[str, int], Signals],
    *,
    plots: Iterable[Plot] = (),
    parameters: Sequence[ParameterRow] = (),
    events: Sequence[EventRow] = (),
    pictures: Sequence[dict[str, str]] = (),
    endings: Mapping[tuple[str, int], Ending] = MappingProxyType({}),
    systems: Sequence[tuple[tuple[str, str], Sequence[str]]] = (),
    halved: Sequence[Mapping[str, str]] = (),
    expectations: Sequence[Expectation] = (),
) -> str:
    """report.html as text. `summary` is that of `results.summary`; without `plots` every recorded signal is drawn.

    `pictures` are drawn already: title, svg and note; `systems`: drawn, what that does not show, and variants.
    `halved`: cells of metrics at half the step. `expectations`: in the order of their outcomes, to mark what failed.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("twin.run", ""),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    failed = failures(expectations, evaluation, tables)
    figures = [*drawn(plots, tables, [row.mark for row in events], failed), *pictures]
    members: dict[str, list[ParameterRow]] = {}
    for row in parameters:
        members.setdefault(row.member, []).append(row)
    groups: dict[str, list[dict[str, str]]] = {}
    for one in evaluation.figures:
        groups.setdefault(one.metric.name, []).append(cells(one))
    return environment.get_template("report.html").render(
        summary=summary, groups=groups, outcomes=evaluation.outcomes, plots=figures, members=members, events=events,
        words={key: word for key, (word, _) in VERDICTS.items()}, named=named,
        endings={f"{variant}, seed {seed}": one for (variant, seed), one in endings.items() if one != Ending()},
        compared=any(one.paper is not None for one in evaluation.figures),
        variants=list(dict.fromkeys(variant for variant, _ in tables)),
        seeds=list(dict.fromkeys(seed for _, seed in tables)),
        systems=[(svg, told, ", ".join(names) * (len(systems) > 1)) for (svg, told), names in systems], halved=halved,
        matrix=matrix(evaluation, failed), titles=SECTIONS,
        incomplete=[f"{variant}, seed {seed}" for (variant, seed), signals in tables.items() if not signals.complete],
    )  # fmt: skip
