"""Output of a run for users: the table in the terminal, and the rows of the tables of metrics in report.html."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from twin.results import (
    Evaluation,
    ExpectationResult,
    MetricResult,
    list_names,
    metric_formats,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rich.console import Console, ConsoleOptions, Group, RenderableType
    from rich.table import Table
    from rich.text import Text

    from twin.results import Metric, MetricFormat

UNLIMITED = 10_000  # columns

VERDICTS = {  # text in the table, color in the terminal
    "pass": ("pass", "green"),
    "fail": ("FAIL", "bold red"),
    "none": ("no value", "bold red"),
    "info": ("-", "dim"),
    "other": ("other settings", "yellow"),  # not comparable with the paper's
    "cut": ("run too short", "yellow"),  # it ends before the metric's window
    "skipped": ("skipped", "dim"),
    "unjudged": ("note", "yellow"),
}


def metric_rows(
    results: Sequence[MetricResult], formats: Mapping[str, MetricFormat] | None = None
) -> list[dict[str, str]]:
    """Format metrics as texts of table rows. `formats`: from all metrics of the run, if these are some of them."""
    formats = formats or metric_formats(results)
    return [metric_cells(result, formats[result.metric.name]) for result in results]


def metric_cells(result: MetricResult, style: MetricFormat) -> dict[str, str]:
    """Format a metric of one variant as texts of a table row."""
    tolerance = result.metric.tolerance
    return {
        "metric": result.metric.name,
        "variant": result.variant,
        "verdict": result.verdict,
        "paper": style.reference(result.paper),
        "mean": VERDICTS[result.verdict][0]
        if result.mean is None and result.verdict in {"none", "cut"}
        else result.metric.named(result.mean, style.text(result.mean, result.scale)),
        "worst": result.metric.named(result.worst, style.text(result.worst, result.scale))
        if result.metric.has_worst
        else "-",
        "ratio": "-" if result.ratio is None else f"{result.ratio:.2f}",
        "tolerance": f"± {100 * tolerance:g} %" if tolerance is not None and result.paper is not None else "-",
        "description": result.metric.description,
        "definition": metric_definition(result.metric),
    }


def list_failures(evaluation: Evaluation) -> list[ExpectationResult]:
    """Return the failed expectations, and the metrics outside their tolerance as such, variants with one text together."""
    failures = [result for result in evaluation.expectation_results if result.verdict == "fail"]
    variants: dict[tuple[str, str], list[str]] = {}
    for row in filter(is_failure, metric_rows(evaluation.metric_results)):
        reference = f", expected the paper's {row['paper']} {row['tolerance']}" if row["paper"] != "-" else ""
        key = row["description"] or row["metric"], f"{row['mean']}{reference}."
        variants.setdefault(key, []).append(row["variant"])
    metrics = [ExpectationResult(f"{name}, {list_names(own)}", "fail", text) for (name, text), own in variants.items()]
    return [*failures, *metrics]


def is_failure(row: Mapping[str, str]) -> bool:
    """Whether a metric of a variant fails."""
    return row["verdict"] in ("fail", "none")


def metric_definition(metric: Metric) -> str:
    """Format the definition of a metric: `std of sensor.force - 0.2, from 4 s`."""
    return f"{metric.reduce.replace('_', ' ')} of {metric.signal.text}{metric.window.text}"


def results_table(evaluation: Evaluation, verbose: bool = False) -> Group:
    """Format metrics, reference values and expectation results for a terminal of any width.

    Without `verbose`, passed and skipped expectations are counted, and metrics without a reference value are shortened.
    """
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    expectations, metrics = evaluation.expectation_results, evaluation.metric_results
    verdicts = Table.grid()
    verdicts.add_column(no_wrap=True, min_width=8)
    verdicts.add_column(overflow="fold")
    for result in expectations:
        if verbose or result.is_outside or result.verdict not in ("pass", "skipped"):
            name = f"{result.name}: " if has_own_name(result) else ""
            texts = [result.detail, *[result.more] * (verbose and bool(result.more))]
            verdicts.add_row(
                Text(*VERDICTS["unjudged" if result.is_outside else result.verdict]), Text(name + " ".join(texts))
            )
            for variant, seed, value, time in result.cases if verbose and len(result.cases) > 1 else ():
                verdicts.add_row("", Text(f"{variant}, seed {seed}: {value}{', ' * bool(time)}{time}"))
    for sentence in evaluation.unjudged if expectations else ():
        verdicts.add_row(Text(*VERDICTS["unjudged"]), Text(sentence))
    for verdict, text in () if verbose else count_verdicts(expectations, metrics).items():
        verdicts.add_row(Text(*VERDICTS[verdict]), Text(text))
    table = MetricTable(metric_rows(metrics), has_seeds(metrics)) if verbose else MetricOverview(metrics)
    return Group(*[table] * bool(metrics), *[verdicts] * bool(verdicts.row_count))


def count_verdicts(results: Sequence[ExpectationResult], metrics: Sequence[MetricResult]) -> dict[str, str]:
    """Return a text for the skipped expectations and one for the passed ones, also of the paper's figures, by verdict."""
    figures = sum(metric.verdict == "pass" for metric in metrics)
    compared = f", and {figures} of the paper's figures above" if figures else ""
    names = {verdict: [each.name for each in results if each.verdict == verdict] for verdict in ("skipped", "pass")}
    subjects = {verdict: f"{len(each)} requirement{'s' * (len(each) > 1)}" for verdict, each in names.items()}
    pronouns = {verdict: "them" if len(each) > 1 else "it" for verdict, each in names.items()}
    texts = {
        "skipped": f"{subjects['skipped']} (--verbose lists {pronouns['skipped']} and says why).",
        "pass": f"{subjects['pass']} (--verbose lists {pronouns['pass']}){compared}.",
    }
    return {verdict: text for verdict, text in texts.items() if names[verdict]}


