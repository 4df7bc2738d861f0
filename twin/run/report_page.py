"""report.html of a run: one file with tables, still plots, and charts in their place where scripts run."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from html import unescape
from itertools import zip_longest
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from twin.results import (
    Expectation,
    ExpectationResult,
    HardwareTermination,
    Plot,
    count_not_judged,
    count_verdicts,
    find_violations,
    group_lines,
    list_names,
    metric_formats,
    requirements_text,
    si_conversion,
    trace_to_inputs,
    worst_seeds_first,
)
from twin.run.cases import noop
from twin.run.metric_charts import draw_metric_charts
from twin.run.report import VERDICTS, has_own_name, is_failure, list_failures, metric_rows
from twin.run.report_figure import ReportFigure
from twin.run.report_plots import HERE, draw_plots
from twin.run.variant_matrix import build_matrix
from twin.scenario import scenario_paths
from twin.scene import page as scene_page
from twin.web import PackedArrays, chart_script, embed_json, read_static, report_templates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from markupsafe import Markup

    from twin.results import Analysis, Evaluation, Signals
    from twin.run.event_table import EventRow
    from twin.run.parameter_table import ParameterRow
    from twin.run.scenes import ReportScenes

    Change = tuple[str, str]  # name with value, and what it was or what the component's default is

SECTIONS = {  # of report.html: titles in its table of contents
    "requirements": "Requirements",
    "plots": "Plots",
    "metrics": "Metrics",
    "notes": "Notes",
    "hardware": "Hardware",
    "half": "Step refinement",
    "system": "System",
    "events": "Events",
    "parameters": "Parameters",
    "versions": "Versions",
}
MAX_KEY_ROWS = 8  # variants of the table on the first screen
MAX_STRUCTURES = 12  # variants with other members or connections, in words
MAX_DIFFERENCES = 6  # members and connections of such a variant
RULE = (
    "Pointer: values, and the case and time of the scene. Click: time t1, then t2, with values in every pane. Shift-drag: move. "
    "Ctrl and wheel: zoom at the pointer. Click a name: dim its curve. Values are rounded to 1/65,536 of the range of their curve."
)

MAX_FACTORS = 3  # of a case of a study, in its headline


def metric_groups(evaluation: Evaluation) -> dict[str, list[dict[str, str]]]:
    """Return the rows of each metric; metrics with a failure come first."""
    groups: dict[str, list[dict[str, str]]] = {}
    for row in metric_rows(evaluation.metric_results):
        groups.setdefault(row["metric"], []).append(row)
    return dict(sorted(groups.items(), key=lambda group: not any(map(is_failure, group[1]))))


def key_rows(evaluation: Evaluation) -> list[dict[str, str]]:
    """Return the rows of the first metric with a published value, for the first screen; none of one or of many variants."""
    rows = metric_rows(evaluation.metric_results)
    name = next((row["metric"] for row in rows if row["paper"] != "-"), "")
    own = [row for row in rows if row["metric"] == name]
    return own if 1 < len(own) <= MAX_KEY_ROWS else []


def compare_with_paper(evaluation: Evaluation) -> str:
    """Return a sentence on the published values: how many are met, and the range of twin / paper; empty without them."""
    results = [result for result in evaluation.metric_results if result.ratio is not None]
    judged = [result for result in results if result.verdict in ("pass", "fail")]
    ratios = [result.ratio for result in judged or results if result.ratio is not None]
    if not ratios:
        return ""
    passed = sum(result.verdict == "pass" for result in judged)
    has_changes = any(result.verdict == "other" for result in results)
    reason = (
        "this run has other settings" if has_changes else "the scenario gives no tolerance, they are for comparison"
    )
    values = f"{len(ratios)} published value{'s' * (len(ratios) != 1)}"
    text = f"{passed} of {values} within their tolerance" if judged else f"{values}, not judged: {reason}"
    low, high = f"{min(ratios):.2f}", f"{max(ratios):.2f}"
    return f"{text}; twin / paper: {low if low == high else f'{low} to {high}'}."


def split_first_sentence(text: str) -> tuple[str, str]:
    """Return the first sentence of a text, and the others."""
    first, *rest = re.split(r"(?<=[a-z0-9)][.])\s+(?=[A-Z])", text.strip(), maxsplit=1)
    return first, " ".join(rest)


def mark_code(text: str) -> Markup:
    """Return a text as HTML, with what stands in backticks as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))  # noqa: S704 - escaped


