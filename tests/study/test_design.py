"""What varies: distributions with units, samples that repeat, and every mistake told with its line."""

import numpy as np
import pytest
from scipy import stats

from tests.every_case import every_case
from tests.study.patients import SCENARIO, STUDY, study_file
from twin.errors import ScenarioError
from twin.study.design import Assignment, Distribution, load_study, valued
from twin.study.design.sampling import TAIL

EVEN = np.linspace(0.005, 0.995, 100)


def loaded(folder, text=STUDY):
    return load_study(study_file(folder, text))


def sampled(folder, samples, text=STUDY):
    return loaded(folder, text.replace("{method: latin_hypercube, count: 6, seed: 3}", samples)).design.values


@every_case(
    ("own", "other"),
    [
        (Distribution("uniform", (2.0, 6.0)), stats.uniform(2.0, 4.0)),
        (Distribution("log_uniform", (0.1, 10.0)), stats.loguniform(0.1, 10.0)),
        (Distribution("normal", (1.0, 0.5)), stats.norm(1.0, 0.5)),
        (Distribution("normal", (1.0, 0.5), 0.4, 1.2), stats.truncnorm(-1.2, 0.4, 1.0, 0.5)),
        (Distribution("log_normal", (3.0, 1.5)), stats.lognorm(np.log(1.5), scale=3.0)),
    ],
)
def test_quantiles_are_those_of_scipy(own, other):
    np.testing.assert_allclose(own.values(EVEN), other.ppf(EVEN), rtol=1e-9)


def test_a_truncated_log_normal_stays_inside():
    found = Distribution("log_normal", (1.0, 1.5), 0.8, 1.1).values(np.array([0.0, 0.5, 1.0]))
    assert found[0] == pytest.approx(0.8)
    assert found[2] == pytest.approx(1.1)
    assert 0.8 < found[1] < 1.1


@every_case(
    ("kind", "numbers", "low", "high", "ends"),
    [
        ("normal", (0.0, 1.0), -np.inf, np.inf, (TAIL, 1.0 - TAIL)),
        ("normal", (0.0, 1.0), -2.0, np.inf, (0.0, 1.0 - TAIL)),
        ("log_normal", (1.0, 2.0), -np.inf, 3.0, (TAIL, 1.0)),
        ("log_normal", (1.0, 2.0), 0.5, 3.0, (0.0, 1.0)),
        ("uniform", (0.0, 1.0), -np.inf, np.inf, (0.0, 1.0)),
        ("log_uniform", (1.0, 10.0), -np.inf, np.inf, (0.0, 1.0)),
        ("values", (1.0, 2.0, 5.0), -np.inf, np.inf, (0.0, 1.0)),
    ],
)
def test_a_design_that_wants_both_ends_gets_finite_ones(kind, numbers, low, high, ends):
    own = Distribution(kind, numbers, low, high)
    assert own.ends == ends
    assert np.isfinite(own.values(np.array(own.ends))).all()


def test_all_values_of_a_list_are_equally_likely():
    parts = (np.arange(300) + 0.5) / 300
    found = Distribution("values", (1.0, 2.0, 5.0)).values(parts)
    assert found.tolist() == [1.0] * 100 + [2.0] * 100 + [5.0] * 100
    assert Distribution("values", (1.0, 2.0, 5.0)).values(np.array([0.0, 1.0])).tolist() == [1.0, 5.0]


def test_values_come_in_the_units_of_their_variables(tmp_path):
    study = loaded(tmp_path)
    rate = study.design.values[:, 0]
    assert study.factors[0].unit == "Hz"
    assert (rate > 45 / 60).all()
    assert (rate < 110 / 60).all()


def test_a_deviation_is_a_difference(tmp_path):
    text = STUDY.replace("keep:", "  sensor.temperature: {normal: [20 degC, 2 degC], source: assumed}\nkeep:")
    temperature = loaded(tmp_path, text).factors[-1].distribution
    assert temperature.numbers == pytest.approx((293.15, 2.0))


