"""The answer of a study in sentences: pass rates, what explains the metrics, the worst case, what did not finish."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from twin.results import common_format, list_names
from twin.study.answers.paired import INDEPENDENT_SAMPLES, MIN_SAMPLES
from twin.study.answers.statistics import (
    FAMILY_LEVEL,
    expectation_name,
    largest_p_value,
    left_out,
    varying_rates,
    worst_of_rate,
)
from twin.study.answers.summary import MAX_SENTENCES, percent
from twin.study.execution.case_table import CaseTable

if TYPE_CHECKING:
    from twin.study.answers.paired import PairedDifference
    from twin.study.answers.sensitivity import Effect, MetricSensitivity
    from twin.study.answers.statistics import LeftOut, PassRate
    from twin.study.answers.summary import Answers
    from twin.study.design import Study
    from twin.study.design.keys import TuneKeys
    from twin.study.execution.tuning import Tuned
    from twin.study.execution.worst_case_search import WorstCase

MAX_FACTORS = 2  # named as causes of a metric
MAX_MEANING = 100  # letters of a metric's description that fits into a sentence
MAX_INDEX = 1.1  # total Sobol index that errors of enough samples can still give
CAUSES = {
    "sobol": (
        "The largest share of the variance of {} comes from",
        "The largest shares of the variance of {} come from",
    ),
    "morris": ("{} changes most with",) * 2,
}


@dataclass(frozen=True)
class Sentence:
    """A sentence, the number of the case that it names as `case 713`, and what it is about, in one or two words."""

    text: str
    case: int | None = None
    topic: str = ""


def headline(answers: Answers, worst: WorstCase | None = None, tuned: Tuned | None = None) -> list[Sentence]:
    """Return the sentences, the most important first. `worst`, `tuned`: results of searches."""
    topics = {
        "So far" if answers.is_partial else "Pass rate": [*pass_sentences(answers), *few_sentences(answers)],
        "Left out": cut_sentences(answers.left_out),
        "Worst case": [] if worst is None else [worst_sentence(answers, worst)],
        "Tuning": [] if tuned is None else [tuning_sentence(answers, tuned)],
        "Comparison": pair_sentences(answers),
        "What goes with it": [*cause_sentences(answers), *change_sentences(answers)],
        "Not finished": failure_sentences(answers),
    }
    return [replace(sentence, topic=topic) for topic, sentences in topics.items() for sentence in sentences]


def pass_sentences(answers: Answers) -> list[Sentence]:
    """Return the lowest pass rates with their intervals and worst cases, or that every case passes."""
    missed = sorted((rate for rate in answers.shares if rate.part < 1.0), key=lambda rate: rate.part)
    if not answers.shares:
        return []
    if not missed:
        names = len({rate.name for rate in answers.shares})
        if answers.is_partial:  # the cases that are missing may fail
            of = f"{len(answers.cases.rows)} of {answers.study.total} cases"
            return [Sentence(f"No requirement fails in the {of} that are done.")]
        count = max(rate.count for rate in answers.shares)
        requirements = "the requirement holds" if names == 1 else f"all {names} requirements hold"
        rates = varying_rates(answers.cases, answers.shares)
        worst = max(filter(None, (worst_case(answers, rate) for rate in rates)), default=None)
        closest = f"; closest to its limit: case {worst.number}, {worst.text}" if worst else ""
        unit = sample_word(answers)
        where = f"each of {count} {unit}" if count > 1 else f"the only {unit[:-1]}"
        text = f"{requirements.capitalize()} in {where}{closest}."
        return [Sentence(text, worst.number if worst else None)]
    is_sampled, sentences = answers.study.design.method not in ("one_at_a_time", "grid"), list[Sentence]()
    for rate in missed[:MAX_SENTENCES]:
        is_order = rate.variant not in answers.study.variants
        variant = f" {'for' if is_order else 'with'} {rate.variant}" if len(answers.study.variants) > 1 else ""
        share = percent(rate.part)
        if interval := answers.interval(rate):
            share += f"; {percent(answers.study.keys.confidence)} confidence interval {interval}"
        elif is_sampled and not sentences:
            share += "; no confidence interval, the cases are not independent samples"
        unit = "samples" if is_order else sample_word(answers)
        text = f"{rate.met_count} of {rate.count} {unit} ({share}) pass {rate.name!r}{variant}"
        worst = worst_case(answers, rate)
        if worst and worst.number in rate.failing:
            of = f" of {answers.study.count}" if worst.number > rate.count else ""
            sentences.append(Sentence(f"{text}; the worst is case {worst.number}{of}, {worst.text}.", worst.number))
        else:  # an order of variants, or only cases that did not finish
            sentences.append(Sentence(f"{text}; one that fails is case {rate.failing[0]}.", rate.failing[0]))
    return sentences


def sample_word(answers: Answers) -> str:
    """Return what a pass rate of a variant counts: samples, or cases where each sample has several seeds."""
    return "cases" if len(answers.study.seeds(1)) > 1 else "samples"


class WorstInLimit(NamedTuple):
    """The case of a variant nearest to a limit, or farthest beyond it; `excess`: as of LimitExcess."""

    excess: float
    number: int
    text: str


def worst_case(answers: Answers, rate: PassRate) -> WorstInLimit | None:
    """Return the worst case of an expectation with a limit; None for other expectations."""
    expectations = enumerate(answers.study.scenario.expectations)
    own = next(each for k, each in expectations if expectation_name(each, k) == rate.name)
    if (worst := worst_of_rate(answers.cases, rate)) is None:
        return None
    what = own.metric or (own.signal.text if own.signal else "")
    value, limit = (
        answers.metric(what, number) if what in answers.formats else own.shown(number)
        for number in (worst.value, worst.limit)
    )
    named = meaning(answers, what) if what in answers.study.scenario.metrics else what
    text = f"where {named} is {value}, expected {worst.word} {limit}"
    return WorstInLimit(worst.excess, worst.number, text)


def few_sentences(answers: Answers) -> list[Sentence]:
    """Return that a random design has too few samples for any statement beyond them."""
    study = answers.study
    count = study.keys.samples.count if study.design.method == "sensitivity" else answers.sample_count
    if study.design.method not in (*INDEPENDENT_SAMPLES, "sensitivity") or count >= MIN_SAMPLES:
        return []
    samples = "1 sample supports" if count == 1 else f"{count} samples support"
    advice = f"take at least {MIN_SAMPLES}"
    if answers.is_partial and study.keys.samples.count >= MIN_SAMPLES:
        advice = f"these follow after {MIN_SAMPLES}"
    base = "base " * (study.design.method == "sensitivity")
    text = f"{samples.replace('sample', f'{base}sample')} no statement about other cases or about causes: {advice}."
    return [Sentence(text)]


def unreached_windows(study: Study) -> list[str]:
    """Return which metrics and expectations the cases of a study are too short for, before it runs."""
    return [sentence.text for sentence in cut_sentences(left_out(CaseTable(study, [], [])))]


def cut_sentences(entries: list[LeftOut]) -> list[Sentence]:
    """Return which metrics have no value and which expectations are not judged, with the reason."""
    phrases = {"metric": ("has no value", "have no value"), "expectation": ("is not judged", "are not judged")}
    names: dict[str, dict[str, list[str]]] = {}
    for entry in entries:
        variants = f" with {list_names(entry.variants)}" if entry.variants else ""
        names.setdefault(entry.why, {}).setdefault(entry.kind, []).append(f"{entry.name}{variants}")
    return [
        sentence(
            " and ".join(f"{list_names(own)} {phrases[kind][len(own) > 1]}" for kind, own in kinds.items())
            + f": {why}."
        )
        for why, kinds in names.items()
    ]


def worst_sentence(answers: Answers, worst: WorstCase) -> Sentence:
    """Return what the search for the worst case found, with the factors' values."""
    value = answers.metric(worst.metric, worst.value) if math.isfinite(worst.value) else "no value, the case failed"
    inputs = zip(answers.study.factors, worst.values, strict=True)
    factors = ", ".join(f"{factor.name} {factor.shown(number)}" for factor, number in inputs)
    random_case = answers.metric(worst.metric, worst.sampled)
    return Sentence(
        f"A search in {worst.evaluations} cases found the worst {worst.metric} with {worst.variant} in case {worst.number}: "
        f"{value} ({factors}); worst of the random samples: {random_case}{worst.remark}.",
        worst.number,
    )