def compact_table(results: Sequence[MetricResult], formats: Mapping[str, MetricFormat]) -> MetricTable:
    """Return the table of some metrics, failures first, without columns that say nothing: one seed is its own worst."""
    table = MetricTable(sorted(metric_rows(results, formats), key=lambda row: not is_failure(row)), has_seeds(results))
    is_used = {
        "worst": has_seeds(results),
        "tolerance": any(result.verdict in ("pass", "fail") for result in results),
    }
    table.titles = {key: title for key, title in table.titles.items() if is_used.get(key, True)}
    return table


def has_seeds(results: Iterable[MetricResult]) -> bool:
    """Whether metrics have values of several seeds."""
    return any(len(result.values) > 1 for result in results)


class MetricOverview:
    """Metrics of a run in few lines: those with a reference value as a `MetricTable`, failures first; below it the others.

    The others are a table with a column for each variant if it fits, else a list if it is short; else they are counted.
    """

    MAX_WIDTH = 120  # of the table of variants, also where the output is a file
    MAX_ROWS = 18  # of the list
    MAX_VARIANTS = 6  # up to which a metric with a reference value is shown for the other variants, too

    def __init__(self, results: Sequence[MetricResult]) -> None:
        self.formats = metric_formats(results)
        by_name: dict[str, list[MetricResult]] = {}
        for result in results:
            by_name.setdefault(result.metric.name, []).append(result)
        self.compared: list[MetricResult] = []
        self.others: dict[str, list[MetricResult]] = {}
        for name, group in by_name.items():
            judged = [result for result in group if result.paper is not None or result.verdict != "info"]
            self.compared += group if judged and len(group) <= self.MAX_VARIANTS else judged
            if not judged:
                self.others[name] = group

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterable[RenderableType]:
        """Render for rich."""
        from rich.text import Text

        if self.compared:
            yield compact_table(self.compared, self.formats)
        if not self.others:
            return
        table = self.variant_table()
        width = min(options.max_width, self.MAX_WIDTH)
        others = [result for group in self.others.values() for result in group]
        if console.measure(table, options=options.update(max_width=UNLIMITED)).maximum <= width:
            yield table
        elif len(others) + len(self.others) <= self.MAX_ROWS:
            yield compact_table(others, self.formats)
        else:
            more, number = "more " * bool(self.compared), len(self.others)
            yield Text(
                f"{number} {more}metric{'s' * (number > 1)} without a reference value: see --verbose or the report."
            )

    def variant_table(self) -> Table:
        """Lay out one row for each metric, with its unit, and one column for each variant: mean over seeds / worst seed."""
        from rich import box
        from rich.table import Table
        from rich.text import Text

        results = [result for group in self.others.values() for result in group]
        is_mean = has_seeds(results)
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
        table.add_column("mean / worst of the seeds" if is_mean else "metric", no_wrap=True)
        variants = list(dict.fromkeys(result.variant for result in results))
        for variant in variants:
            table.add_column(Text(variant), justify="right", no_wrap=True)
        for name, group in self.others.items():
            style = self.formats[name]
            cells = dict.fromkeys(variants, "-")
            for result in group:
                numbers = [style.number(value, result.scale) for value in (result.mean, result.worst)]
                cells[result.variant] = " / ".join(numbers if is_mean and result.metric.has_worst else numbers[:1])
            table.add_row(*map(Text, (f"{name} [{style.label}]" if style.label else name, *cells.values())))
        return table


