"""Factors as values of a case's parameters, and as the page shows them."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from tests.study.patients import SCENARIO, study_file
from twin.errors import CouplingError
from twin.run import resolve_catalogs
from twin.scenario import parse_scenario
from twin.study import load_study
from twin.study.answers import tables
from twin.study.design import Assignment, Distribution, Factor
from twin.study.design.common_prefix import seeded
from twin.study.design.factor import has_variable, limit_in_si, unit_of
from twin.study.design.sampling import design, problem, sobol, valued

NAN = float("nan")
SOME = Distribution("values", (1.0, 2.0))


def factor(name, *, sets=(), scales=(), distribution=SOME, **fields):
    return Factor(name, sets, scales, distribution, **fields)


@pytest.fixture(scope="module")
def model():
    text = SCENARIO.replace(
        "sensor: {component: force_sensor}", "sensor: {component: force_sensor}\n  sheath: {component: sheath}"
    )
    scenario = parse_scenario(text, "model.yaml")
    return scenario.variants[0], resolve_catalogs(scenario)["plain"]


def test_values_are_set_and_then_multiplied(model):
    """Whole arrays, of which an element is set; NaN leaves what the scenario has."""
    case, catalog = model
    own = Assignment(
        case,
        catalog,
        [
            factor("position", scales=("wall.tip_position", "sheath.play[2]")),
            factor("play", sets=("sheath.play[2]", "sheath.play[3]")),
            factor("elsewhere", sets=("pump.pressure", "wall.none")),
        ],
    )
    play = catalog["sheath"]["play"].start
    found = own.values([2.0, 1e-3, 7.0])
    assert found.keys() == {("wall", "tip_position"), ("sheath", "play")}
    assert found["wall", "tip_position"] == pytest.approx(-34e-3)
    assert found["sheath", "play"] == pytest.approx([np.asarray(play).reshape(-1)[0], 2e-3, 1e-3])
    assert own.values([NAN, NAN, NAN]) == {}
    assert own.values([NAN, 1e-3, NAN])["sheath", "play"][1:] == pytest.approx([1e-3, 1e-3])
    assert own.nominal(factor("a", sets=("sheath.play[3]",))) == np.asarray(play).reshape(-1)[2]
    assert np.isnan(own.nominal(factor("a", sets=("pump.pressure",))))
    assert own.options([2.0, 1e-3, 7.0]) == [
        "sheath.play[1]=0.0",
        "sheath.play[2]=0.002",
        "sheath.play[3]=0.001",
        "wall.tip_position=-0.034",
    ]
    with pytest.raises(CouplingError, match="play"):
        own.values([-1.0, 1e-3, NAN])  # below its minimum


def test_variables_that_can_vary_together(model):
    _, catalog = model
    assert unit_of(["heart.rate"], catalog) == ("Hz", catalog["heart"]["rate"].display_unit)
    assert unit_of(["wall.tip_position", "sheath.play[2]"], catalog)[0] == "m"
    with pytest.raises(
        CouplingError, match=r"^heart\.rate in Hz, wall\.tip_position in m: one factor cannot set all of them\."
    ):
        unit_of(["heart.rate", "wall.tip_position"], catalog)
    with pytest.raises(
        CouplingError, match=r"^heart\.position is no parameter \(output\)\. Vary what it is computed from\.$"
    ):
        unit_of(["heart.position"], catalog)
    assert has_variable("sheath.play[2]", catalog)
    assert not has_variable("sheath.slack", catalog)


def test_booleans_of_a_factor():
    """True as it is not zero."""
    own = object.__new__(Assignment)
    boolean = SimpleNamespace(dtype=np.dtype(np.bool_), type="Boolean", shape=())
    own.catalog = {"m": {"is_on": boolean}}
    assert own._typed(("m", "is_on"), np.array(0.2)) is np.True_
    assert own._typed(("m", "is_on"), np.array(0.0)) is np.False_


def test_seeds_that_follow_the_seed_of_a_case():
    """A seed that the file gives stays; other variables are none."""

    @dataclass(frozen=True)
    class OfSeed:
        members: tuple
        seed: int = 5

        def values(self, name, _variables):
            return (
                {"seed": self.seed, "inner.seed": 3, "gain": self.seed}
                if name == "sensor"
                else {"a.b.seed": 2 * self.seed}
            )

    found = seeded(OfSeed(("sensor", "group")), {"sensor": {}, "group": {}})
    assert found == {("sensor", "seed"): "sensor", ("group", "a.b.seed"): "group.a.b"}


def test_designs_of_few_factors():
    wide = Distribution("uniform", (0.0, 10.0))
    factors = [
        factor("a", distribution=wide),
        factor("b", distribution=SOME),
        factor("c", distribution=Distribution("normal", (0.0, 1.0))),
    ]
    assert problem(factors) == {
        "num_vars": 3,
        "names": ["a", "b", "c"],
        "bounds": [[0.0, 1.0], [0.0, 1.0], [0.01, 0.99]],
    }
    assert design("random", 5, 1, []).values.shape == (5, 0)
    listed = [factor("a"), factor("b", distribution=Distribution("values", (7.0, 8.0, 9.0)))]
    grid = design("grid", 0, 0, listed)
    assert grid.values.tolist() == [[1, 7], [1, 8], [1, 9], [2, 7], [2, 8], [2, 9]]
    assert np.isnan(grid.parts).all()
    assert grid.parts.shape == (6, 2)
    one = design("one_at_a_time", 0, 0, listed).values
    assert one == pytest.approx(np.array([[NAN, NAN], [1, NAN], [2, NAN], [NAN, 7], [NAN, 8], [NAN, 9]]), nan_ok=True)
    assert [len(sobol(count, factors, 3)) for count in (1, 2, 5, 8)] == [1, 2, 5, 8]
    parts = np.array([[0.25, 0.75], [0.5, 0.5]])
    assert valued(parts, [factor("a", distribution=wide)] * 2).tolist() == [[2.5, 7.5], [5.0, 5.0]]
    bound = valued(parts, [factor("a", distribution=wide)] * 2, np.array([[1.0, 0.8], [0.8, 1.0]]))
    assert bound[:, 0] == pytest.approx([2.5, 5.0])
    z = -0.6744897501960817  # normal score of a quarter; 0.8 z - 0.6 z of the second factor
    assert bound[:, 1] == pytest.approx([10 * norm.cdf(0.2 * z), 5.0])


def test_factors_on_the_page():
    """Of a temperature the deviation is a difference; of few values all are named, and eight of many."""
    factors = [
        factor(
            "t",
            sets=("a.t",),
            distribution=Distribution("normal", (300.0, 2.0)),
            unit="K",
            display_unit="degC",
            source="book",
        ),
        factor("x", scales=("a.x", "b.x"), distribution=Distribution("log_normal", (1.0, 1.25)), source="assumed"),
        factor("n", sets=("a.n", "b.n"), distribution=Distribution("values", tuple(map(float, range(10)))), unit="mm"),
    ]
    outcome = SimpleNamespace(
        cases=SimpleNamespace(values=np.array([[290.0, NAN, 1.0], [310.0, NAN, 4.0]])),
        study=SimpleNamespace(all_factors=factors),
    )
    shown = [
        tuple(row[key] for key in ("name", "targets", "kind", "span", "source")) for row in tables.factors(outcome)
    ]
    assert shown[0][:2] == ("t", "a.t")
    assert shown[0][2] == "normal: mean 26.85 degC, standard deviation 2 degC"
    assert shown[0][3:] == (f"{factors[0].shown(290.0)} to {factors[0].shown(310.0)}", "book")
    assert shown[1] == (
        "x",
        "a.x, b.x (multiplied)",
        "log-normal: median x 1, geometric standard deviation 1.25",
        "-",
        "assumed",
    )
    assert shown[2] == (
        "n",
        "a.n, b.n",
        "equally likely: 0 mm, 1 mm, 2 mm, 3 mm, 4 mm, 5 mm, 6 mm, 7 mm and 2 more",
        "1 mm to 4 mm",
        "",
    )
    assert factors[0].shown(NAN) == "as in the scenario"


def test_a_grid_and_ranges_in_a_file(tmp_path):
    """The last number of a grid is a count, of a log-normal a ratio; the others have units."""
    text = """
scenario: scenario.yaml
variants: [plain]
samples: {count: 4}
vary:
  wall.tip_position: {grid: [-20 mm, -10 mm, 3], source: assumed}
  heart.rate: {log_normal: [1 Hz, 1.5], from: 60 /min, to: 2 Hz, source: assumed}
"""
    first, second = load_study(study_file(tmp_path, text)).factors
    assert first.distribution == Distribution("values", pytest.approx((-0.02, -0.015, -0.01)))
    assert (second.distribution.numbers, second.distribution.low, second.distribution.high) == ((1.0, 1.5), 1.0, 2.0)
    assert (first.unit, second.unit, first.sets, first.scales, first.source) == (
        "m",
        "Hz",
        ("wall.tip_position",),
        (),
        "assumed",
    )


@pytest.mark.parametrize(
    ("raw", "symbol", "value"),
    [(5, "mm", 5.0), ("5 mm", "mm", 5e-3), ("5 cm", "mm", 0.05), ("26.85 degC", "degC", 300.0)],
)
def test_a_limit_in_si(raw, symbol, value):
    """A bare number is in SI already."""
    assert limit_in_si(raw, symbol) == pytest.approx(value)