def link_failures(evaluation: Evaluation, figures: Sequence[ReportFigure]) -> list[tuple[ExpectationResult, str]]:
    """Return each failure with the element of the page that shows it, a plot, a table, or none, in the order of the plots."""
    plots = {name: number for number, figure in reversed(list(enumerate(figures, 1))) for name in figure.violations}
    expectations = [result for result in evaluation.expectation_results if result.verdict == "fail"]
    failures = list_failures(evaluation)
    numbers = [plots.get(result.name, len(figures) + 1) for result in expectations]
    targets = [f"plot-{number}" if number <= len(figures) else "" for number in numbers]
    metrics = [(failure, "metrics") for failure in failures[len(expectations) :]]
    order = sorted(range(len(expectations)), key=numbers.__getitem__)
    return [*((failures[i], targets[i]) for i in order), *metrics]


def report_html(
    summary: Mapping[str, Any],
    evaluation: Evaluation,
    tables: Mapping[tuple[str, int], Signals],
    *,
    plots: Iterable[Plot] = (),
    parameters: Sequence[ParameterRow] = (),
    events: Sequence[EventRow] = (),
    scenes: ReportScenes | None = None,
    pictures: Sequence[Mapping[str, str]] = (),
    terminations: Mapping[tuple[str, int], HardwareTermination] = MappingProxyType({}),
    structures: Sequence[tuple[tuple[str, str], Sequence[str]]] = (),
    refinements: Sequence[Mapping[str, str]] = (),
    expectations: Sequence[Expectation] = (),
    analyses: Sequence[Analysis] = (),
    previous_values: Sequence[str] = (),
    folder: str = "latest",
    default_folder: str = "",
    progress: Callable[[float], object] = noop,
) -> str:
    """Render report.html. `summary`: from `run_folder.build_summary`; without `plots` every recorded signal is drawn.

    `pictures`: finished figures with title, svg and note; `structures`: diagrams as (SVG, remarks) and their variants.
    `refinements`: cells of metrics at half the step. `expectations`: in the order of their results, to mark violations.
    `previous_values`: of the scenario's overrides. `analyses`: a violated metric of theirs is marked in their inputs. `folder`: of the run, for the commands that show its curves. `default_folder`: of a run
    with the scenario's own parameters; empty if there is none. `progress`: see `draw_plots`.
    """
    violations = find_violations(expectations, evaluation, tables)
    tables = worst_seeds_first(tables, violations)
    arrays = PackedArrays()
    in_curves = [
        traced
        for violation in violations
        if not violation.over_time
        for traced in trace_to_inputs(violation, analyses, tables)
    ]
    curves = draw_plots(
        plots, tables, [row.annotation for row in events], in_curves, arrays, folder, signal_codes(evaluation), progress
    )
    first = next((violation for violation in in_curves if not (violation.reduce or violation.span)), None)
    order = [result.name for result in evaluation.expectation_results]

    def rank(figure: ReportFigure) -> tuple[bool, bool, bool, int]:
        """Sort the curve of the first violation over time first, then those of the others, charts of metrics, and what holds."""
        is_first = first is not None and first.name in figure.violations and bool(figure.panels)
        numbers = [order.index(name) for name in figure.violations]
        return not is_first, not numbers, not figure.panels, min(numbers, default=0)

    figures = sorted(with_computed(curves, draw_metric_charts(expectations, evaluation, analyses)), key=rank)
    films = scenes.films if scenes else []
    variants = list(dict.fromkeys(variant for variant, _ in tables))
    reason = "; ".join(group_lines(str(summary.get("reason") or "").splitlines(), tables))
    changes = describe_changes(summary.get("overrides", ()), previous_values, parameters)
    failures = link_failures(evaluation, figures)
    notes = group_lines(summary.get("notes", ()), tables)
    changed_notes = [note for note in notes if any(option in note for option in summary.get("overrides", ()))]
    # of a case of a study: its own values, not those of each variable
    factors = summary.get("study", {}).get("factors", {})
    stated = [(" ".join(item), "") for item in factors.items() if len(factors) <= MAX_FACTORS] if factors else changes
    rows = failure_rows(failures, default_values(expectations, evaluation, read_summary(default_folder)), variants)
    sentence = summary.get("sentence") or outcome_sentence(summary, stated, rows)
    sentence = re.sub(r"(?<=\d) (?=(?:[mk]?[NmsAV]|Hz|deg)\b|[%/])", "\N{NO-BREAK SPACE}", sentence)
    notes = [note for note in notes if note not in changed_notes]
    summary = {**summary, "reason": reason, "notes": notes, "sentence": sentence}
    return (
        report_templates("twin.run", "twin.scene")
        .get_template("report.html")
        .render(
            **page_scripts(figures, films, arrays),
            summary=summary,
            groups=metric_groups(evaluation),
            key_rows=key_rows(evaluation),
            outcomes=evaluation.expectation_results,
            counts=count_verdicts(summary),
            requirements=requirements_text(*count_verdicts(summary), *count_not_judged(summary)),
            published=sum(result.verdict == "pass" for result in evaluation.metric_results),
            failures=failures,
            changed_notes=changed_notes,
            rows=rows,
            has_default=bool(default_folder),
            run_reference=run_reference(summary["scenario"]),
            folder=folder,
            plots=[
                *figures,
                *(scenes.stills if scenes else ()),
                *(ReportFigure(picture["title"], picture["svg"], picture["note"]) for picture in pictures),
            ],
            members=group_by_member(parameters),
            compare=compare_command(summary["scenario"], folder, default_folder),
            changes=changes,
            events=events,
            scenes_left_out=scenes.left_out if scenes else 0,
            words={key: word for key, (word, _) in VERDICTS.items()},
            named=has_own_name,
            mark_code=mark_code,
            comparison=compare_with_paper(evaluation),
            description=split_first_sentence(summary["scenario"]["description"]),
            terminations=early_terminations(terminations),
            has_reference=any(result.paper is not None for result in evaluation.metric_results),
            variants=variants,
            seeds=list(dict.fromkeys(seed for _, seed in tables)),
            structures=titled_structures(structures[: MAX_STRUCTURES + 1]),
            more_structures=len(structures[MAX_STRUCTURES + 1 :]),
            refinements=refinements,
            matrix=build_matrix(evaluation, violations, variants, list(plots), [row.annotation for row in events]),
            titles=SECTIONS,
            start=next((violation.start for violation in (first, *in_curves, *violations) if violation), None),
            starts={violation.name: violation.start for violation in reversed([*in_curves, *violations])},
            incomplete=[
                f"{variant}, seed {seed}" for (variant, seed), signals in tables.items() if not signals.complete
            ],
        )
    )


