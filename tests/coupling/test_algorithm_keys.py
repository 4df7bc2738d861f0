"""Algorithms in scenario files, on the command line, and from Python."""

import csv
from pathlib import Path

import pytest

import twin
from tests.coupling.parts import Bomb, Lag
from tests.coupling.test_algorithms import MS
from tests.every_case import every_case
from twin.cli.check import check_file
from twin.coupling import Algorithm
from twin.errors import CouplingError, ScenarioError
from twin.fmi.exporting import exporter, pythonfmu_export
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, parse_scenario

TEXT = """
stop_time: 100 ms
step: 4 ms
algorithm: {algorithm}
members:
  a: {{component: "benchmarks.couplings:Mass", parameters: {{begin: 10 mm}}}}
  b: {{component: "benchmarks.couplings:Answering"}}
connections:
  - {{from: a.x, to: b.other_x, bond: spring}}
  - {{from: a.v, to: b.other_v, bond: spring}}
  - {{from: b.force, to: a.f, bond: spring}}
variants:
  plain: {{}}
  other: {{algorithm: {{name: step_doubling, smallest: 0.25 ms, tolerance: 0.1 %}}}}
"""


def scenario(algorithm="jacobi", overrides=()):
    return parse_scenario(TEXT.format(algorithm=algorithm), "s.yaml", overrides)


def algorithms(*given, **options):
    return [case.algorithm for case in scenario(*given, **options).variants]


def test_a_name_or_a_name_with_options():
    plain, other = algorithms("{name: iterative, order: 1, acceleration: newton, agreement: 1e-8}")
    assert plain == Algorithm("iterative", order=1, acceleration="newton", agreement=1e-8)
    assert other == Algorithm("step_doubling", smallest=250_000, tolerance=1e-3), "nothing is left of the inherited one"
    assert algorithms()[0] == "jacobi"


@every_case("algorithm", Algorithm, ids=str)
def test_an_algorithm_is_equal_to_its_name_if_it_has_no_options(algorithm):
    assert algorithm == algorithm.name == str(algorithm)
    assert algorithm == type(algorithm)()
    assert hash(algorithm) == hash(algorithm.name)
    assert algorithm in Algorithm
    assert algorithm.name not in Algorithm
    assert [other for other in Algorithm if other == algorithm] == [algorithm]
    other = type(algorithm)(smoothing=0.5)
    assert other != algorithm
    assert other != algorithm.name
    assert other == type(algorithm)(smoothing=0.5)
    assert algorithm != "nothing"


def left_out(text):
    """Values of an option that is left out, by algorithm: `0; energy, ecco 1`."""
    first, *others = text.split("; ")
    values = {"": first}
    for other in others:
        names, _, value = other.rpartition(" ")
        values |= dict.fromkeys(names.split(", "), value)
    return values


def test_options_that_are_left_out_are_those_of_the_table_of_keys():
    written = {"none": {}, "false": False, "1 us": 1000}
    rows = csv.reader(
        (Path(twin.__file__).parents[1] / "docs/data/scenario_keys.csv").read_text(encoding="utf-8").splitlines()
    )
    table = {key: left_out(value) for section, key, _, value in rows if section == "algorithm"}
    for algorithm in Algorithm:
        for name, value in vars(algorithm).items():
            text = table[name].get(algorithm.name, table[name][""])
            assert value == (written[text] if text in written else text if isinstance(value, str) else float(text)), (
                name
            )


def test_options_from_the_command_line():
    assert algorithms(overrides=["algorithm=gauss_seidel"]) == [Algorithm.gauss_seidel] * 2
    plain, other = algorithms(overrides=["algorithm.order=2"])
    assert plain == Algorithm("jacobi", order=2)
    assert other == Algorithm("step_doubling", smallest=250_000, tolerance=1e-3, order=2)


