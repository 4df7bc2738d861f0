"""What a study tells: intervals that are known, causes that are put in, pages that stand alone.

Over 400 lines: one study with known causes serves all tests.
"""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from tests.every_case import every_case
from tests.study.patients import SCENARIO, STUDY, study_file
from twin.cli import group
from twin.cli.check import check_file, notes
from twin.results import Expectation
from twin.study import Answers, headline, load_study, percent, unreached_windows
from twin.study.answers import plots, sensitivity, tables
from twin.study.answers.page import linked
from twin.study.answers.paired import mean_interval
from twin.study.answers.sentences import effect_text, lowest_pass_rate
from twin.study.answers.statistics import above, in_order, quantile, wilson
from twin.study.answers.summary import noteworthy
from twin.study.execution.case_engine import Row
from twin.study.execution.case_table import CaseTable


@pytest.mark.parametrize(
    ("held", "count", "low", "high"),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (998, 1000, 0.9927, 0.99945), (10, 10, 0.7225, 1.0)],
)
def test_intervals_of_wilson(held, count, low, high):
    """Against scipy's, and figures of Brown, Cai and DasGupta's formula."""
    own = wilson(held, count, 0.95)
    other = stats.binomtest(held, count).proportion_ci(0.95, method="wilson")
    assert own == pytest.approx((other.low, other.high), abs=1e-12)
    assert own == pytest.approx((low, high), abs=1e-4)


@pytest.mark.slow
def test_intervals_of_rank_correlations_hold_as_often_as_they_say():
    """Of a normal distribution Spearman's correlation is 6/pi asin(r/2). Kruskal, JASA 53, 1958."""
    generator, inside = np.random.default_rng(1), []
    truth = 6 / np.pi * np.arcsin(0.7 / 2)
    for _ in range(300):
        values, other = generator.standard_normal((2, 60))
        effect = sensitivity.rank_correlation("gain", values, 0.7 * values + np.sqrt(1 - 0.7**2) * other)
        inside.append(effect.first_interval[0] < truth < effect.first_interval[1])
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


@pytest.mark.slow
def test_intervals_of_quantiles_hold_as_often_as_they_say():
    generator = np.random.default_rng(1)
    truth = float(stats.norm.ppf(0.9))
    inside = 0
    for _ in range(400):
        found = quantile(generator.standard_normal(200), 0.9, 0.9)
        inside += found.low <= truth <= found.high
    assert 0.88 <= inside / 400 <= 0.97  # order statistics: at least what is asked for


def test_an_end_that_nobody_can_know_is_open():
    assert np.isnan(quantile(np.arange(20.0), 0.99, 0.95).high)


def made(tmp_path, method, count, value):
    """A study whose metric is a function of the parts of its factors."""
    text = STUDY.replace("{method: latin_hypercube, count: 6, seed: 3}", f"{{method: {method}, count: {count}}}")
    study = load_study(study_file(tmp_path, text.replace("keep:", "variants: [plain]\nkeep:")))
    requests = list(study.requests())
    rows = [
        Row(one.number, "done", "", (float(value(parts)), 0.0), (bool(value(parts) < 3.0), None))
        for one, parts in zip(requests, study.design.parts, strict=True)
    ]
    return CaseTable(study, requests, rows)


@pytest.mark.slow
def test_sobol_indices_of_a_sum_are_its_variances(tmp_path):
    cases = made(tmp_path, "sensitivity", 512, lambda u: 3.0 * u[0] + 1.0 * u[1])
    (found,) = sensitivity.drivers(cases)
    effects = {one.factor: one for one in found.effects}
    assert found.effects[0].factor == "heart.rate"
    assert effects["heart.rate"].first == pytest.approx(0.9, abs=0.03)
    assert effects["heart.scale"].total == pytest.approx(0.1, abs=0.03)
    assert effects["bent end"].total == pytest.approx(0.0, abs=0.01)