def tuning_sentence(answers: Answers, tuned: Tuned) -> Sentence:
    """Return what the tuning chose, and its objective on samples that it did not see."""
    study, keys = answers.study, answers.study.keys.tune
    if tuned.best is None or keys is None:
        return Sentence(f"None of {len(tuned.trials)} trials of the tuning meets the limits.")
    knobs = zip(study.knobs, tuned.best.knobs, strict=True)
    values = ", ".join(f"{knob.factor.name} {knob.factor.shown(value)}" for knob, value in knobs)
    own, best = (answers.metric(keys.metric, trial.objective) for trial in tuned.unseen)
    return Sentence(
        f"The tuning chose {values}: {objective_name(keys)} on unseen samples {best}, with the scenario's values {own}."
    )


def objective_name(keys: TuneKeys) -> str:
    """Return `95 % quantile of force_error_std`."""
    return f"{f'{percent(keys.quantile)} quantile' if keys.of == 'quantile' else keys.of} of {keys.metric}"


def pair_sentences(answers: Answers) -> list[Sentence]:
    """Return the paired comparisons that the scenario expects an order of; without any, those of the first metric."""
    pairs = [pair for pair in answers.pairs if pair.is_expected] or [
        pair for pair in answers.pairs if pair.metric == answers.pairs[0].metric
    ]
    return [sentence(pair_text(answers, pair)) for pair in pairs[:MAX_SENTENCES]]