def signal_codes(evaluation: Evaluation) -> dict[str, dict[int, str]]:
    """Return the names of the values of signals that metrics read as codes, by the texts of the signals."""
    metrics = [result.metric for result in evaluation.metric_results]
    return {metric.signal.text: metric.codes for metric in metrics if metric.codes}


def early_terminations(terminations: Mapping[tuple[str, int], HardwareTermination]) -> dict[str, HardwareTermination]:
    """Return the terminations on hardware that differ from a completed run, by variant and seed as text."""
    return {
        f"{variant}, seed {seed}": termination
        for (variant, seed), termination in terminations.items()
        if termination != HardwareTermination()
    }


def titled_structures(
    structures: Sequence[tuple[tuple[str, str], Sequence[str]]],
) -> tuple[tuple[str, str, str] | None, list[tuple[str, str]]]:
    """Return the first diagram as (SVG, remarks, names of its variants), and how those of other variants differ in words."""
    if not structures:
        return None, []
    ((svg, remarks), names), *others = structures
    differences = [("; ".join(own), describe_difference(svg, other)) for (other, _), own in others]
    return (svg, remarks, "; ".join(names) * bool(others)), differences


def describe_difference(svg: str, other: str) -> str:
    """Return the members and connections of another diagram that differ, by the titles of their lines and boxes."""
    titles = [
        {unescape(title).splitlines()[0] for title in re.findall("<title>(.+?)</title>", each, re.DOTALL)}
        for each in (svg, other)
    ]
    lost, new = (sorted(titles[0] - titles[1]), sorted(titles[1] - titles[0]))
    members = {title.partition(": ")[0] for title in lost if ": " in title}
    texts = [
        title.replace(": ", " is ", 1) if title.partition(": ")[0] in members else f"with {title}" for title in new
    ]
    new_members = {title.partition(": ")[0] for title in new}
    texts += [f"without {title}" for title in lost if title.partition(": ")[0] not in new_members]
    more = len(texts) - MAX_DIFFERENCES
    return "; ".join([*texts[:MAX_DIFFERENCES], *[f"{more} more"] * (more > 0)]) or "other delays or remarks"