def test_morris_finds_the_slopes(tmp_path):
    cases = made(tmp_path, "morris", 10, lambda u: 3.0 * u[0] + 1.0 * u[1])
    (found,) = sensitivity.drivers(cases)
    effects = {one.factor: one.first for one in found.effects}
    assert effects == pytest.approx({"heart.rate": 3.0, "heart.scale": 1.0, "bent end": 0.0}, abs=1e-6)


@every_case("method", ["latin_hypercube", "morris", "sensitivity"])
def test_intervals_of_effects_have_the_confidence_of_the_study(tmp_path, monkeypatch, method):
    count = 20 if method == "latin_hypercube" else 16
    cases = made(tmp_path, method, count, lambda u: u[0] + 3.0 * u[0] * u[1] + u[1] ** 2)
    (wide,) = sensitivity.drivers(cases)
    monkeypatch.setattr(cases.study.keys, "confidence", 0.5)
    (narrow,) = sensitivity.drivers(cases)
    for name in ("heart.rate", "heart.scale"):
        first, second = (next(one for one in found.effects if one.factor == name) for found in (wide, narrow))
        assert np.ptp(second.first_interval) < 0.5 * np.ptp(first.first_interval)
        assert second.first == first.first
        assert second.p_value == pytest.approx(first.p_value)
    effect = narrow.effects[0]
    assert "50 % confidence interval" in effect_text(Answers(cases), narrow, effect)


@every_case(("method", "count"), [("sensitivity", 16), ("morris", 10)])
def test_cases_that_are_no_independent_samples_have_no_interval(tmp_path, method, count):
    answers = Answers(made(tmp_path, method, count, lambda u: 4.0 * u[0]))
    assert 0.0 < answers.shares[0].part < 1.0
    assert answers.interval(answers.shares[0]) == ""
    assert (
        " %; no confidence interval, the cases are not independent samples) pass 'gentle'" in headline(answers)[0].text
    )


def test_sobol_indices_of_few_samples_support_no_statement(tmp_path):
    answers = Answers(made(tmp_path, "sensitivity", 8, lambda u: 4.0 * u[0]))
    sentences = [sentence.text for sentence in headline(answers)]
    assert sentences[1:] == ["8 base samples support no statement about other cases or about causes: take at least 10."]


def test_a_missed_metric_without_a_cause_is_said(tmp_path):
    """Of `plain` some cases fail by chance; the force of `soft` grows with the heart's rate."""
    generator = np.random.default_rng(4)
    plain = generator.permutation(np.tile([0.07, 0.1], 10))
    answers = paired(tmp_path, plain, plain, holds=lambda force: force < 0.09)
    rates = [answers.cases.values[i, 0] for i in answers.cases.where("sample", "soft")]
    rows = [
        replace(row, metrics=(0.01 * rates[request.sample - 1], 0.0), holds=(True, None))
        if request.variant == "soft"
        else row
        for request, row in zip(answers.cases.requests, answers.cases.rows, strict=True)
    ]
    answers = Answers(CaseTable(answers.study, answers.cases.requests, rows))
    causes = [sentence.text for sentence in headline(answers) if sentence.topic == "What goes with it"]
    assert causes == [
        "force_max with plain fails in some cases; no factor's effect on it differs from chance.",
        "force_max with soft (rank correlation 1.00, 95 % confidence interval 0.99 to 1.00) rises with heart.rate.",
    ]


def test_failures_are_told_apart_by_what_makes_them(tmp_path):
    cases = made(tmp_path, "latin_hypercube", 200, lambda u: 3.0 * u[0] + 1.0 * u[1])
    answers = Answers(cases)
    (cluster,) = answers.clusters
    assert cluster.what == "gentle"
    assert cluster.factors[0].factor == "heart.rate"
    assert cluster.factors[0].inside > cluster.factors[0].outside
    share = answers.shares[0]
    assert share.low < share.part < share.high < 1.0
    assert len(share.failing) == len(cluster.cases)