@every_case("name", ["scenario", "heart_wall_force", "heart_wall_force.yaml"])
def test_the_file_of_a_scenario_may_have_any_name(tmp_path, name):
    """It has precedence over a shipped scenario of that name."""
    path = study_file(tmp_path, STUDY.replace("scenario.yaml", name))
    (tmp_path / name).write_text(SCENARIO)
    assert load_study(path).scenario.path == tmp_path / name


def test_a_variable_of_one_variant_varies_in_that_one(tmp_path):
    scenario = SCENARIO.replace("plain: {}", "plain: {members: {sensor: {component: heart}}}")
    scenario = scenario.replace("  - wall.force -> sensor.force\n", "").replace("sensor.measured_force", "wall.force")
    text = STUDY.replace("sensor.measured_force", "wall.force")
    text = text.replace("keep:", "  sensor.noise: {uniform: [1 mN, 2 mN], source: assumed}\nkeep:")
    study = load_study(study_file(tmp_path, text, scenario))
    values = {
        case.variant: Assignment(case, study.catalogs[case.variant], study.factors).values([1.0, 1.0, 1.0, 1e-3])
        for case in study.scenario.variants
    }
    assert ("sensor", "noise") not in values["plain"]
    assert values["soft"]["sensor", "noise"] == 1e-3


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("method", ["latin_hypercube", "sobol", "random"])
def test_the_same_seed_gives_the_same_samples(tmp_path, method):
    first, again, other = (sampled(tmp_path, f"{{method: {method}, count: 8, seed: {seed}}}") for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_a_latin_hypercube_has_one_sample_in_each_slice(tmp_path):
    scale = sampled(tmp_path, "{count: 10}")[:, 1]
    assert sorted(np.floor((scale - 0.5) * 10).astype(int)) == list(range(10))


def test_a_longer_sobol_sequence_begins_with_the_shorter(tmp_path):
    short, long = (sampled(tmp_path, f"{{method: sobol, count: {count}}}") for count in (5, 8))
    assert short.tobytes() == long[:5].tobytes()


def test_factors_are_correlated_as_asked(tmp_path):
    text = STUDY + "correlated: [{factors: [heart.rate, bent end], coefficient: 0.7}]\n"
    values = sampled(tmp_path, "{count: 2000}", text)
    assert stats.spearmanr(values[:, 0], values[:, 2]).statistic == pytest.approx(0.683, abs=0.03)  # 6/pi asin(0.35)
    assert abs(stats.spearmanr(values[:, 0], values[:, 1]).statistic) < 0.05


LEVELS = """
scenario: scenario.yaml
samples: {method: METHOD}
vary:
  heart.rate: {values: [60 /min, 90 /min], source: assumed}
  heart.scale: {grid: [0.5, 1.5, 3], source: assumed}
"""


def test_a_grid_has_every_value_with_every_other(tmp_path):
    values = loaded(tmp_path, LEVELS.replace("METHOD", "grid")).design.values
    assert values.tolist() == [[rate, scale] for rate in (1.0, 1.5) for scale in (0.5, 1.0, 1.5)]


def test_one_at_a_time_leaves_the_others_as_they_are(tmp_path):
    values = loaded(tmp_path, LEVELS.replace("METHOD", "one_at_a_time")).design.values
    assert np.isnan(values[0]).all()
    assert (np.isfinite(values[1:]).sum(axis=1) == 1).all()
    assert len(values) == 6


IDENTIFIED = """
identified:
  unknowns: [wall.bending_stiffness, heart.scale, a delay]
  units: [N*m^2, "", s]
  values: [4.0e-4, 1.0, 0.1]
  bounds: [[1.0e-4, 9.0e-4], [0.1, 3.0], [0.0, 1.0]]
  covariance: [[1.0e-10, 4.0e-7, 0.0], [4.0e-7, 0.01, 0.0], [0.0, 0.0, 1.0]]
"""


def test_what_was_identified_varies_with_its_covariance(tmp_path):
    (tmp_path / "set.yaml").write_text(IDENTIFIED)
    text = "scenario: scenario.yaml\nsamples: {count: 4000}\nestimates: [{file: set.yaml}]\n"
    study = loaded(tmp_path, text)
    assert [one.name for one in study.factors] == ["wall.bending_stiffness", "heart.scale"]
    covariance = np.cov(study.design.values.T)
    np.testing.assert_allclose(covariance, [[1e-10, 4e-7], [4e-7, 0.01]], rtol=0.1)


def test_what_had_no_effect_in_an_identification_stays_as_the_scenario_has_it(tmp_path):
    """Its variance is zero: nothing is known of it, and the parameter set leaves it out, too."""
    row = "[1.0e-10, 4.0e-7, 0.0], [4.0e-7, 0.01, 0.0]"
    assert row in IDENTIFIED
    (tmp_path / "set.yaml").write_text(IDENTIFIED.replace(row, "[0.0, 0.0, 0.0], [0.0, 0.01, 0.0]"))
    study = loaded(tmp_path, "scenario: scenario.yaml\nsamples: {count: 4}\nestimates: [{file: set.yaml}]\n")
    assert [(one.name, one.distribution.numbers) for one in study.factors] == [("heart.scale", (1.0, 0.1))]
    assert (study.factors[0].distribution.low, study.factors[0].distribution.high) == (0.1, 3.0)
    assert study.correlation is None


def test_uncorrelated_factors_keep_their_parts(tmp_path):
    study = loaded(tmp_path)
    assert valued(study.design.parts, study.factors).tobytes() == study.design.values.tobytes()


WRONG = """
scenario: scenario.yaml
variants: [plane]
samples: {method: morris, count: 4}
vary:
  heart.rat: {uniform: [1 Hz, 2 m], source: assumed}
  heart.scale: {uniform: [1.5, 0.5], source: assumed}
  heart.rate: {normal: [1 m, 2 Hz], source: assumed}
  wall.free_length: {uniform: [40 mm, 50 mm]}
  heart.position: {uniform: [0 mm, 1 mm], source: assumed}
  sensor.noise: {source: assumed}
"""


def test_all_mistakes_are_told_with_their_lines(tmp_path):
    with pytest.raises(ScenarioError) as caught:
        loaded(tmp_path, WRONG)
    told = "\n".join(error[error.index("patients.yaml") :] for error in caught.value.problems)
    for line, text in (
        (3, "there is no variant `plane`"),
        (6, "has no variable 'rat'"),
        (6, "does not convert to Hz"),  # its values, too
        (7, "uniform from 1.5 to 0.5 is empty"),
        (8, "does not convert to Hz"),
        (9, "`source` is missing"),
        (10, "is no parameter"),
        (11, "has no distribution"),
    ):
        assert any(one.startswith(f"patients.yaml:{line}:") and text in one for one in told.split("\n")), (text, told)


def test_mistakes_of_other_sections_are_told_with_those_of_factors(tmp_path):
    text = (
        STUDY.replace("count: 6", "count: -6")
        .replace("signal: sensor.", "signal: sensr.")
        .replace("0.5, 1.5]", "1.5, 0.5]")
    )
    text += "set: {stop_tme: 1 s}\ncorrelated: [{factors: [heart.rat, heart.scale], coefficient: 0.5}]\n"
    text += "tune: {metric: motion, variant: plane, knobs: {wall.free_length: {from: 40 mm, to: 60 mm}}, limits: [{metric: motion, at_most: 1 mm}]}\n"
    with pytest.raises(ScenarioError) as caught:
        loaded(tmp_path, text)
    told = [error.partition("patients.yaml:")[2] for error in caught.value.problems]
    assert [line.partition(": ")[2].partition(": ")[0] for line in told] == [
        "samples.count",
        "vary.heart.scale",
        "keep.bands.force",
        "set.stop_tme",
        "correlated[1]",
        "tune.variant",
    ]
    assert "`stop_tme` cannot be set" in told[3]


@pytest.mark.parametrize(
    ("wrong", "line", "text"),
    [
        ("scenario: scenari.yaml", 2, "scenario: .*scenari.yaml: is not there. Did you mean '.*scenario.yaml'"),
        ("scenario: heart_wal_force", 2, "scenario: there is no scenario 'heart_wal_force', .* Did you mean"),
        ("scenario: other/none.yaml", 2, "scenario: .*none.yaml: is not there. Give a path as seen from this file"),
    ],
)
def test_a_wrong_scenario_is_reported_with_its_line(tmp_path, wrong, line, text):
    with pytest.raises(ScenarioError, match=text) as caught:
        loaded(tmp_path, STUDY.replace("scenario: scenario.yaml", wrong))
    (problem,) = caught.value.problems
    assert f"patients.yaml:{line}: " in problem


def test_a_distribution_with_a_wrong_value_is_one_problem(tmp_path):
    with pytest.raises(ScenarioError) as caught:
        loaded(tmp_path, STUDY.replace("uniform: [0.5, 1.5]", "uniform: [0.5]"))
    assert len(caught.value.problems) == 1


TRIANGLE = (("heart.rate, heart.scale", 0.9), ("heart.rate, bent end", 0.9), ("heart.scale, bent end", -0.9))
KNOB = "tune: {{metric: motion, knobs: {{wall.free_length: {{from: {low}, to: {high}, scale: {scale}}}}}}}"
LIMIT = "tune: {{metric: motion, knobs: {{wall.free_length: {{from: 1 mm, to: 2 mm}}}}, limits: [{}]}}"


def test_knobs_and_limits_are_in_the_units_of_their_variables(tmp_path):
    tune = LIMIT.format(
        "{metric: motion, at_most: 3 mm}, {expectation: gentle, at_least: 90 %}, {metric: motion, at_least: 1e-3}"
    )
    study = loaded(tmp_path, STUDY + tune.replace("to: 2 mm", "to: 2 mm, scale: log"))
    (knob,) = study.knobs
    assert (knob.low, knob.high, knob.is_log, knob.factor.sets) == (1e-3, 2e-3, True, ("wall.free_length",))
    assert knob.factor.distribution.kind == "log_uniform"
    assert [(one.metric, one.expectation, one.at_most, one.at_least) for one in study.limits] == [
        ("motion", "", pytest.approx(3e-3), None),
        ("", "gentle", None, 0.9),
        ("motion", "", None, 1e-3),
    ]
    assert [one.text for one in study.limits] == [
        "mean of motion at most 3 mm",
        "gentle at least 90 %",
        "mean of motion at least 0.001",
    ]


def test_a_grid_is_limited(tmp_path):
    """Of ten times ten times a hundred thousand values."""
    wide = {
        "normal: [70 /min, 12 /min], from: 45 /min, to: 110 /min": "grid: [1, 2, 1000]",
        "uniform: [0.5, 1.5]": "grid: [1, 2, 1000]",
    }
    text = STUDY.replace("latin_hypercube, count: 6, seed: 3", "grid").replace("log_normal: [1, 1.2]", "values: [1, 2]")
    for old, new in wide.items():
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(ScenarioError, match=r"the grid has 2,000,000 samples\. Keep below "):
        loaded(tmp_path, text)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"scenario: scenario.yaml": "title: x"}, "`scenario: ../heart_wall_force.yaml`"),
        ({"latin_hypercube": "grid"}, "grid needs `values` or `grid`"),
        ({"sensor.measured_force, unit: mN": "wall.forc, unit: N"}, "`wall` has no variable `forc`. Did you mean"),
        ({"sensor.measured_force, unit: mN": "wall.force, unit: mm"}, "in N, which does not convert to mm"),
        ({"method: latin_hypercube, count: 6": "method: sensitivity, count: 6"}, "no power of two"),
        ({"keep:": "metrics: [force]\nkeep:"}, "there is no metric `force`"),
        ({"keep:": "correlated: [{factors: [heart.rate, x], coefficient: 0.5}]\nkeep:"}, "nothing called `x` varies"),
        ({"samples:": "sample:"}, "unknown key `sample`"),
        (
            {"samples:": "seeds: [1]\nsamples:"},
            "unknown key `seeds`. It belongs to `samples`: `samples: {seeds: ...}`.",
        ),
        ({"keep:": "worst: {metric: none}\nkeep:"}, "there is no metric `none`"),
        ({"keep:": "worst: {metric: motion, variant: hard}\nkeep:"}, "worst.variant: there is no variant `hard`"),
        ({"uniform: [0.5, 1.5]": "values: [1, 2]", "keep:": "worst: {metric: motion}\nkeep:"}, "cannot be searched"),
        ({"uniform: [0.5, 1.5]": "uniform: [0.5, 1.5], values: [1]"}, "uniform and values are given. Keep one"),
        ({"scales: wall.bending_stiffness": "sets: heart.rate"}, "heart.rate is set by `heart.rate` too"),
        ({"scales:": "sets: heart.scale, scales:"}, "both `sets` and `scales` are given"),
        (
            {
                "latin_hypercube": "morris",
                "keep:": "correlated: [{factors: [heart.rate, heart.scale], coefficient: 0.5}]\nkeep:",
            },
            "morris needs independent factors",
        ),
        (
            {
                "keep:": "correlated: ["
                + ", ".join(f"{{factors: [{pair}], coefficient: {r}}}" for pair, r in TRIANGLE)
                + "]\nkeep:"
            },
            "three of them contradict each other",
        ),
        ({"keep:": f"{KNOB.format(low='2 mm', high='2 mm', scale='linear')}\nkeep:"}, "from 2 mm is not below to 2 mm"),
        ({"keep:": f"{KNOB.format(low='0 mm', high='2 mm', scale='log')}\nkeep:"}, "from 0 mm is not above zero"),
        ({"keep:": f"{KNOB.format(low='1 N', high='2 mm', scale='log')}\nkeep:"}, "does not convert to m"),
        ({"keep:": f"{LIMIT.format('{at_most: 1}')}\nkeep:"}, "name a `metric` or an `expectation`, one of them"),
        (
            {"keep:": f"{LIMIT.format('{metric: motion, expectation: gentle}')}\nkeep:"},
            "name a `metric` or an `expectation`",
        ),
        ({"keep:": f"{LIMIT.format('{expectation: kind, at_least: 1}')}\nkeep:"}, "there is no expectation `kind`"),
        ({"keep:": f"{LIMIT.format('{metric: none, at_least: 1}')}\nkeep:"}, "there is no metric `none`"),
        ({"keep:": f"{LIMIT.format('{metric: motion}')}\nkeep:"}, "has no limit. Add at_most or at_least"),
    ],
)
def test_a_mistake_is_told(tmp_path, changes, text):
    changed = STUDY
    for old, new in changes.items():
        changed = changed.replace(old, new)
    with pytest.raises(ScenarioError, match=text.replace("(", r"\(")):
        loaded(tmp_path, changed)


