"""Distributions of factors and of metrics by hand: ends, parts below a value, quantiles, pass rates, causes, clusters."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.every_case import every_case
from tests.study.patients import STUDY, study_file
from twin.study import Answers, load_study
from twin.study.answers import clusters, sensitivity, statistics, tables
from twin.study.answers.clusters import discriminating_factors
from twin.study.answers.sensitivity import Effect, by_size, metric_sensitivity, rank_correlation
from twin.study.answers.statistics import PassRate, Quantile, largest_p_value, quantile, wilson
from twin.study.design import Distribution
from twin.study.design.sampling import wrong_numbers
from twin.study.execution.case_engine import Row
from twin.study.execution.case_table import CaseTable

INF, NAN = np.inf, float("nan")


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [("uniform", (2.0, 6.0)), ("log_uniform", (0.1, 10.0)), ("normal", (1.0, 0.5)), ("log_normal", (3.0, 1.5))],
)
def test_the_part_below_a_quantile_is_its_part(kind, numbers):
    own = Distribution(kind, numbers)
    for part in (0.1, 0.5, 0.8):
        assert own.below(float(own.values(np.array(part)))) == pytest.approx(part)
    if kind.startswith("log"):
        assert own.below(0.0) == own.below(-1.0) == 0.0


@every_case(
    ("kind", "numbers", "low", "high", "span"),
    [
        ("uniform", (2.0, 6.0), -INF, INF, (0.0, 1.0)),
        ("uniform", (2.0, 6.0), 3.0, 5.0, (0.25, 0.75)),
        ("uniform", (2.0, 6.0), 1.0, 9.0, (0.0, 1.0)),
        ("log_uniform", (0.1, 10.0), 1.0, INF, (0.5, 1.0)),
        ("log_uniform", (0.1, 10.0), 0.0, 1.0, (0.0, 0.5)),
        ("normal", (1.0, 0.5), 1.0, 1.5, (0.5, stats.norm.cdf(1.0))),
        ("log_normal", (3.0, 2.0), -INF, 6.0, (0.0, stats.norm.cdf(1.0))),
    ],
)
def test_parts_of_a_distribution_that_is_cut(kind, numbers, low, high, span):
    own = Distribution(kind, numbers, low, high)
    assert own.span == pytest.approx(span)
    ends = own.values(np.array([1e-9, 1 - 1e-9]))
    assert all(low <= one <= high for one in ends)
    assert own.levels == ()


@every_case(
    ("kind", "numbers", "low", "high", "wrong"),
    [
        ("values", [], -INF, INF, "has no values. Give some."),
        ("values", [1.0], -INF, INF, ""),
        ("uniform", [1.0, 2.0], -INF, INF, ""),
        ("uniform", [2.0, 2.0], -INF, INF, "uniform from 2 mm to 2 mm is empty. Swap them."),
        ("log_uniform", [3.0, 2.0], -INF, INF, "log_uniform from 3 mm to 2 mm is empty. Swap them."),
        ("uniform", [-1.0, 2.0], -INF, INF, ""),
        ("log_uniform", [0.0, 2.0], -INF, INF, "log_uniform begins at 0 mm, which has no logarithm. Begin above zero."),
        ("log_uniform", [0.1, 2.0], -INF, INF, ""),
        ("normal", [3.0, 2.0], -INF, INF, ""),
        ("normal", [3.0, 0.0], -INF, INF, "standard deviation 0 mm is not above zero. Correct it."),
        ("log_normal", [3.0, 1.5], -INF, INF, ""),
        (
            "log_normal",
            [0.0, 1.5],
            -INF,
            INF,
            "log_normal needs a median above 0 and a geometric standard deviation above 1, not 0 mm, 1.5 mm.",
        ),
        (
            "log_normal",
            [3.0, 1.0],
            -INF,
            INF,
            "log_normal needs a median above 0 and a geometric standard deviation above 1, not 3 mm, 1 mm.",
        ),
        ("normal", [0.0, 1.0], 2.0, 2.0, "from 2 mm is not below to 2 mm. Swap them."),
        ("normal", [0.0, 1.0], 2.0, 3.0, ""),
        ("normal", [0.0, 1.0], 7.0, INF, "nothing of the distribution is between `from` and `to`. Widen them."),
        ("uniform", [1.0, 2.0], 2.0, 3.0, "nothing of the distribution is between `from` and `to`. Widen them."),
    ],
)
def test_numbers_of_a_distribution(kind, numbers, low, high, wrong):
    """In the units of the file."""
    texts = [f"{number:g} mm" for number in (*numbers, low, high)]
    assert wrong_numbers(kind, numbers, low, high, texts) == wrong


def test_a_quantile_lies_between_order_statistics():
    """Of ten values the number below the median is binomial: with 90 % it is 2 or 3 to 7 or 8."""
    values = np.array([7.0, 1.0, 9.0, 3.0, 5.0, 2.0, 8.0, 4.0, 10.0, 6.0])
    below = stats.binom(10, 0.5)
    first, last = int(below.ppf(0.05)), int(below.ppf(0.95))
    assert (first, last) == (2, 8)
    assert quantile(values, 0.5, 0.9) == Quantile(0.5, 5.5, 2.0, 9.0)  # the second and the ninth
    assert below.cdf(8) - below.cdf(1) >= 0.9
    assert quantile(values, 0.25, 0.5) == Quantile(0.25, 3.25, 2.0, 4.0)  # 2 to 3 of binomial(10, 1/4)
    low = quantile(values, 0.05, 0.9)
    assert (np.isnan(low.low), low.high) == (True, 3.0)
    high = quantile(values, 0.95, 0.9)
    assert (high.low, np.isnan(high.high)) == (8.0, True)
    nothing = quantile(np.zeros(0), 0.5, 0.9)
    assert nothing.part == 0.5
    assert np.isnan([nothing.value, nothing.low, nothing.high]).all()
    assert wilson(0, 0, 0.95) == (0.0, 1.0)


def table(tmp_path, forces, *, text=STUDY, variants="[plain, soft]", holds=lambda force: force <= 0.09):
    """Cases with these forces [N] in turn of the variants; None: failed."""
    study = load_study(study_file(tmp_path, text.replace("\nkeep:", f"\nvariants: {variants}\nkeep:")))
    requests = list(study.requests())[: len(forces)]
    rows = [
        Row(one.number, "failed", f"lost at {2 * k} s", (), ())
        if force is None
        else Row(one.number, "done", "", (force, NAN), (holds(force), None))
        for k, (one, force) in enumerate(zip(requests, forces, strict=True))
    ]
    return CaseTable(study, requests, rows)


def test_distributions_of_metrics_over_the_samples(tmp_path):
    """Plain cases are 1, 3, 5, ...; one of them failed, and no case has a value of the second metric."""
    cases = table(tmp_path, [0.04, 0.5, 0.02, 0.5, None, 0.5, 0.06, 0.5])
    plain, soft = statistics.metric_distributions(cases)
    assert (plain.metric, plain.variant, plain.count, plain.without) == ("force_max", "plain", 3, 1)
    assert plain.mean == pytest.approx(0.04)
    assert plain.deviation == pytest.approx(0.02)
    assert [one.part for one in plain.quantiles] == [0.05, 0.5, 0.95]
    assert plain.quantiles[1].value == pytest.approx(0.04)
    assert (plain.least, plain.most) == ((3, 0.02), (7, 0.06))
    assert (soft.variant, soft.count, soft.deviation, soft.least) == ("soft", 4, 0.0, (2, 0.5))
    (alone,) = statistics.metric_distributions(table(tmp_path, [0.04]))
    assert np.isnan(alone.deviation)
    assert statistics.failures(cases) == 1


def test_pass_rates_and_orders(tmp_path):
    """A case without an end passes nothing; the second expectation is an order: soft below plain in each sample."""
    cases = table(tmp_path, [0.04, 0.03, 0.1, 0.11, None, 0.01, 0.05, 0.05])
    plain, soft, order = statistics.shares(cases)
    assert plain == PassRate("gentle", "plain", 2, 4, *wilson(2, 4, 0.95), (3, 5))
    assert soft == PassRate("gentle", "soft", 3, 4, *wilson(3, 4, 0.95), (4,))
    assert plain.part == 0.5
    assert order == PassRate("softer is gentler", "plain, soft", 1, 4, *wilson(1, 4, 0.95), (3, 5, 7))
    assert np.isnan(PassRate("a", "b", 0, 0, 0.0, 1.0).part)


def test_rank_correlation_with_fishers_interval():
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    found = rank_correlation("rate", values, np.array([1.0, 3.0, 2.0, 5.0, 40.0]))
    assert found.first == pytest.approx(0.9)
    half = 1.96 * np.sqrt((1 + 0.405) / 2)
    assert found.first_interval == pytest.approx((np.tanh(1.47222 - half), np.tanh(1.47222 + half)), abs=1e-4)
    assert np.isnan([found.total, *found.total_interval]).all()
    assert rank_correlation("rate", -values, np.array([1.0, 3.0, 2.0, 5.0, 40.0])).first == pytest.approx(-0.9)
    constant = rank_correlation("rate", np.ones(5), values)
    assert (constant.first, np.isnan(constant.first_interval).all()) == (0.0, True)
    two = rank_correlation("rate", values[:2], values[:2])
    assert (two.first, two.first_interval) == (pytest.approx(1.0), (-1.0, 1.0))
    both_seeds = rank_correlation("rate", np.tile(values, 2), np.tile([1.0, 3.0, 2.0, 5.0, 40.0], 2), seeds=2)
    assert both_seeds.first_interval == pytest.approx(found.first_interval, abs=1e-9)


def test_intervals_of_eight_ranks_stay_within_one():
    generator, values = np.random.default_rng(3), np.arange(8.0)
    for output in [*generator.standard_normal((50, 8)), values, -values]:
        effect = rank_correlation("rate", values, output)
        low, high = effect.first_interval
        assert -1.0 <= low <= effect.first + 1e-12
        assert effect.first - 1e-12 <= high <= 1.0
        assert (effect.p_value < 0.05) == (low > 0.0 or high < 0.0)
    assert rank_correlation("rate", values, values).first_interval == (pytest.approx(0.81, abs=0.02), 1.0)


def test_a_metric_that_grows_to_both_sides_is_driven_by_the_distance_from_the_median():
    """Its rank correlation with the factor is almost zero; two tests halve the level."""
    values = np.linspace(-1.0, 1.2, 30)
    effect = sensitivity.stronger_correlation("friction", values, values**2, 0.95, 1)
    assert (effect.label, effect.is_from_median) == ("friction, distance from median", True)
    assert effect.first > 0.9
    assert effect.p_value < 1e-6
    assert np.isnan(sensitivity.stronger_correlation("friction", np.ones(30), values, 0.95, 1).p_value)  # no test
    slope = sensitivity.stronger_correlation("friction", values, values, 0.95, 1)
    assert (slope.label, slope.first) == ("friction", pytest.approx(1.0))
    assert slope.p_value == 2 * rank_correlation("friction", values, values).p_value


def test_holms_method_accepts_few_of_many_tests():
    assert largest_p_value([0.04]) == 0.04
    assert largest_p_value([0.04, 0.03]) == -1.0
    assert largest_p_value([0.01, 0.04]) == 0.04  # 0.025, then 0.05
    assert largest_p_value([0.01, 0.03, 0.2]) == 0.01
    assert largest_p_value([NAN]) == -1.0


def test_the_strongest_effect_comes_first():
    effects = [Effect("a", 0.1, total=0.2), Effect("b", -0.5), Effect("c", 0.9, total=0.3), Effect("d", 0.4)]
    assert [one.factor for one in by_size(effects)] == ["b", "d", "c", "a"]


@pytest.mark.parametrize(("count", "is_told"), [(8, True), (7, False)])
def test_what_drives_a_metric_is_told_from_eight_samples(tmp_path, count, is_told):
    text = STUDY.replace("count: 6", "count: 20")
    forces = [0.01 * k for k in range(count)]
    cases = table(tmp_path, forces, text=text, variants="[plain]")
    assert bool(sensitivity.drivers(cases)) is is_told
    study = cases.study
    inputs, output = cases.values[:, : len(study.factors)], np.array([*forces, NAN])
    found = metric_sensitivity(study, "force_max", "plain", np.vstack([inputs, inputs[:1]]), output)
    assert (found is not None) is is_told
    if found:
        assert (found.metric, found.variant, found.kind, found.note) == ("force_max", "plain", "rank", "")
        expected = {
            one.name: repr(sensitivity.stronger_correlation(one.name, inputs[:, k], output[:-1], 0.95, 1))
            for k, one in enumerate(study.factors)
        }
        assert {
            one.factor: repr(one) for one in found.effects
        } == expected  # NaN: equal objects only before Python 3.13
    assert metric_sensitivity(study, "force_max", "plain", inputs, np.full(count, 0.5)) is None  # the same everywhere


@pytest.mark.parametrize(("method", "kind"), [("sensitivity", "sobol"), ("morris", "morris")])
def test_a_scheme_has_to_be_complete(monkeypatch, method, kind):
    """Of five samples with two seeds each: means of the seeds; a missing value counts as the median of the others."""
    study = SimpleNamespace(
        design=SimpleNamespace(method=method, values=np.zeros((5, 2))), seeds=lambda _: (1, 2), factors=[]
    )
    seen = []
    monkeypatch.setattr(sensitivity, kind, lambda _study, output: seen.append(output.tolist()) or (kind, ("effect",)))
    values = np.array([1.0, 3.0, 5.0, 7.0, 2.0, 2.0, 4.0, 6.0, 0.0, 9.0])
    found = metric_sensitivity(study, "force", "plain", np.zeros((10, 2)), values)
    assert (found.kind, found.effects, found.note) == (kind, ("effect",), "")
    assert seen.pop() == [2.0, 6.0, 2.0, 5.0, 4.5]
    values[9] = NAN
    assert (
        metric_sensitivity(study, "force", "plain", np.zeros((10, 2)), values).note
        == "1 cases without a value count as the median."
    )
    assert seen.pop() == [2.0, 6.0, 2.0, 5.0, 1.5]  # 0 and the median of the nine, 3
    assert metric_sensitivity(study, "force", "plain", np.zeros((9, 2)), values[:9]) is None


def test_factors_by_which_cases_differ():
    """How often one of the cases is above one of the others, less a half; the largest difference first."""
    study = SimpleNamespace(factors=[SimpleNamespace(name=name) for name in "abc"])
    inside = list(range(5))
    columns = {
        "a": [1, 3, 5, 7, 9, 2, 4, 6, 8, 10],  # 10 of 25 pairs: -0.1
        "b": [6, 7, 8, 9, 10, 1, 2, 3, 4, 5],  # entirely above
        "c": [NAN, 7, 8, 9, 10, 1, 2, 3, 4, 5],
    }
    values = np.array(list(columns.values()), float).T
    found = discriminating_factors(study, values, inside, list(range(10)))
    assert [(one.factor, one.inside, one.outside) for one in found] == [("b", 8.0, 3.0), ("a", 5.0, 6.0)]
    assert [one.separation for one in found] == pytest.approx([0.5, -0.1])
    assert [one.p_value for one in found] == pytest.approx([4 / 252, 1.0], abs=0.01)  # 2 of 252 orders, two tests
    study.factors = [SimpleNamespace(name="u")]
    (both_ends,) = discriminating_factors(
        study, np.array([[1, 2, 3, 18, 19, 20, *range(4, 18)]], float).T, list(range(6)), list(range(20))
    )
    assert (both_ends.side, both_ends.separation) == ("far from its median", 0.5)
    assert both_ends.p_value < 0.01
    assert discriminating_factors(study, values, inside[:4], list(range(10))) == ()
    assert discriminating_factors(study, values, inside, list(range(9))) == ()


def test_failures_are_grouped_by_variant_and_kind(tmp_path):
    """Numbers in a message do not count; the largest group comes first, in it the case farthest beyond its limit."""
    found = clusters.clusters(table(tmp_path, [None, 0.2, 0.01, 0.3, None, 0.4]))
    assert [(one.variant, one.what, one.cases, one.of, one.example, one.factors) for one in found] == [
        ("soft", "gentle", (6, 4, 2), 3, "", ()),
        ("plain", "lost at # s", (1, 5), 3, "lost at 0 s", ()),
    ]


@pytest.mark.parametrize(
    ("most", "numbers"), [(2, [1, 2, 12]), (5, [1, 2, 12]), (8, [1, 2, 3, 4, 12]), (99, list(range(1, 13)))]
)
def test_of_a_large_study_the_named_cases_are_listed_and_some_that_fail(tmp_path, monkeypatch, most, numbers):
    """All twelve fail alike: 1 and 2 are named as examples, 12 is asked for, 99 is no case."""
    answers = Answers(table(tmp_path, [0.1] * 12))
    assert tables.named(answers, 1, [99]) == list(range(1, 13))
    monkeypatch.setattr(tables, "ALL", 12)
    assert len(tables.named(answers, 1, [])) == 12
    monkeypatch.setattr(tables, "ALL", 11)
    monkeypatch.setattr(tables, "MOST", most)
    assert tables.named(answers, 1, [12, 99]) == numbers