def group_by_member(parameters: Sequence[ParameterRow]) -> dict[str, list[ParameterRow]]:
    """Return the parameters by member, those set by an option first, then the others that are set."""
    members: dict[str, list[ParameterRow]] = {}
    for row in sorted(parameters, key=lambda row: (not row.source.startswith("set by `--"), not row.given)):
        members.setdefault(row.member, []).append(row)
    return members


def describe_changes(
    overrides: Sequence[str], previous_values: Sequence[str], parameters: Sequence[ParameterRow]
) -> list[Change]:
    """Return each override as `name value`, and what it was or what the component's default is."""
    defaults = {f"{row.member}.{row.name}": row.default for row in parameters}
    changes = []
    for option, before in zip_longest(overrides, previous_values, fillvalue=""):
        name, _, value = option.partition("=")
        default = defaults.get(name.replace(".parameters.", "."), "")
        was = f"was {before}" if before not in ("", value) else f"default {default}" if default else ""
        changes.append((f"{name} {value}", was))
    return changes


def with_computed(curves: Sequence[ReportFigure], charts: Sequence[ReportFigure]) -> list[ReportFigure]:
    """Return the figures of curves, each with the chart of the failed metric that an analysis computes of them, and the other charts."""
    figures, others = list(curves), []
    for chart in charts:
        own = [number for number, figure in enumerate(figures) if set(chart.violations) & set(figure.violations)]
        if own and figures[own[0]].computed is None:
            figures[own[0]] = replace(figures[own[0]], computed=chart)
        else:
            others.append(chart)
    return [*figures, *others]


def run_reference(scenario: Mapping[str, str]) -> str:
    """Return what `twin run` takes for a scenario: the name of a shipped one, or its path."""
    path = Path(scenario.get("path") or scenario["name"])
    return path.stem if scenario_paths.is_shipped(path) else shlex.quote(str(path))


def compare_command(scenario: Mapping[str, str], folder: str, default_folder: str) -> str:
    """Return the command that compares a run with one of the scenario's own parameters, which it runs if there is none."""
    own = shlex.quote(folder)
    if default_folder:
        return f"twin compare {shlex.quote(default_folder)} {own}"
    root, latest = PurePath(folder).parent.parent, PurePath(folder).parent / "latest"
    runs = f" --runs {shlex.quote(str(root))}" * (root.name != "runs" or root.is_absolute())
    return f"twin run {run_reference(scenario)}{runs}; twin compare {shlex.quote(str(latest))} {own}"


def outcome_sentence(summary: Mapping[str, Any], changes: Sequence[Change], rows: Sequence[Mapping[str, Any]]) -> str:
    """Return what was changed and which requirements fail, for a run without a sentence of its scenario; empty if nothing is judged.

    `rows`: of the table of failures; the first one is told with its value.
    """
    judged = count_verdicts(summary)[1]
    if not judged or summary["status"] != "completed":
        return ""
    texts = [name + f" instead of {was.partition(' ')[2]}" * bool(was) for name, was in changes]
    outside = [result["name"] for result in summary["expectations"] if result.get("is_outside")]
    outcome = (
        failed_sentence(rows)
        if rows
        else f"all {judged}{' judged' * bool(outside)} requirements are met"
        + f"; {len(outside)} not judged lie{'s' * (len(outside) == 1)} outside of nominal limits: {list_names(outside)}"
        * bool(outside)
        + "."
    )
    outcome = f"With {', '.join(texts)}, {outcome}" if texts else outcome
    return outcome[:1].upper() + outcome[1:]