def meaning(answers: Answers, metric: str) -> str:
    """Return what a metric is, as a noun phrase: its description where that is a short phrase, else its name."""
    text = answers.study.scenario.metrics[metric].description.strip()
    is_phrase = 0 < len(text) <= MAX_MEANING and text[0].isalpha() and not set(";:(.") & set(text)
    return f"the {text}{',' * (',' in text)}" if is_phrase and not text.startswith("the ") else metric


def sentence(text: str, number: int | None = None) -> Sentence:
    """Return a sentence with a capital letter, unless it begins with the name of a variable."""
    word = text.split(" ", 1)[0]
    return Sentence(text if set("._[") & set(word) else text[0].upper() + text[1:], number)


def pair_text(answers: Answers, pair: PairedDifference) -> str:
    """Return `the force error is lower with B than with A in 93 of 100 samples, mean difference -4.1 mN (...).`"""
    side, number = ("lower", pair.lower) if pair.lower >= pair.higher else ("higher", pair.higher)
    mean, interval = answers.difference(pair)
    what = meaning(answers, pair.metric)
    if not pair.lower and not pair.higher:
        return f"{what} is the same with {pair.second} and {pair.first} in all {pair.count} samples."
    level = percent(answers.study.keys.confidence)
    return (
        f"{what} is {side} with {pair.second} than with {pair.first} in {number} of {pair.count} samples, "
        f"mean difference {mean}{f' ({level} confidence interval {interval})' if interval else ''}"
        f"{': it may be zero' if pair.low <= 0.0 <= pair.high else ''}."
    )