TUNE = "tune: {metric: motion, knobs: {wall.damping: {from: 1 N*s/m, to: 2 N*s/m}}, trials: 2, "


@every_case(
    ("search", "place"),
    [
        ("worst: {metric: motion}", "worst.metric"),
        (f"{TUNE}}}", "tune.metric"),
        (f"{TUNE.replace('motion', 'force_max')}limits: [{{metric: motion, at_most: 1 mm}}]}}", r"tune.limits\[1\]"),
    ],
)
def test_a_search_needs_a_metric_of_its_variant(tmp_path, search, place):
    scenario = SCENARIO.replace("from: 1 s, unit: mm", "from: 1 s, unit: mm, variants: [soft]")
    with pytest.raises(ScenarioError, match=f"{place}: `motion` has no value with plain, only with soft"):
        load_study(study_file(tmp_path, f"{STUDY}{search}\n", scenario))


def test_a_search_needs_a_metric_whose_window_the_cases_reach(tmp_path):
    scenario = SCENARIO.replace("from: 1 s, unit: mm", "from: 1 s, to: 1.4 s, unit: mm")
    text = f"{STUDY}set: {{stop_time: 1.2 s}}\nworst: {{metric: motion}}\n"
    with pytest.raises(ScenarioError, match="the cases end before the window of `motion`"):
        load_study(study_file(tmp_path, text, scenario))