@every_case(
    ("algorithm", "message"),
    [
        ("jakobi", "s.yaml:4: algorithm: `jakobi` is not known. Did you mean `jacobi`?"),
        ("{name: jacobi, iterations: 3}", "s.yaml:4: algorithm: jacobi has no option 'iterations'"),
        (
            "{name: iterative, iterations: many}",
            "s.yaml:4: algorithm: iterations of iterative is 'many'. Give 1 to 1000.",
        ),
        (
            "{name: predictive, smallest: 5 ms}",
            "s.yaml:4: algorithm: the smallest step 5 ms is too long for the step 4 ms. Give at most 4 ms.",
        ),
        ("3", "s.yaml:4: algorithm: expected a name such as jacobi"),
    ],
)
def test_what_is_wrong_is_one_line(algorithm, message):
    with pytest.raises(ScenarioError) as caught:
        scenario(algorithm)
    assert any(one.startswith(message) for one in caught.value.problems), caught.value.problems


@pytest.mark.slow
def test_bonds_are_read(build):
    checked = scenario("energy")
    run = build_simulation(checked.variants[0], resolve_catalogs(checked)["plain"], Backend.compiled, build)
    run.initialize(0, 100 * MS)
    run.advance(100 * MS)
    assert run.state["bond_count"] == 3
    assert not run.notes
    run.terminate()


@pytest.mark.slow
def test_a_connection_may_be_held(build):
    """All held is what `jacobi` of order 0 gives."""
    ends = []
    for algorithm, hold in (
        ("jacobi", "false"),
        ("{name: jacobi, order: 1}", "true"),
        ("{name: jacobi, order: 1}", "false"),
    ):
        text = TEXT.replace("bond: spring", f"hold: {hold}").format(algorithm=algorithm)
        checked = parse_scenario(text, "s.yaml")
        run = build_simulation(checked.variants[0], resolve_catalogs(checked)["plain"], Backend.compiled, build)
        run.initialize(0, 100 * MS)
        run.advance(100 * MS)
        ends.append(run.recording().signals["a.x"].tobytes())
        run.terminate()
    assert ends[0] == ends[1] != ends[2]


def test_scales_have_units(build):
    options = "{name: predictive, tolerance: 1e-3, scales: {b.force: 4000 mN, a.v: 0.2 m/s}}"
    checked = scenario(options)
    case = checked.variants[0]
    catalog = resolve_catalogs(checked)["plain"]
    assert case.method(catalog).scales == {"b.force": 4.0, "a.v": 0.2}
    few, many = (
        build_simulation(one.variants[0], catalog, Backend.compiled, build) for one in (checked, scenario("predictive"))
    )
    for run in (few, many):
        run.initialize(0, 100 * MS)
        run.advance(100 * MS)
        run.terminate()
    assert few.state["sweeps"] < many.state["sweeps"], "what is known to be large need not be so exact"
    with pytest.raises(ScenarioError, match=r"algorithm: scales: b.force: .*kg"):
        scenario("{name: predictive, scales: {b.force: 1 kg}}").variants[0].method(catalog)


def test_from_python():
    system = twin.System()
    system.add("a", "benchmarks.couplings:Mass", begin=0.01)
    system.add("b", "benchmarks.couplings:Answering")
    system.connect("a.x", "b.other_x")
    system.connect("a.v", "b.other_v")
    system.connect("b.force", "a.f")
    ends = []
    for algorithm in (
        "iterative",
        {"name": "iterative", "agreement": 1e-9},
        {"name": "predictive", "smallest": "10 us"},
    ):
        with system.simulate("1 ms", stop="20 ms", algorithm=algorithm) as run:
            run.advance("20 ms")
            ends.append(float(run["a.x"]))
    assert ends == pytest.approx([ends[0]] * 3, rel=1e-3)


@pytest.mark.slow
def test_check_names_members_that_cannot_go_back(tmp_path, build):
    outside = pythonfmu_export.export(Bomb, "2.0", tmp_path / "bomb.fmu")
    own = exporter.build(Lag, "3.0", build)
    (tmp_path / "s.yaml").write_text(
        f"stop_time: 20 ms\nalgorithm: iterative\nmembers:\n  lag: {{component: {own.resolve()}}}\n"
        f"  bomb: {{component: {outside}}}\n  inside: {{component: 'tests.coupling.parts:Bomb'}}\n"
        "connections: [lag.y -> bomb.u, lag.y -> inside.u]\n"
    )
    problems, _ = check_file(str(tmp_path / "s.yaml"))
    needs = "cannot go back to the begin of a step, which iterative needs. Use jacobi, gauss_seidel, ecco, energy, or give it a longer `communication_step`."
    assert problems == [f"{tmp_path}/s.yaml:5: bomb: {needs}", f"{tmp_path}/s.yaml:6: inside: {needs}"]
    assert check_file(str(tmp_path / "s.yaml"), ("algorithm=jacobi",))[0] == []
    assert (
        check_file(str(tmp_path / "s.yaml"), ("bomb.communication_step=2 ms", "inside.communication_step=2 ms"))[0]
        == []
    )