def cause_sentences(answers: Answers) -> list[Sentence]:
    """Return the factors that explain a judged metric, of those whose effect survives Holm's method; missed ones first."""
    tested = tested_drivers(answers)
    if not tested or few_sentences(answers):
        return []
    largest = largest_p_value(effect.p_value for driver in tested for effect in driver.effects)
    sentences, unexplained, followers = list[Sentence](), list[Sentence](), dict[tuple[str, str], list[str]]()
    missed = missed_metrics(answers)
    separated = {cluster.variant for cluster in answers.clusters if cluster.factors}
    for driver in tested:
        variant = f" with {driver.variant}" if len(answers.study.variants) > 1 else ""
        what = f"{meaning(answers, driver.metric)}{variant}"
        effects = [effect for effect in driver.effects if effect.p_value <= largest][:MAX_FACTORS]
        if effects and driver.kind == "rank":
            for effect in effects:
                verb = "rise" if effect.first > 0.0 else "fall"
                where = (
                    f"when {effect.factor} is far from its median" if effect.is_from_median else f"with {effect.factor}"
                )
                followers.setdefault((verb, where), []).append(f"{what} ({effect_text(answers, driver, effect)})")
        elif effects:
            start = CAUSES[driver.kind][len(effects) > 1].format(what)
            names = " and ".join(f"{effect.label} ({effect_text(answers, driver, effect)})" for effect in effects)
            sentences.append(sentence(f"{start} {names}."))
        elif (driver.metric, driver.variant) in missed and driver.variant not in separated:
            unexplained.append(sentence(f"{what} fails in some cases; no factor's effect on it differs from chance."))
    repeated = f"rank correlation |{percent(answers.study.keys.confidence)} confidence interval "
    for (verb, where), (first, *others) in followers.items():
        *before, last = [first, *(re.sub(repeated, "", name) for name in others[: MAX_SENTENCES - 1])]
        names = f"{', '.join(before)} and {last}" if before else last
        sentences.append(sentence(f"{names} {verb}{'s' * (not others)} {where}."))
    if not sentences:
        return [
            Sentence(f"No effect of a factor on a judged metric differs from chance in {answers.sample_count} samples.")
        ]
    return [*unexplained[:1], *sentences[: MAX_SENTENCES - len(unexplained[:1])], *unsure_sentences(answers, tested)]


def unsure_sentences(answers: Answers, tested: list[MetricSensitivity]) -> list[Sentence]:
    """Return that total Sobol indices clearly above 1, which no true index is, come from too few samples."""
    if not any(effect.total > MAX_INDEX for driver in tested if driver.kind == "sobol" for effect in driver.effects):
        return []
    count = answers.study.keys.samples.count
    return [
        Sentence(
            f"No true Sobol index is above 1: {count} base samples are too few for exact ones. Raise samples: count."
        )
    ]


def missed_metrics(answers: Answers) -> set[tuple[str | None, str]]:
    """Return metric and variant of each expectation that some cases miss."""
    metrics = {expectation_name(each, k): each.metric for k, each in enumerate(answers.study.scenario.expectations)}
    return {(metrics[rate.name], rate.variant) for rate in answers.shares if rate.part < 1.0}


def tested_drivers(answers: Answers) -> list[MetricSensitivity]:
    """Return the sensitivities of the judged metrics, missed ones first."""
    judged, missed, metrics = judged_metrics(answers), missed_metrics(answers), answers.study.scenario.metrics
    own = (
        driver
        for driver in answers.drivers
        if driver.metric in judged
        and (metrics[driver.metric].has_worst or (driver.metric, driver.variant) in missed)  # no estimate of a factor
    )
    return sorted(own, key=lambda driver: judged.index(driver.metric))