def test_a_case_without_an_end_holds_nothing(tmp_path):
    cases = made(tmp_path, "latin_hypercube", 20, lambda u: u[0])
    rows = [replace_row(one) if one.number == 7 else one for one in cases.rows]
    answers = Answers(CaseTable(cases.study, cases.requests, rows))
    assert answers.failed == 1
    assert answers.shares[0].failing == (7,)
    assert answers.spreads[0].without == 1
    assert "lost # times" in answers.clusters[0].what


def replace_row(row):
    return replace(row, status="failed", why="lost 2 times, last: gone", metrics=(), holds=())


def test_the_headline_answers_in_words(tmp_path):
    cases = made(tmp_path, "latin_hypercube", 200, lambda u: 3.0 * u[0] + 1.0 * u[1])
    answers = Answers(cases)
    first, second, third = headline(answers)
    forces = cases.metric("force_max")
    number = cases.requests[int(np.argmax(forces))].number
    assert re.fullmatch(
        rf"\d+ of 200 samples \(\S+ %; 95 % confidence interval \S+ % to \S+ %\) pass 'gentle'; "
        rf"the worst is case {number}, where force_max is {1e3 * forces.max():.0f} mN, expected at most 90 mN\.",
        first.text,
    )
    assert first.case == number
    figures = r"rank correlation 0\.\d\d, 95 % confidence interval 0\.\d\d to 0\.\d\d"
    assert re.fullmatch(rf"force_max \({figures}\) rises with heart\.rate\.", second.text)
    assert re.fullmatch(rf"force_max \({figures}\) rises with heart\.scale\.", third.text)
    few = headline(Answers(made(tmp_path, "latin_hypercube", 8, lambda u: u[0])))
    begun = CaseTable(cases.study, cases.requests[:8], cases.rows[:8])  # of 20, then interrupted
    assert [sentence.text for sentence in headline(Answers(begun))[1:]] == [
        "8 samples support no statement about other cases or about causes: these follow after 10."
    ]
    assert headline(Answers(begun))[0].topic == "So far"
    single = headline(Answers(made(tmp_path, "latin_hypercube", 1, lambda u: 0.0 * u[0])))
    assert single[0].text.startswith("The requirement holds in the only sample")
    assert [sentence.text for sentence in few[1:]] == [
        "8 samples support no statement about other cases or about causes: take at least 10."
    ]
    assert [sentence.topic for sentence in headline(answers)] == ["Pass rate", *["What goes with it"] * 2]
    assert lowest_pass_rate(answers) == ("fail", f"lowest pass rate {percent(answers.shares[0].part)}")
    assert linked(first, lambda case: f"<a>{case}</a>").endswith(
        f"is case <a>{number}</a>, where force_max is {1e3 * forces.max():.0f} mN, expected at most 90 mN."
    )


def test_the_headline_names_one_change_and_what_did_not_finish(tmp_path):
    cases = made(tmp_path, "latin_hypercube", 20, lambda u: u[0])
    closest = cases.requests[int(np.argmax(cases.metric("force_max")))].number
    first = headline(Answers(cases))[0]
    assert first.text.startswith(
        f"The requirement holds in each of 20 samples; closest to its limit: case {closest}, where "
    )
    assert first.case == closest
    assert lowest_pass_rate(Answers(cases)) == ("pass", "✓ every case passes")
    rows = [replace_row(one) if one.number == 7 else one for one in cases.rows]
    texts = [one.text for one in headline(Answers(CaseTable(cases.study, cases.requests, rows)))]
    assert texts[0] == (
        "19 of 20 samples (95 %; 95 % confidence interval 76.4 % to 99.1 %) pass 'gentle'; one that fails is case 7."
    )
    assert texts[-1] == "1 case did not finish."