def test_algorithms_that_are_no_algorithms():
    with pytest.raises(CouplingError, match="there is no None"):
        Algorithm({"order": 1})


LIMITS = {  # smallest and largest value that an option may have, and whether the smallest is excluded
    "jacobi": {"order": (0, 2, False), "smoothing": (0.0, 1.0, False)},
    "energy": {"correction": (0.0, 1.0, True)},
    "ecco": {
        "tolerance": (0.0, 1.0, True),
        "smallest": (1, 10**18, False),
        "floor": (0.0, 1e300, True),
        "correction": (0.0, 1.0, False),
    },
    "iterative": {"iterations": (1, 1000, False), "agreement": (0.0, 1.0, True), "floor": (0.0, 1e300, True)},
    "predictive": {
        "iterations": (0, 1000, False),
        "agreement": (0.0, 1.0, True),
        "tolerance": (0.0, 1.0, True),
        "smallest": (1, 10**18, False),
        "floor": (0.0, 1e300, True),
    },
}


@every_case(("name", "option"), [(name, option) for name, own in LIMITS.items() for option in own])
def test_options_are_limited_with_their_ends(name, option):
    low, high, is_excluded = LIMITS[name][option]
    whole = isinstance(low, int)
    above = low + 1 if whole else 1e-9
    for value in (above, high, *([] if is_excluded else [low])):
        assert getattr(Algorithm(name, **{option: value}), option) == value
    beyond = [low - 1, high * 2 if high > 1e6 else high + (1 if whole else 1e-9), True, "1", None]
    for value in (*beyond, *([low] if is_excluded else []), *([low + 0.5] if whole else [])):
        with pytest.raises(CouplingError, match=f"algorithm: {option} of {name} is "):
            Algorithm(name, **{option: value})


@every_case(
    ("algorithm", "step", "smallest", "divisions"),
    [
        ("predictive", 8, 1, 8),
        ("predictive", 8, 2, 4),
        ("predictive", 8, 3, 2),
        ("predictive", 7, 1, 4),
        ("predictive", 8, 8, 1),
        ("ecco", 1000, 1, 512),
        ("step_doubling", 8, 1, 8),
        ("step_doubling", 8, 4, 2),
    ],
)
def test_a_step_is_divided_by_powers_of_two(algorithm, step, smallest, divisions):
    assert Algorithm(algorithm, smallest=smallest).divisions(step) == divisions


@pytest.mark.parametrize(
    ("algorithm", "smallest", "most"), [("predictive", 9, "8 ns"), ("ecco", 9, "8 ns"), ("step_doubling", 5, "4 ns")]
)
def test_a_smallest_step_is_no_longer_than_the_step(algorithm, smallest, most):
    with pytest.raises(CouplingError, match=f"is too long for the step 8 ns.* Give at most {most}"):
        Algorithm(algorithm, smallest=smallest).divisions(8)


@every_case(
    ("algorithm", "expected"),  # whether the fixed-step loop runs it, it rolls back, its members step in sequence
    [
        (("jacobi", {}), (True, False, False)),
        (("gauss_seidel", {}), (True, False, True)),
        (("jacobi", {"order": 1}), (False, False, False)),
        (("energy", {"order": 0}), (False, False, False)),
        (("ecco", {}), (False, False, False)),
        (("iterative", {}), (False, True, True)),
        (("predictive", {}), (False, True, False)),
        (("predictive", {"iterations": 3}), (False, True, True)),
        (("predictive", {"sequential": True}), (False, True, True)),
        (("step_doubling", {}), (False, True, False)),
    ],
)
def test_what_an_algorithm_needs(algorithm, expected):
    name, options = algorithm
    found = Algorithm(name, **options)
    assert (found.is_plain, found.rolls_back, found.is_sequential) == expected