def holm_note(answers: Answers) -> str:
    """Return how the headline decides on causes, for the page; "" where it ranks none."""
    tested = tested_drivers(answers)
    count = sum(len(driver.effects) for driver in tested)
    if not tested or few_sentences(answers):
        return ""
    return f"Sentences at the top and the table of failures name a factor only where Holm's method at {percent(FAMILY_LEVEL)} excludes chance for all {count} pairs of a factor and a judged metric together. The {percent(answers.study.keys.confidence)} confidence intervals hold for each bar by itself."


def effect_text(answers: Answers, driver: MetricSensitivity, effect: Effect) -> str:
    """Return the size of an effect: `rank correlation -0.62, 95 % confidence interval -0.90 to -0.10`."""
    level = percent(answers.study.keys.confidence)
    if driver.kind == "morris":
        own = common_format([effect.first, *effect.first_interval], answers.formats[driver.metric].unit, True)
        low, high = map(own.number, effect.first_interval)
        return f"mean effect {own.text(effect.first)}, {level} confidence interval {low} to {high}"
    name, key = ("total Sobol index", "total") if driver.kind == "sobol" else ("rank correlation", "first")
    low, high = map(index_text, getattr(effect, f"{key}_interval"))
    return f"{name} {index_text(getattr(effect, key))}, {level} confidence interval {low} to {high}"


def index_text(value: float) -> str:
    """Return a correlation or an index with two decimals: 0.99 where it would become 1.00 although it is not 1."""
    return f"{value if abs(value) >= 1.0 else max(-0.99, min(value, 0.99)):.2f}"


def judged_metrics(answers: Answers) -> list[str]:
    """Return the metrics of expectations, those with the lowest pass rates first; all metrics if none is judged."""
    rates = {rate.name: rate.part for rate in sorted(answers.shares, key=lambda rate: -rate.part)}  # the lowest remains
    judged = [each for each in answers.study.scenario.expectations if each.metric in answers.study.metrics]
    judged.sort(key=lambda each: rates.get(each.name, 1.0))
    return list(dict.fromkeys(each.metric for each in judged if each.metric)) or list(answers.study.metrics)


def change_sentences(answers: Answers) -> list[Sentence]:
    """Return the largest change of each metric where one factor is changed at a time."""
    sentences = []
    for metric in dict.fromkeys(change.metric for change in answers.changes):
        changes = [change for change in answers.changes if change.metric == metric]
        finite = [change for change in changes if math.isfinite(change.now) and math.isfinite(change.before)]
        if finite:
            largest = max(finite, key=lambda change: abs(change.now - change.before))
            before, now = (answers.metric(metric, value) for value in (largest.before, largest.now))
            variant = f" with {largest.variant}" if len(answers.study.variants) > 1 else ""
            factor = f"{largest.factor} {answers.factor_value(largest.factor, largest.value)}"
            text = f"{meaning(answers, metric)}{variant} changes most with {factor}, from {before} to {now} (case {largest.number})."
            sentences.append(sentence(text, largest.number))
    return sentences[:MAX_SENTENCES]


def failure_sentences(answers: Answers) -> list[Sentence]:
    """Return how many cases did not finish."""
    failed = answers.failed
    return [Sentence(f"{failed} case{'s' * (failed > 1)} did not finish.")] if failed else []


def lowest_pass_rate(answers: Answers) -> tuple[str, str]:
    """Return class and text of the badge."""
    if not answers.shares:
        return ("warn", f"{answers.failed} did not finish") if answers.failed else ("pass", "completed")
    lowest = min(rate.part for rate in answers.shares)
    if lowest == 1.0 and not answers.failed:
        count = sum(entry.kind == "expectation" for entry in answers.left_out)
        return "pass", "✓ every case passes" + (f", {count} requirement{'s' * (count > 1)} not judged" if count else "")
    names, below = ({rate.name for rate in answers.shares if rate.part < bound} for bound in (2.0, 1.0))
    always = f"{len(names - below)} of {len(names)} requirements hold in every case, " * (names > below > set())
    return "fail" if below else "warn", f"{always}lowest pass rate {percent(lowest)}"