def test_pass_rates_of_several_variants_count_samples(tmp_path):
    """Six samples with two variants are twelve cases: `5 of 6 cases ... the worst is case 12` would name none of the six."""
    limit = "  - {name: weak, metric: force_max, at_most: 90 mN, variants: [soft]}\n"
    study = load_study(study_file(tmp_path, STUDY, SCENARIO + limit))
    requests = list(study.requests())
    last = max(one.number for one in requests if one.variant == "soft")
    rows = [
        Row(one.number, "done", "", (0.1 if one.number == last else 0.01, 0.01), (True, None, one.number != last))
        for one in requests
    ]
    texts = [sentence.text for sentence in headline(Answers(CaseTable(study, requests, rows)))]
    (weak,) = [text for text in texts if "pass 'weak'" in text]
    assert weak.startswith("5 of 6 samples (83.3 %")
    assert f"the worst is case {last} of {len(requests)}, where force_max is 100" in weak


def test_a_flag_at_its_limit_in_every_case_is_not_the_closest(tmp_path):
    """The margin counts as a part of the width of the limits; one that never varies counts nothing."""
    limits = (
        "  - {name: flag, signal: heart.position, at_most: 0 mm}\n"
        "  - {name: range, signal: sensor.measured_force, at_least: 0.1 N, at_most: 0.4 N}\n"
    )
    study = load_study(study_file(tmp_path, STUDY.replace("\nkeep:", "\nvariants: [plain]\nkeep:"), SCENARIO + limits))
    requests = list(study.requests())
    rows = [
        Row(
            request.number,
            "done",
            "",
            (0.01, 0.01),
            (True, None, True, True),
            extremes=(None, None, (0.0, 0.0), (0.2, high)),
        )
        for request, high in zip(requests, (0.3, 0.31, 0.39, 0.3, 0.2, 0.3), strict=True)
    ]
    cases = CaseTable(study, requests, rows)
    first = headline(Answers(cases))[0]
    assert first.text.endswith(
        "closest to its limit: case 3, where sensor.measured_force is 0.39 N, expected at most 0.4 N."
    )
    assert cases.margins(3) == pytest.approx([0.1, 0.09, 0.01, 0.1, 0.1, 0.1])
    still = [replace(row, extremes=rows[0].extremes) for row in rows]
    sentence = headline(Answers(CaseTable(study, requests, still)))[0]
    assert (sentence.text, sentence.case) == ("All 3 requirements hold in each of 6 samples.", None)


def test_the_worst_case_of_a_limit_on_a_signal_is_named(tmp_path):
    """By the samples that the case stored, whatever the order of the cases is."""
    limit = "  - {name: never more, signal: sensor.measured_force, at_most: 80 mN}\n"
    path = study_file(tmp_path, STUDY.replace("\nkeep:", "\nvariants: [plain]\nkeep:"), SCENARIO + limit)
    study = load_study(path)
    requests = list(study.requests())
    rows = [
        Row(one.number, "done", "", (0.05, 0.01), (True, None, high <= 0.08), extremes=(None, None, (0.0, high)))
        for one, high in zip(requests, (0.07, 0.081, 0.095, 0.05, 0.084, 0.06), strict=True)
    ]
    cases = CaseTable(study, requests, rows)
    first = headline(Answers(cases))[0]
    assert first.case == requests[2].number
    assert first.text.endswith("is case 3, where sensor.measured_force is 95 mN, expected at most 80 mN.")
    kept = [noteworthy(cases, SimpleNamespace(failed=count, worst=0)) for count in (10, 2, 1, 0)]
    assert kept == [[3, 2, 5], [3, 2], [3], []]  # the worst of the kind, then the others that fail


def test_windows_that_cases_do_not_reach_are_noted_before_a_run(tmp_path):
    path = study_file(
        tmp_path, STUDY.replace("\nkeep:", "\nset: {stop_time: 0.7 s}\nkeep:"), SCENARIO.replace("from: 1 s", "to: 1 s")
    )
    (note,) = unreached_windows(load_study(path))
    assert note == "Motion has no value: the cases end at 700 ms, before the end of the window, 1 s."
    assert notes(str(path)) == [note]


def test_a_part_is_never_rounded_to_all_of_it():
    assert [percent(one) for one in (1.0, 0.9999, 0.999, 0.5, 0.0)] == ["100 %", "99.99 %", "99.9 %", "50 %", "0 %"]


