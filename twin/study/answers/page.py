"""report.html and answers.json of a study: one file each, nothing is loaded."""

from __future__ import annotations

import json
from html import escape as html_escape
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.results import format_value, si_conversion, write_text
from twin.study.answers import plots, tables
from twin.study.answers.headline import Sentence, headline, holm_note, lowest_pass_rate
from twin.study.answers.paired import MIN_SAMPLES
from twin.study.answers.summary import Answers, cleaned, percent
from twin.study.execution import case_table, manifest
from twin.web import report_templates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from twin.study.execution.study_runner import StudyOutcome

PAGE, ANSWERS = "report.html", "answers.json"
EXAMPLES = 12  # numbers of cases that are named
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


def write_report(outcome: StudyOutcome) -> None:
    """Write the answers of a study; nothing where no case was done."""
    if not outcome.cases.rows:
        return
    answers = Answers(outcome.cases)
    summary = {**answers.plain(), **searched(outcome)}
    write_text(outcome.folder / ANSWERS, json.dumps(summary, indent=1, allow_nan=False) + "\n")
    write_text(outcome.folder / PAGE, html(outcome, answers))


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


def html(outcome: StudyOutcome, answers: Answers) -> str:
    """The page as text."""
    environment = report_templates("twin.study")
    study = outcome.study
    searched = [] if outcome.worst is None else [outcome.worst.number]
    listed = tables.named(answers, EXAMPLES, [*outcome.runs, *searched])
    metrics = {name: each.unit for name, each in answers.formats.items()}
    text: str = environment.get_template("study.html").render(
        outcome=outcome,
        study=study,
        answers=answers,
        headline=[linked(sentence, link(set(listed))) for sentence in headline(answers)],
        badge=lowest_pass_rate(answers),
        holm_note=holm_note(answers),
        percent=percent,
        parts=[percent(quantile) for quantile in study.keys.quantiles],
        link=link(set(listed)),
        examples=EXAMPLES,
        least=MIN_SAMPLES,
        metrics=metrics,
        factors=factors(outcome),
        worst=worst(outcome, answers),
        tuned=tuned(outcome, answers),
        pictures=pictures(outcome, answers),
        told=manifest.read(outcome.folder),
        tornados=tornados(answers),
        titles=TITLES,
        variants=tables.variants(answers),
        cases=tables.singles(answers, listed, outcome.runs),
        drivers=together(
            (driver.metric, driver, plots.effects(driver, metrics[driver.metric])) for driver in answers.drivers
        ),
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


def factors(outcome: StudyOutcome) -> list[dict[str, str]]:
    """What varies, as the table shows it."""
    values = outcome.cases.values
    rows = []
    for k, factor in enumerate(outcome.study.all_factors):
        own = values[np.isfinite(values[:, k]), k]
        span = f"{factor.shown(own.min())} to {factor.shown(own.max())}" if len(own) else "-"
        kind = factor.distribution.kind.replace("_", "-")
        numbers = ", ".join(factor.shown(x) for x in factor.distribution.numbers[:8])
        if kind == "normal":  # a deviation is a difference: of 26.85 degC one of 2 K is no -271.1 degC
            mean, deviation = factor.distribution.numbers
            width = deviation * si_conversion(factor.unit, is_difference=True)[0]
            shown_width = format_value(width, factor.display_unit or factor.unit, is_difference=True)
            numbers = f"{factor.shown(mean)}, {shown_width}"
        if kind == "log-normal":
            numbers = f"median {factor.shown(factor.distribution.numbers[0])}, geometric deviation {factor.distribution.numbers[1]:g}"
        targets = ", ".join(factor.sets) or f"{', '.join(factor.scales)} (multiplied)"
        targets += f" at {clock.text(factor.at_ns)}" if factor.at_ns is not None else ""
        rows.append(
            {
                "name": factor.name,
                "targets": targets,
                "kind": f"{kind}: {numbers}",
                "span": span,
                "source": factor.source,
            }
        )
    return rows


def pictures(outcome: StudyOutcome, answers: Answers) -> dict[str, list[tuple[str, str, str]]]:
    """Titles, notes and plots by group: signals over time, then each metric."""
    study, cases = outcome.study, outcome.cases
    figures: dict[str, list[tuple[str, str, str]]] = {}

    def unit(metric: str) -> str:
        return answers.formats[metric].unit

    def add(group: str, *figure: str) -> None:
        title, note, svg = figure
        figures.setdefault(group, []).append((title, note, svg))

    for index, name in enumerate(study.bands):
        if (outcome.folder / case_table.BANDS).exists():
            note = "median, quarters, 5 to 95 %, ends; red: beyond what is expected"
            add("Over time", f"{name} over time", note, plots.bands(outcome.folder, cases, name, index))
    if study.design.method != "one_at_a_time":
        note = f"dotted: {', '.join(map(percent, study.keys.quantiles))}; red: cases in which anything fails"
        for spread in first_of(answers):
            add(spread.metric, "Distribution", note, plots.histograms(cases, spread.metric, unit(spread.metric)))
    if study.design.method not in ("one_at_a_time", "grid") and study.factors:
        for spread in first_of(answers)[:2]:
            for variant in study.variants:
                if any(item.metric == spread.metric and item.variant == variant for item in answers.spreads):
                    k = strongest(answers, spread.metric, variant)
                    title = f"{variant}, over {study.factors[k].name}"
                    note = "a case a point; red: something fails. Click: the case"
                    add(
                        spread.metric, title, note, plots.scatter(cases, spread.metric, variant, k, unit(spread.metric))
                    )
                    note = "a case a line; red: something fails. Click: the case"
                    add(
                        spread.metric,
                        f"{variant}, over all factors",
                        note,
                        plots.parallel(cases, spread.metric, variant, unit(spread.metric)),
                    )
    return figures


def strongest(answers: Answers, metric: str, variant: str) -> int:
    """Return the number of the factor that drives a metric most, the first one if that is not known."""
    effects = {
        effect.factor: abs(effect.total if driver.kind == "sobol" else effect.first)
        for driver in answers.drivers
        if (driver.metric, driver.variant) == (metric, variant)
        for effect in driver.effects
    }
    sizes = np.nan_to_num([effects.get(factor.name, 0.0) for factor in answers.study.factors])
    return int(np.argmax(sizes))


def first_of(answers: Answers) -> list[Any]:
    """One spread of each metric."""
    return list({spread.metric: spread for spread in answers.spreads}.values())


def tornados(answers: Answers) -> list[tuple[str, str]]:
    """Plots of one factor at a time."""
    figures = []
    for name in dict.fromkeys(change.metric for change in answers.changes):
        own = [change for change in answers.changes if change.metric == name]
        unit = answers.formats[name].unit
        figures.append((name, plots.tornado(own, unit, name, [answers.change(change) for change in own])))
    return figures


def worst(outcome: StudyOutcome, answers: Answers) -> dict[str, Any] | None:
    """What the search for the worst case found."""
    worst_case = outcome.worst
    if worst_case is None:
        return None
    own = zip(outcome.study.factors, worst_case.values, strict=True)
    return {
        "metric": worst_case.metric,
        "variant": worst_case.variant,
        "value": answers.metric(worst_case.metric, worst_case.value)
        if np.isfinite(worst_case.value)
        else "no value: the case failed",
        "sampled": answers.metric(worst_case.metric, worst_case.sampled),
        "remark": worst_case.remark,
        "number": worst_case.number,
        "evaluations": worst_case.evaluations,
        "values": [(factor.name, factor.shown(value)) for factor, value in own],
    }


def tuned(outcome: StudyOutcome, answers: Answers) -> dict[str, Any] | None:
    """What the tuning found."""
    own, keys = outcome.tuned, outcome.study.keys.tune
    if own is None or keys is None:
        return None
    metric = outcome.study.scenario.metrics[keys.metric]
    what = f"{percent(keys.quantile)} quantile" if keys.of == "quantile" else keys.of
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
        "title": f"{what} of {keys.metric}",
        "knobs": [k.factor.name for k in outcome.study.knobs],
        "rows": rows,
        "trials": len(own.trials),
        "way": plots.tuning_history(own, metric.unit, f"{what} of {keys.metric}", metric.is_difference),
        "limits": [limit.text for limit in outcome.study.limits],
    }