class MetricTable:
    """Table of metrics in the widest layout that fits the terminal: no name and no number is shortened.

    One row for each variant, next to its metric; below its metric; as a sentence below its metric.
    """

    def __init__(self, rows: list[dict[str, str]], has_seeds: bool = False) -> None:
        self.rows = rows
        self.has_reference = any(row["paper"] != "-" for row in rows)
        keys = ("paper", "mean", "worst", "ratio", "tolerance") if self.has_reference else ("mean", "worst")
        self.titles = {key: key for key in keys}
        if self.has_reference:
            self.titles["mean"] = "twin, mean" if has_seeds else "twin"
        if has_seeds:
            self.titles["worst"] = "worst seed"

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterable[RenderableType]:
        """Render for rich."""
        for grid in (self.wide_layout(), self.stacked_layout()):
            if console.measure(grid, options=options.update(max_width=UNLIMITED)).maximum <= options.max_width:
                yield grid
                return
        yield self.text_layout(options.max_width)

    def verdict(self, row: dict[str, str]) -> Text:
        """Format the verdict in its color."""
        from rich.text import Text

        return Text(*VERDICTS[row["verdict"]])

    def group_by_metric(self) -> dict[str, list[dict[str, str]]]:
        """Group the rows by metric."""
        groups: dict[str, list[dict[str, str]]] = {}
        for row in self.rows:
            groups.setdefault(row["metric"], []).append(row)
        return groups

    def wide_layout(self) -> Table:
        """Lay out metric and variant in their own columns."""
        from rich import box
        from rich.table import Table
        from rich.text import Text

        grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
        for title in ("metric", "variant"):
            grid.add_column(title, no_wrap=True)
        for title in self.titles.values():
            grid.add_column(title, justify="right", no_wrap=True)
        if self.has_reference:
            grid.add_column("verdict", no_wrap=True)
        for name, rows in self.group_by_metric().items():
            for row in rows:
                texts = [name if row is rows[0] else "", row["variant"], *(row[key] for key in self.titles)]
                grid.add_row(*map(Text, texts), *([self.verdict(row)] if self.has_reference else []))
            if len(rows) > 1:
                grid.add_section()
        return grid

    def stacked_layout(self) -> Table:
        """Lay out the metric on its own line, its variants below it."""
        from rich.table import Table
        from rich.text import Text

        widths = {key: max(len(row[key]) for row in [self.titles, *self.rows]) for key in self.titles}
        first = max(len(row["variant"]) for row in self.rows) + 2

        def line(variant: str, texts: Iterable[str]) -> str:
            padded = [text.rjust(width) for text, width in zip(texts, widths.values(), strict=True)]
            return "  ".join([variant.ljust(first), *padded])

        grid = Table.grid()
        grid.add_column(no_wrap=True)
        grid.add_row("")
        grid.add_row(Text(line("", self.titles.values()) + "  verdict" * self.has_reference, "bold"))
        for name, rows in self.group_by_metric().items():
            grid.add_row(Text(name))
            for row in rows:
                text = Text(line(f"  {row['variant']}", (row[key] for key in self.titles)))
                grid.add_row(Text.assemble(text, "  ", self.verdict(row)) if self.has_reference else text)
        grid.add_row("")
        return grid

    def text_layout(self, width: int) -> Group:
        """Lay out as `PI: pass, paper 0.0362 N, twin 0.0357 N, ...`, wrapped between values with a hanging indent."""
        from rich.console import Group
        from rich.text import Text

        parts: list[Text] = [Text("")]
        for name, rows in self.group_by_metric().items():
            parts.append(Text(name, overflow="fold"))
            for row in rows:
                verdict = self.verdict(row) if row["verdict"] != "info" else Text()
                values = [f"{title} {row[key]}" for key, title in self.titles.items() if row[key] != "-"]
                texts = [f"  {row['variant']}: ", *([verdict.plain] if verdict else []), *values]
                # textwrap does not break at these blanks
                text = texts[0] + ", ".join(value.replace(" ", "\N{NO-BREAK SPACE}") for value in texts[1:])
                lines = textwrap.wrap(text, max(width, 5), subsequent_indent="    ", break_on_hyphens=False)
                for line in lines:
                    part = Text(line.replace("\N{NO-BREAK SPACE}", " "), overflow="fold")
                    part.highlight_words([f": {verdict.plain}"] if verdict else [], verdict.style)
                    parts.append(part)
        return Group(*parts, Text(""))


def has_own_name(result: ExpectationResult) -> bool:
    """Whether an expectation has a name that its detail does not repeat."""
    return not result.name.startswith(result.detail.partition(" ")[0].rstrip(":"))