@pytest.mark.slow
def test_pictures_mark_what_fails_and_what_was_expected(tmp_path):
    cases = made(tmp_path, "latin_hypercube", 100, lambda u: 3.0 * u[0] + 1.0 * u[1])
    svg = plots.histogram(cases, "force_max", "plain", "mN")
    assert plots.BAD in svg
    assert plots.limits_of(cases.study, "plain", "force_max") == pytest.approx([0.09])
    fine = [replace(one, holds=(True, *one.holds[1:])) for one in cases.rows]
    calm = plots.histogram(CaseTable(cases.study, cases.requests, fine), "force_max", "plain", "mN")
    assert calm != svg


def test_a_large_study_lists_the_cases_it_names_and_some_that_fail(tmp_path):
    cases = made(tmp_path, "latin_hypercube", 500, lambda u: 3.0 * u[0] + 1.0 * u[1])
    answers = Answers(cases)
    listed = tables.named(answers, 12, [77])
    assert len(answers.shares[0].failing) <= len(listed) <= tables.MOST
    assert {77, *answers.shares[0].failing[:12], answers.spreads[0].most[0]} <= set(listed)
    outcome = SimpleNamespace(runs={77: "cases/x"}, folder="runs/a b/1")
    told = tables.singles(outcome, answers, listed)
    assert sorted(row["number"] for row in told["rows"]) == listed
    is_bad = [bool(row["failed"]) for row in told["rows"]]
    assert is_bad == sorted(is_bad, reverse=True)  # failures first
    (kept,) = [row for row in told["rows"] if row["number"] == 77]
    assert kept["command"] == "twin view 'runs/a b/1:77'"
    assert [row["run"] for row in told["rows"] if row["run"]] == ["cases/x"]


@pytest.mark.slow
def test_the_command_runs_a_study_and_one_of_its_cases_again(tmp_path, build):
    path = study_file(tmp_path, STUDY.replace("keep: {", "keep: {failed: 1, "))
    runner, folders = CliRunner(), ["--runs", str(tmp_path / "runs"), "--build", str(build)]
    done = runner.invoke(group, ["study", str(path), "--workers", "2", *folders])
    assert done.exit_code == 0, done.output
    assert "force_max" in done.output
    assert "12 cases in " in done.output
    assert "Report: " in done.output
    link = tmp_path / "runs" / "patients" / "latest"
    (folder,) = (path for path in link.parent.iterdir() if path != link)
    assert link.resolve() == folder.resolve()
    told = json.loads((folder / "answers.json").read_text())
    assert told["cases"] == 12
    assert {one["name"] for one in told["expectations"]} == {"gentle", "softer is gentler"}
    page = (folder / "report.html").read_text()
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert page.count("<svg") >= 5
    failing = told["clusters"][0]["cases"]  # the worst first, which is kept
    assert told["sentences"][0]["case"] == failing[0]
    row = re.search(rf'<tr id="case-{failing[0]}" class="bad">.*?</tr>', page, re.DOTALL)[0]
    assert 'report.html">report</a>' in row  # that one was kept
    assert f'href="#case-{failing[0]}"' in page
    assert f"twin run --case {folder}:" in page
    sections = re.findall(r'<section id="(\w+)">', page)
    assert {"variants", "shares", "pairs", "spreads", "clusters", "pictures", "cases", "factors"} <= set(sections)
    assert all(f'href="#{name}"' in page for name in sections)
    again = runner.invoke(group, ["run", "--case", f"patients:{failing[0]}", "--no-report", *folders])
    assert again.exit_code == 1, again.output  # as it failed in the study
    assert "to the bit" in again.output
    both = runner.invoke(group, ["run", "--case", f"patients:{failing[0]}", "--seed", "3", *folders])
    assert (both.exit_code, "Drop --variant and --seed" in both.output) == (2, True)
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "completed"
    assert manifest["versions"]["scipy"]


