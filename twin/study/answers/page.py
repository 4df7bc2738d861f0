"""report.html and answers.json of a study: one file each, nothing is loaded."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from html import escape as html_escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from twin.results import write_text
from twin.study.answers import clusters, plots, tables
from twin.study.answers.paired import MIN_SAMPLES
from twin.study.answers.sentences import (
    Sentence,
    few_sentences,
    headline,
    holm_note,
    judged_metrics,
    lowest_pass_rate,
    objective_name,
    worst_sentence,
)
from twin.study.answers.summary import Answers, cleaned, percent
from twin.study.design import SAMPLED
from twin.study.execution import case_table, manifest
from twin.web import report_templates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from twin.study.execution.study_runner import StudyOutcome

PAGE, ANSWERS = "report.html", "answers.json"
CLICK = "Click it for what the case fails, and the command that opens the case."
EXAMPLES = 12  # numbers of cases that are named
MAX_SCATTERS = 3  # factors over which a metric is drawn
TITLES = {
    "variants": "Variants",
    "shares": "Pass rates",
    "pairs": "Paired comparison",
    "spreads": "Distributions",
    "clusters": "Failures",
    "worst": "Worst case",
    "tuned": "Tuning",
    "tornados": "One at a time",
    "drivers": "Sensitivity",
    "pictures": "Plots",
    "cases": "Cases",
    "factors": "Factors",
    "versions": "Versions",
}
EFFECT_NOTES = {
    "sobol": "Sobol index: share of the metric's variance that a factor explains, alone (first order) or with its interactions "
    "(total). Indices below 0 or above 1 come from too few samples.",
    "morris": "Mean absolute effect: by how much the metric changes, on average, over the whole range of a factor.",
    "rank": "Rank correlation (Spearman): 1 where the metric always grows with the factor, -1 where it always falls, 0 for no trend. "
    "`distance from median`: the metric follows how far the factor is from its median, to either side, more than its value: "
    "1 where it rises when the factor is far from its median.",
}


class Plot(NamedTuple):
    """A plot with its title and a note; a wide one has a row of its own."""

    title: str
    note: str
    svg: str
    is_wide: bool = False


class PlotSet(NamedTuple):
    """All plots of a page with the time at which they were drawn; without any: those of a page that is written in a moment."""

    time: str = ""
    pictures: Mapping[str, Sequence[Plot]] = {}
    tornados: Sequence[tuple[str, str]] = ()
    drivers: Mapping[str, Sequence[tuple[Any, str]]] = {}


def write_report(outcome: StudyOutcome, plot_set: PlotSet | None = None) -> PlotSet:
    """Write the answers of a study, with its plots as they are now or as given."""
    answers = Answers(outcome.cases)
    sentences = [cleaned(vars(own)) for own in headline(answers, outcome.worst, outcome.tuned)]
    summary = {"sentences": sentences, **answers.plain(), **searched(outcome)}
    write_text(outcome.folder / ANSWERS, json.dumps(summary, indent=1, allow_nan=False) + "\n")
    plot_set = draw_plots(outcome, answers) if plot_set is None else plot_set
    outcome.take_time()
    write_text(outcome.folder / PAGE, html(outcome, answers, plot_set))
    return plot_set


def draw_plots(outcome: StudyOutcome, answers: Answers) -> PlotSet:
    """Draw all plots, which takes most of the time of a page."""
    drivers = (
        (driver.metric, driver, plots.effects(driver, answers.formats[driver.metric].unit))
        for driver in judged_first(answers, answers.drivers)
    )
    return PlotSet(now(), pictures(outcome, answers), tornados(answers), together(drivers))


def now() -> str:
    """Return the time of day, `08:03:04`."""
    return datetime.now(UTC).astimezone().strftime("%H:%M:%S")


def searched(outcome: StudyOutcome) -> dict[str, Any]:
    """What searches found, as plain data."""
    sections: dict[str, Any] = {}
    if outcome.worst is not None:
        sections["worst"] = cleaned(vars(outcome.worst))
    if outcome.tuned is not None:
        own = outcome.tuned
        sections["tuned"] = cleaned(
            {
                "best": None if own.best is None else vars(own.best),
                "own": vars(own.trials[0]),
                "unseen": [vars(trial) for trial in own.unseen],
                "trials": [vars(trial) for trial in own.trials],
            }
        )
    return sections


def html(outcome: StudyOutcome, answers: Answers, plot_set: PlotSet) -> str:
    """The page as text."""
    environment = report_templates("twin.study")
    study = outcome.study
    search_results = [] if outcome.worst is None else [outcome.worst.number]
    listed = tables.named(answers, EXAMPLES, [*outcome.runs, *search_results])
    metrics = {name: each.unit for name, each in answers.formats.items()}
    sentences = headline(answers, outcome.worst, outcome.tuned)
    named = [sentence.case for sentence in sentences if sentence.case is not None]
    cases_to_open = dict.fromkeys([*named[:1], *search_results])  # the worst of the samples, and of the search
    entries = manifest.read(outcome.folder)
    text: str = environment.get_template("study.html").render(
        outcome=outcome,
        study=study,
        answers=answers,
        headline=[(sentence.topic, linked(sentence, link(set(listed)))) for sentence in sentences],
        opened=[(n, tables.open_command(str(outcome.folder), n, outcome.runs)) for n in cases_to_open],
        worst=linked(worst_sentence(answers, outcome.worst), link(set(listed))) if outcome.worst else "",
        badge=lowest_pass_rate(answers),
        holm_note=holm_note(answers),
        few="".join(sentence.text for sentence in few_sentences(answers)),
        percent=percent,
        part_names=answers.part_names,
        parts=[percent(quantile) for quantile in study.keys.quantiles],
        link=link(set(listed)),
        examples=EXAMPLES,
        least=MIN_SAMPLES,
        searched=len(outcome.cases.rows) - len(outcome.cases.where(SAMPLED)),
        fewest=clusters.FEWEST,
        effect_notes=EFFECT_NOTES,
        metrics=metrics,
        factors=tables.factors(outcome),
        tuned=tuned(outcome, answers),
        pictures=plot_set.pictures,
        drawn=plot_set.time,
        as_of=now(),
        total=study.total,
        resume=entries["command"] + " --resume" * ("--resume" not in entries["command"]),
        told=entries,
        tornados=plot_set.tornados,
        titles=TITLES,
        variants=tables.variants(answers),
        cases=tables.singles(outcome, answers, listed),
        drivers=plot_set.drivers,
    )
    return text


def together(items: Iterable[tuple[str, Any, str]]) -> dict[str, list[tuple[Any, str]]]:
    """What belongs to each name, in order."""
    groups: dict[str, list[tuple[Any, str]]] = {}
    for name, entry, svg in items:
        groups.setdefault(name, []).append((entry, svg))
    return groups


def link(listed: set[int]) -> Any:
    """How a case is named: with a link to its row in the list."""

    def named(number: int) -> str:
        return f'<a href="#case-{number}">{number}</a>' if number in listed else str(number)

    return named


def linked(sentence: Sentence, named: Callable[[int], str]) -> str:
    """Return a sentence as HTML, with a link to its case."""
    text, number = html_escape(sentence.text), sentence.case
    return text if number is None else text.replace(f"case {number}", f"case {named(number)}")


def pictures(outcome: StudyOutcome, answers: Answers) -> dict[str, list[Plot]]:
    """Plots by group: signals over time, then each metric."""
    study, cases = outcome.study, outcome.cases
    figures: dict[str, list[Plot]] = {}

    def unit(metric: str) -> str:
        return answers.formats[metric].unit

    def add(group: str, *plot: Any) -> None:
        figures.setdefault(group, []).append(Plot(*plot))

    for index, name in enumerate(study.bands):
        if (outcome.folder / case_table.BANDS).exists():
            note = "Line: median; areas: middle 50 % and 90 % of the cases, smallest to largest"
            if any(plots.expected(study, variant, name, np.zeros(1)) for variant in study.variants):
                note += "; dashed: limit; red: beyond it"
            note += ". Both are taken at each instant: where rates or phases differ, no case looks like the median"
            for variant in study.variants:
                if svg := plots.bands(outcome.folder, cases, name, variant, index):
                    add("Over time", f"{variant}, {name} over time", f"{note}.", svg)
    if study.design.method != "one_at_a_time":
        note = f"Dotted: quantiles {', '.join(answers.part_names)}; dashed: limit; red: cases in which anything fails."
        for metric in dict.fromkeys(spread.metric for spread in first_of(answers)):
            for variant in study.variants:
                if svg := plots.histogram(cases, metric, variant, unit(metric)):
                    add(metric, f"{variant}, distribution", note, svg)
    if study.design.method not in ("one_at_a_time", "grid") and study.factors:
        for spread in first_of(answers)[:2]:
            metric = spread.metric
            variants = [item.variant for item in answers.spreads if item.metric == metric]
            for variant in variants:
                for k in strongest(answers, metric, variant):
                    note = f"A point or a line is a case. {CLICK}"
                    svg = plots.scatter(cases, metric, variant, k, unit(metric))
                    add(metric, f"{variant}, over {study.factors[k].name}", note, svg)
            for variant in variants:
                add(
                    metric,
                    f"{variant}, over all factors",
                    note,
                    plots.parallel(cases, metric, variant, unit(metric)),
                    True,
                )
    return figures


def strongest(answers: Answers, metric: str, variant: str) -> list[int]:
    """Return the numbers of the factors that drive a metric most, the strongest first; the first ones if that is not known."""
    effects = {
        effect.factor: abs(effect.total if driver.kind == "sobol" else effect.first)
        for driver in answers.drivers
        if (driver.metric, driver.variant) == (metric, variant)
        for effect in driver.effects
    }
    sizes = np.nan_to_num([effects.get(factor.name, 0.0) for factor in answers.study.factors])
    return [int(k) for k in np.argsort(-sizes, kind="stable")[:MAX_SCATTERS]]


def first_of(answers: Answers) -> list[Any]:
    """One spread of each metric, those of judged metrics first."""
    return judged_first(answers, list({spread.metric: spread for spread in answers.spreads}.values()))


def judged_first(answers: Answers, entries: Sequence[Any]) -> list[Any]:
    """Return what has a `metric`: first the metrics of expectations, of these the lowest pass rates first."""
    judged = judged_metrics(answers)
    ranks = {name: rank for rank, name in enumerate(judged)}
    return sorted(entries, key=lambda entry: ranks.get(entry.metric, len(judged)))


def tornados(answers: Answers) -> list[tuple[str, str]]:
    """Plots of one factor at a time."""
    figures = []
    for name in dict.fromkeys(change.metric for change in answers.changes):
        own = [change for change in answers.changes if change.metric == name]
        unit = answers.formats[name].unit
        figures.append((name, plots.tornado(own, unit, name, [answers.change(change) for change in own])))
    return figures


def tuned(outcome: StudyOutcome, answers: Answers) -> dict[str, Any] | None:
    """What the tuning found."""
    own, keys = outcome.tuned, outcome.study.keys.tune
    if own is None or keys is None:
        return None
    metric, title = outcome.study.scenario.metrics[keys.metric], objective_name(keys)
    rows = []
    names = [("as in the scenario", own.trials[0]), ("best", own.best)]
    names += [
        (f"{name}, unseen samples", entry)
        for name, entry in zip(("as in the scenario", "best"), own.unseen, strict=False)
    ]
    for name, entry in names:
        if entry is None:
            continue
        knobs = [k.factor.shown(value) for k, value in zip(outcome.study.knobs, entry.knobs, strict=True)]
        limits = (
            "kept"
            if entry.is_feasible
            else "broken: "
            + ", ".join(limit.text for limit, over in zip(outcome.study.limits, entry.broken, strict=True) if over > 0)
        )
        value = answers.metric(keys.metric, entry.objective)
        rows.append({"name": name, "knobs": knobs, "objective": value, "limits": limits})
    return {
        "title": title,
        "knobs": [k.factor.name for k in outcome.study.knobs],
        "rows": rows,
        "trials": len(own.trials),
        "way": plots.tuning_history(own, answers.formats[keys.metric].unit, title, metric.is_difference),
        "limits": [limit.text for limit in outcome.study.limits],
    }