def failed_sentence(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return which requirements fail, and the value of the first one: `"safe" fails: 30 mN in PI (default run: 5 mN).`."""
    first = rows[0]
    names = list_names([row["failure"].name for row in rows])
    where = f" in {first['case']}" * bool(first["case"])
    before = f" (default run: {first['before']})" * bool(first["before"])
    return f"{names} {'fail; the first' if len(rows) > 1 else 'fails'}: {first['value']}{where}{before}."


def default_values(
    expectations: Sequence[Expectation], evaluation: Evaluation, default: Mapping[str, Any]
) -> dict[str, dict[str, str]]:
    """Return the metric of each failed requirement in the default run, by variant; of a signal its range, by an empty name.

    `default`: summary of that run; what it has no value of is left out.
    """
    formats, values = metric_formats(evaluation.metric_results), {}
    for outcome in default.get("expectations", ()):
        if text := outcome["detail"].partition(" was ")[2].partition("; expected")[0]:
            values[outcome["name"]] = {"": text}
    for expectation, result in zip(expectations, evaluation.expectation_results, strict=False):
        for own in evaluation.metric_results if result.verdict == "fail" else ():
            variants = default.get("metrics", {}).get(own.metric.name, {}).get("variants", {})
            is_mean = expectation.mean or expectation.ordered or not own.metric.has_worst
            before = variants.get(own.variant, {}).get("mean" if is_mean else "worst")
            if expectation.judges(own) and before is not None:
                factor, offset = si_conversion(own.metric.unit, own.metric.is_difference)
                text = formats[own.metric.name].text(before * factor + offset, own.scale)
                values[result.name] = values.get(result.name, {}) | {own.variant: text}
    return values


def failure_rows(
    failures: Iterable[tuple[ExpectationResult, str]],
    defaults: Mapping[str, Mapping[str, str]],
    variants: Sequence[str],
) -> list[dict[str, Any]]:
    """Return the rows of the table of failures: limit, value in the default run and in this one, and the worst case."""
    rows = []
    for failure, target in failures:
        head, _, limit = failure.detail.partition("; ")[0].rstrip(".").partition(", expected ")
        variant, seed, value, time = failure.cases[0] if failure.cases else ("", "", head, "")
        case = f"{variant}, seed {seed}" if failure.cases else ""
        if not case and (name := head.rpartition(" in ")[2].strip('"')) in variants:  # a mean, of an order
            variant, case, value = name, name, head.rpartition(" in ")[0]
        own = defaults.get(failure.name, {})
        before = own.get(variant) or "; ".join(f"{name} {text}".strip() for name, text in own.items())
        rows.append(
            {
                "failure": failure,
                "target": target,
                "limit": limit,
                "before": before,
                "value": value,
                "case": case,
                "time": time,
            }
        )
    return rows


def read_summary(folder: str) -> dict[str, Any]:
    """Return the summary of a run; empty without a folder."""
    return json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8")) if folder else {}


def page_scripts(
    figures: Sequence[ReportFigure], films: Sequence[Mapping[str, Any]], arrays: PackedArrays
) -> dict[str, Any]:
    """Return the scripts and data of the curves and films of the page; no scripts if there are none."""
    panels = {
        f"plot-{number}": {"panels": figure.panels, "marks": figure.marks}
        for number, figure in enumerate(figures, 1)
        if figure.panels
    }
    has_script = bool(panels or films)
    return {
        "player_style": scene_page.player_style() + read_static("views.css") if films else "",
        "panels": embed_json(panels),
        "films": embed_json(films),
        "names": [film["name"] for film in films],
        "arrays": arrays.texts,
        "rule": RULE,
        "script": chart_script([*scene_page.PLAYER, HERE / "report.js"], views=True) if has_script else "",
    }