@every_case(
    ("before", "after", "options", "expected"),
    [
        (2.0, 1.0, {}, True),
        (1.0, 1.0, {}, False),
        (1.0, 1.5, {}, False),
        (1.0, 1.5, {"descending": False}, True),
        (2.0, 1.5, {"margin": 0.5}, True),
        (2.0, 1.75, {"margin": 0.5}, False),
        (2.0, 1.0, {"margin_part": 0.5}, True),
        (2.0, 1.25, {"margin_part": 0.5}, False),
        (float("nan"), 1.0, {}, False),
    ],
)
def test_an_order_holds_strictly_or_by_at_least_its_margin(before, after, options, expected):
    assert above(Expectation("", metric="m", ordered=("a", "b"), **options), before, after) is expected


def test_in_how_many_samples_an_order_of_variants_holds():
    """Only samples with a value of every variant count; one without a number is not in order."""
    values = {(1, "soft"): 1.0, (1, "stiff"): 2.0, (2, "soft"): 3.0, (2, "stiff"): 2.0, (3, "soft"): 1.0}
    values |= {(4, "soft"): 1.0, (4, "stiff"): np.nan, (5, "soft"): 1.0, (5, "stiff"): 3.0}
    requests = [
        SimpleNamespace(sample=sample, seed=1, variant=variant, number=10 * sample + (variant == "stiff"))
        for sample, variant in values
    ]
    cases = SimpleNamespace(
        study=SimpleNamespace(scenario=SimpleNamespace(metrics={"peak": SimpleNamespace(name="peak")})),
        metric=lambda _: np.array(list(values.values())),
        where=lambda *_: range(len(values)),
        requests=requests,
    )
    order = Expectation("", metric="peak", ordered=("stiff", "soft"))
    assert in_order(cases, order) == (2, (21, 41), 4)


def paired(tmp_path, first, second, method="latin_hypercube", holds=lambda _: True):
    """The answers of a study in which these are `force_max` [N] of `plain` and `soft`, sample by sample."""
    text = STUDY.replace("{method: latin_hypercube, count: 6, seed: 3}", f"{{method: {method}, count: {len(first)}}}")
    study = load_study(study_file(tmp_path, text))
    requests = list(study.requests())
    values = dict(zip(study.variants, (first, second), strict=True))
    rows = [
        Row(request.number, "done", "", (force, 0.0), (holds(force), None))
        for request in requests
        for force in [float(values[request.variant][request.sample - 1])]
    ]
    return Answers(CaseTable(study, requests, rows))


def test_variants_are_compared_over_the_same_samples(tmp_path):
    """The spread from sample to sample, 0.1 N, does not hide a difference of 5 mN."""
    generator = np.random.default_rng(2)
    first = 0.3 + 0.1 * generator.standard_normal(60)
    second = first - 0.005 + 0.004 * generator.standard_normal(60)
    second[4] = np.nan
    answers = paired(tmp_path, first, second)
    (pair,) = [pair for pair in answers.pairs if pair.metric == "force_max"]
    delta = np.delete(second - first, 4)
    assert (pair.first, pair.second, pair.count, pair.without) == (*answers.study.variants, 59, 1)
    assert (pair.lower, pair.higher) == (int(np.sum(delta < 0)), int(np.sum(delta > 0)))
    assert pair.mean == pytest.approx(delta.mean())
    half = 2.0 * delta.std(ddof=1) / np.sqrt(59)
    assert (pair.low, pair.high) == pytest.approx((delta.mean() - half, delta.mean() + half), abs=0.2 * half)
    texts = [sentence.text for sentence in headline(answers)]
    pattern = rf"force_max is lower with soft than with plain in {pair.lower} of 59 samples, mean difference -\S+ mN \(95 % confidence interval -\S+ to -\S+\)\."
    assert any(re.fullmatch(pattern, text) for text in texts), texts


def test_a_mean_difference_that_may_be_none_is_said(tmp_path):
    second = 0.3 + 0.01 * np.tile([1.0, -1.0], 10)
    text = headline(paired(tmp_path, np.full(20, 0.3), second))[1].text
    assert text.endswith(
        "in 10 of 20 samples, mean difference 0 mN (95 % confidence interval -4 to 4): it may be zero."
    )


