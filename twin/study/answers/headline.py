"""The answer of a study in sentences: pass rates, what explains the metrics, the worst case, what did not finish."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin.results import common_format
from twin.study.answers.paired import MIN_SAMPLES
from twin.study.answers.summary import percent

if TYPE_CHECKING:
    from twin.study.answers.paired import PairedDifference
    from twin.study.answers.sensitivity import Effect, MetricSensitivity
    from twin.study.answers.summary import Answers

MAX_SENTENCES = 3  # of a kind
MAX_FACTORS = 2  # named as causes of a metric
FAMILY_LEVEL = 0.05  # probability that any of the named causes is none
MAX_MEANING = 80  # letters of a metric's description that fits into a sentence
VERBS = {"sobol": "explain most of", "morris": "change most", "rank": "correlate most with"}


@dataclass(frozen=True)
class Sentence:
    """A sentence, and the number of the case that it names as `case 713`."""

    text: str
    case: int | None = None


def headline(answers: Answers) -> list[Sentence]:
    """Return the sentences, the most important first."""
    return [
        *pass_sentences(answers),
        *pair_sentences(answers),
        *cause_sentences(answers),
        *change_sentences(answers),
        *failure_sentences(answers),
    ]


def pass_sentences(answers: Answers) -> list[Sentence]:
    """Return the lowest pass rates with their intervals, or that every case passes."""
    missed = sorted((rate for rate in answers.shares if rate.part < 1.0), key=lambda rate: rate.part)
    if not answers.shares:
        return []
    if not missed:
        names = len({rate.name for rate in answers.shares})
        count = max(rate.count for rate in answers.shares)
        expectations = "the expectation" if names == 1 else f"all {names} expectations"
        return [Sentence(f"{expectations.capitalize()} hold{'s' * (names == 1)} in each of {count} cases.")]
    sentences = []
    for rate in missed[:MAX_SENTENCES]:
        interval = answers.interval(rate).replace(" to ", ", ").replace(" %", "")
        bounds = f" [{interval}]" if interval else ""
        variant = f" ({rate.variant})" if len(answers.study.variants) > 1 else ""
        text = f"{percent(rate.part)}{bounds} of the cases pass {rate.name!r}{variant}"
        number = rate.failing[0] if rate.failing else None
        sentences.append(Sentence(f"{text}; one that fails is case {number}." if rate.failing else f"{text}.", number))
    return sentences


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
    """Return `the force error is lower with B than with A in 93 of 100 samples, mean difference -4.1 mN [-5.0, -3.2].`"""
    side, number = ("lower", pair.lower) if pair.lower >= pair.higher else ("higher", pair.higher)
    mean, interval = answers.difference(pair)
    what = meaning(answers, pair.metric)
    if not pair.lower and not pair.higher:
        return f"{what} is the same with {pair.second} and {pair.first} in all {pair.count} samples."
    return (
        f"{what} is {side} with {pair.second} than with {pair.first} in {number} of {pair.count} samples, "
        f"mean difference {mean}{f' {interval}' if interval else ''}{', which may be none' if pair.low <= 0.0 <= pair.high else ''}."
    )


def cause_sentences(answers: Answers) -> list[Sentence]:
    """Return the factors that explain a judged metric, of those whose effect survives Holm's method; missed ones first."""
    tested = tested_drivers(answers)
    if not tested:
        return []
    count = len(answers.study.design.values)
    if tested[0].kind == "rank" and count < MIN_SAMPLES:
        return [Sentence(f"{count} samples are too few to rank the factors.")]
    largest, sentences = largest_p_value(tested), []
    for driver in tested:
        effects = [effect for effect in driver.effects if effect.p_value <= largest][:MAX_FACTORS]
        if effects:
            verb = VERBS[driver.kind] if len(effects) > 1 else VERBS[driver.kind].replace(" most", "s most", 1)
            variant = f" with {driver.variant}" if len(answers.study.variants) > 1 else ""
            names = " and ".join(f"{effect.factor} ({effect_text(answers, driver, effect)})" for effect in effects)
            sentences.append(sentence(f"{names} {verb} {meaning(answers, driver.metric)}{variant}."))
    if not sentences:
        return [Sentence(f"No effect of a factor on a judged metric differs from chance in {count} samples.")]
    return sentences[:MAX_SENTENCES]


def tested_drivers(answers: Answers) -> list[MetricSensitivity]:
    """Return the sensitivities of the judged metrics, missed ones first."""
    judged = judged_metrics(answers)
    own = (driver for driver in answers.drivers if driver.metric in judged)
    return sorted(own, key=lambda driver: judged.index(driver.metric))


def largest_p_value(drivers: list[MetricSensitivity], level: float = FAMILY_LEVEL) -> float:
    """Return the largest p value that Holm's method (Scand. J. Stat. 6, 1979) accepts as an effect; -1 if none."""
    p_values = sorted(effect.p_value for driver in drivers for effect in driver.effects if effect.p_value >= 0.0)
    accepted, count = -1.0, len(p_values)
    for rank, value in enumerate(p_values):
        if value > level / (count - rank):
            break
        accepted = value
    return accepted


def holm_note(answers: Answers) -> str:
    """Return how the headline decides on causes, for the page; "" where it ranks none."""
    tested = tested_drivers(answers)
    count = sum(len(driver.effects) for driver in tested)
    if not tested or (tested[0].kind == "rank" and len(answers.study.design.values) < MIN_SAMPLES):
        return ""
    return (
        f"Sentences on factors: Holm's method at {percent(FAMILY_LEVEL)} over {count} tests, each factor on each judged metric "
        "of each variant. Intervals: 95 %, each by itself."
    )


def effect_text(answers: Answers, driver: MetricSensitivity, effect: Effect) -> str:
    """Return the size of an effect with its interval: `rho = -0.62 [-0.90, -0.10]`."""
    if driver.kind == "morris":
        own = common_format([effect.first, *effect.first_interval], answers.study.metrics[driver.metric].unit, True)
        low, high = map(own.number, effect.first_interval)
        return f"mean effect {own.text(effect.first)} [{low}, {high}]"
    name, key = ("total index", "total") if driver.kind == "sobol" else ("rho", "first")
    low, high = getattr(effect, f"{key}_interval")
    return f"{name} = {getattr(effect, key):.2f} [{low:.2f}, {high:.2f}]"


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
            text = f"{answers.change(largest)} changes {meaning(answers, metric)} most, from {before} to {now} (case {largest.number})."
            sentences.append(Sentence(text, largest.number))
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
        return "pass", "✓ every case passes"
    return "warn", f"lowest pass rate {percent(lowest)}"