def test_few_samples_and_equal_ones_are_said(tmp_path):
    few = paired(tmp_path, [0.1, 0.2, 0.3], [0.2, 0.3, 0.3])
    assert (
        headline(few)[2].text
        == "force_max is higher with soft than with plain in 2 of 3 samples, mean difference 66.7 mN."
    )
    same = paired(tmp_path, [0.1] * 12, [0.1] * 12)
    assert headline(same)[1].text == "force_max is the same with soft and plain in all 12 samples."


def test_an_interval_needs_ten_random_samples(tmp_path):
    values = np.linspace(0.1, 0.2, 10)
    for count, method, is_given in ((9, "random", False), (10, "random", True), (10, "latin_hypercube", True)):
        pair = paired(tmp_path, values[:count], 2.0 * values[:count], method).pairs[0]
        assert np.isfinite([pair.low, pair.high]).all() == is_given
        assert pair.mean == pytest.approx(values[:count].mean())


@every_case(("variants", "compared"), [("", True), ("variants: [plain], ", False), ("variants: [soft, plain], ", True)])
def test_a_metric_is_compared_between_its_own_variants(tmp_path, variants, compared):
    scenario = SCENARIO.replace("motion: {", f"motion: {{{variants}")
    study = load_study(study_file(tmp_path, STUDY.replace("count: 6", "count: 2"), scenario))
    rows = [Row(request.number, "done", "", (0.1, 0.2), (True, None)) for request in study.requests()]
    pairs = Answers(CaseTable(study, list(study.requests()), rows)).pairs
    expected = [("plain", "soft")] if compared else []
    assert [(pair.first, pair.second) for pair in pairs if pair.metric == "motion"] == expected


@pytest.mark.slow
def test_intervals_of_a_mean_difference_hold_as_often_as_they_say():
    generator, study = (
        np.random.default_rng(1),
        SimpleNamespace(
            design=SimpleNamespace(method="random"),
            keys=SimpleNamespace(confidence=0.9, samples=SimpleNamespace(seed=1)),
        ),
    )
    inside = 0
    for _ in range(300):
        low, high = mean_interval(generator.exponential(1.0, 60) - 1.0, study)
        inside += low <= 0.0 <= high
    assert inside / 300 == pytest.approx(0.9, abs=0.04)
    low, high = mean_interval(generator.exponential(1.0, 4000), study)
    assert high - low == pytest.approx(2 * 1.645 / np.sqrt(4000), rel=0.1)


@pytest.mark.slow
def test_a_study_is_checked_and_its_time_estimated(tmp_path, build):
    """All mistakes at once, with lines; nothing is written."""
    wrong = STUDY.replace("heart.rate", "heart.rat").replace("[0.5, 1.5]", "[1.5, 0.5]") + "metrics: [forc_max]\n"
    path = study_file(tmp_path, wrong)
    problems, _ = check_file(str(path))
    assert [problem.partition(": ")[0].rpartition(":")[2] for problem in problems] == ["5", "6", "9"]
    assert "Did you mean `rate`?" in problems[0].replace("'", "`")
    assert "there is no metric `forc_max`. Did you mean `force_max`?" in problems[2]
    path.write_text(STUDY)
    assert check_file(str(path)) == ([], "12 cases (6 samples x 2 variants); 3 factors, latin hypercube")
    words = ["study", str(path), "--check", "--workers", "2", "--build", str(build), "--runs", str(tmp_path / "runs")]
    done = CliRunner().invoke(group, words)
    assert done.exit_code == 0, done.output
    assert re.search(r"^ *plain +6 +\S+ s$", done.output, re.MULTILINE), done.output
    assert re.search(
        r"^In all \S+ (s|min) with 2 processes: .* to begin, .* for the cases, .* for the report\.",
        done.output,
        re.MULTILINE,
    )
    assert "Seeds of the noise come from the file's name: a copy not named patients.yaml has others" in done.output
    assert not (tmp_path / "runs").exists()
