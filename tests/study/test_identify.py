"""Values that are known are found again, with intervals that hold; what data do not tell is said."""

import numpy as np
import pytest
from click.testing import CliRunner
from fmus.bouc_wen_compensator.model import BoucWenCompensator
from scipy.stats import chi2

from benchmarks import identify as benchmark
from tests.study.recordings import FILE, MODEL, identify_file, recorded, simulated, write
from twin.cli.identify import command
from twin.component import catalog
from twin.fmi.exporting import exporter
from twin.identify import identify, load, read_estimate
from twin.identify.model import Model
from twin.identify.result import pairs
from twin.scenario import parse_scenario

TRUTH = {"sheath.play[2]": 0.7e-3}


@pytest.fixture
def folder(tmp_path, build):
    recorded(tmp_path, build, "sheath.play=[0 mm, 0.7 mm, 0.3 mm]")
    return tmp_path


def found(folder, build, text=FILE, **options):
    return identify(load(identify_file(folder, text)), build=build, **{"starts": 2, "seed": 1, **options})


def test_a_replayed_input_gives_the_same_bits(tmp_path, build):
    signals = recorded(tmp_path, build, noise=0.0)
    every = FILE.replace("[gripper.csv, tip.csv]", "whole.csv").replace("[mm]", "[m]")
    columns = [signals.time, signals.values["chirp.position"], signals.values["sheath.tip_position"]]
    np.savetxt(
        tmp_path / "whole.csv", np.stack(columns, 1), "%.17g", ",", header="time [s],gripper [m],tip [m]", comments=""
    )
    problem = load(identify_file(tmp_path, every))
    with Model(problem, build) as model:
        for _ in range(2):  # members go back to how they were made
            (predicted,) = model.predicted(np.array([one.position(one.start) for one in problem.unknowns]))
            model._recorded[0]._cache.clear()
            assert predicted.tobytes() == signals.values["sheath.tip_position"].tobytes()


@pytest.mark.slow
def test_a_value_is_found_in_its_interval(folder, build):
    result = found(folder, build)
    ((low, high),) = result.intervals
    assert result.passed
    assert low < 0.7e-3 < high
    assert high - low < 0.2e-3
    assert result.fit.sigmas[0] == pytest.approx(0.1e-3, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["profile", pytest.param("bootstrap", marks=pytest.mark.slow)])
def test_the_ways_to_an_interval_agree(folder, build, method, monkeypatch):
    monkeypatch.setattr("twin.identify.intervals.RESAMPLED", 40)
    plain, other = found(folder, build), found(folder, build, intervals=method)
    assert other.knowledge.method == method
    width = plain.intervals[0][1] - plain.intervals[0][0]
    assert np.abs(np.subtract(other.intervals, plain.intervals)).max() < 0.3 * width
    if method == "bootstrap":
        monkeypatch.setattr("twin.identify.intervals.RESAMPLED", 5)
        few, again = (found(folder, build, intervals=method) for _ in range(2))
        assert again.knowledge.samples.tobytes() == few.knowledge.samples.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
def test_what_others_recorded_is_recovered(tmp_path, build, monkeypatch, seed):
    """The 20 of `benchmarks.identify`, but three and short."""
    monkeypatch.setattr(benchmark, "BUILD", build)
    monkeypatch.setattr(benchmark, "SCENARIO", build.parent / benchmark.SCENARIO)
    truth = benchmark.record(seed, tmp_path, duration=8.0)
    result = benchmark.identified(seed, tmp_path, starts=1)
    assert benchmark.distance(result, truth) < chi2.ppf(0.95, len(truth))
    assert sum(benchmark.holds(result, truth).values()) >= len(truth) - 1


@pytest.mark.slow
def test_two_values_that_only_count_together_are_told(folder, build):
    text = FILE.replace("fit: {", 'fit: {"sheath.play[3]": {from: 0 mm, to: 1.5 mm}, ')
    result = found(folder, build, text)
    first, second = result.verdicts
    assert any("cannot be separated from sheath.play[2]: correlation -" in one for one in first)
    assert any("cannot be separated from sheath.play[3]: correlation -" in one for one in second)
    profiled = found(folder, build, text, intervals="profile")
    assert any("flat profile" in one for own in profiled.verdicts for one in own)


BOUC_WEN = """
component: bouc_wen_compensator
data: [wanted.csv, gripper.csv]
inputs: {"wanted [m]": bouc_wen_compensator.position}
outputs: {"gripper [m]": bouc_wen_compensator.compensated_position}
set: {bouc_wen_compensator.alpha_x: 1.9, bouc_wen_compensator.alpha: 1.2}
fit:
  bouc_wen_compensator.beta: {from: 0.01, to: 0.1}
  bouc_wen_compensator.delta: {from: 0, to: 0.1}
  bouc_wen_compensator.gamma: {from: 1, to: 3}
"""


@pytest.mark.slow
def test_saturation_and_sharpness_of_bouc_wen_cannot_be_separated(tmp_path, build):
    """Their report says so, with the correlation, whether their intervals are narrow or wide."""
    part = BoucWenCompensator(alpha_x=1.9, alpha=1.2, beta=0.04, delta=0.04, gamma=1.5)
    time = np.arange(0.0, 10.0, 5e-3)
    wanted = 8e-3 * np.sin(2.0 * np.pi * (0.1 * time + 0.145 * time * time))
    gripper = np.empty(len(time))
    part.start(0.0)
    for step, place in enumerate(wanted):
        part.position = place
        part.advance(step * 5e-3, 5e-3)
        gripper[step] = part.compensated_position
    noise = 0.1e-3 * np.random.default_rng(1).standard_normal(len(time[::5]))
    write(tmp_path / "wanted.csv", "time [s],wanted [m]", time, wanted)
    write(tmp_path / "gripper.csv", "time [s],gripper [m]", time[::5], gripper[::5] + noise)
    result = found(tmp_path, build, BOUC_WEN, starts=1)
    said = [*(line for own in result.verdicts for line in own), *pairs(result.problem, result.knowledge)]
    for one, other, sign in (("beta", "gamma", "-"), ("delta", "gamma", "-"), ("beta", "delta", "")):
        told = [line for line in said if f".{one}" in line and f".{other}" in line and "cannot be separated" in line]
        assert any(f"correlation {sign}0.9" in line for line in told), (one, other, said)


@pytest.mark.slow
def test_a_value_without_effect_is_told_and_left_out(folder, build):
    result = found(
        folder,
        build,
        FILE.replace("fit: {", "fit: {sheath.friction_coefficient: {from: 0, to: 1}, ").replace(
            "outputs:", "set: {sheath.wrap: 0 deg}\noutputs:"
        ),
    )
    assert result.verdicts[0] == ["not identifiable: it changes nothing of what is compared"]
    assert list(result.parameter_set()["sheath"]) == ["play[2]"]
    assert not result.verdicts[1]


@pytest.mark.slow
def test_a_value_at_its_bound_is_told(folder, build):
    result = found(folder, build, FILE.replace("to: 1.5 mm", "to: 0.5 mm"))
    assert result.verdicts[0][0].startswith("at its upper bound")


@pytest.mark.slow
def test_a_delay_and_an_offset_are_found(tmp_path, build):
    recorded(tmp_path, build, late=0.04)
    text = FILE.replace(
        "sheath.tip_position",
        "{signal: sheath.tip_position, delay: {from: -0.1 s, to: 0.1 s}, offset: {from: -1 mm, to: 1 mm}}",
    )
    result = found(tmp_path, build, text)
    _, delay, offset = result.intervals
    assert delay[0] < 0.04 < delay[1]
    assert offset[0] < 0.0 < offset[1]
    assert set(result.parameter_set()["sheath"]) == {"play[2]"}


@pytest.mark.slow
def test_a_robust_loss_withstands_outliers(folder, build):
    lines = (folder / "tip.csv").read_text().splitlines()
    for row in range(5, len(lines), 20):
        time, value = lines[row].split(",")
        lines[row] = f"{time},{float(value) + 20 * (-1) ** (row // 20)}"
    (folder / "tip.csv").write_text("\n".join(lines))
    plain, robust = found(folder, build), found(folder, build, FILE + "loss: soft_l1\n")
    assert abs(robust.values[0] - 0.7e-3) < 0.1e-3
    width = [high - low for one in (plain, robust) for low, high in one.intervals]
    assert width[1] < 0.5 * width[0]
    assert robust.intervals[0][0] < 0.7e-3 < robust.intervals[0][1]


@pytest.mark.slow
def test_residuals_that_follow_each_other_widen_the_interval(folder, build):
    result = found(folder, build, FILE.replace("fit:", 'set: {"sheath.stiffness": [0.8e3, 12e3, 12e3]}\nfit:'))
    assert result.knowledge.inflation > 2
    assert any("the model does not explain" in one for one in result.notes())


@pytest.mark.slow
def test_a_whole_scenario_is_fitted(tmp_path, build):
    truth = ("sheath.stiffness[1]=3 N/mm", "chirp.amplitude=4 mm")
    recorded(tmp_path, build, *truth)
    (tmp_path / "model.yaml").write_text(MODEL)
    text = """
scenario: model.yaml
data: tip.csv
outputs: {"tip [mm]": sheath.tip_position}
fit:
  "sheath.stiffness[1]": {from: 1 N/mm, to: 10 N/mm, scale: log}
  chirp.amplitude: {from: 2 mm, to: 8 mm}
"""
    result = found(tmp_path, build, text)
    assert result.passed
    for (low, high), value in zip(result.intervals, (3e3, 4e-3), strict=True):
        assert low < value < high


@pytest.mark.slow
def test_inputs_take_the_place_of_what_drives(folder, build):
    (folder / "model.yaml").write_text(MODEL)
    text = FILE.replace("component: sheath", "scenario: model.yaml").replace(
        "sheath.gripper_position", "chirp.position"
    )
    result = found(folder, build, text)
    assert result.problem.left_out == ("chirp",)
    assert result.values[0] == pytest.approx(found(folder, build).values[0], abs=2e-6)


def test_somebody_elses_fmu_is_instantiated_anew(folder, build):
    path = exporter.build(catalog.component("sheath"), "3.0", build / "tests")
    text = FILE.replace("component: sheath", f"component: {path}").replace("sheath.", f"{path.stem}.")
    text = text.replace("[gripper.csv, tip.csv]", "[{file: gripper.csv}, {file: tip.csv}]\nto: 1 s")
    problem = load(identify_file(folder, text))
    with Model(problem, build) as foreign:
        places = np.array([0.4])
        theirs = [foreign.predicted(places)[0], foreign._recorded[0]._cache.clear(), foreign.predicted(places)[0]]
    with Model(load(identify_file(folder, FILE + "to: 1 s\n")), build) as own:
        assert own.predicted(places)[0].tobytes() == theirs[0].tobytes() == theirs[2].tobytes()


@pytest.mark.slow
def test_ctrl_c_keeps_the_best_so_far(folder, build):
    calls = []

    def progress(what, part, best):
        calls.append(what)
        if what.startswith("start 2"):
            raise KeyboardInterrupt

    result = found(folder, build, progress=progress, starts=3, intervals="bootstrap")
    assert result.fit.interrupted
    assert not result.passed
    assert result.knowledge.method == "jacobian"
    assert result.values[0] == pytest.approx(0.7e-3, abs=0.1e-3)
    assert any("interrupted" in one for one in result.notes())


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits(folder, build):
    one, two = (found(folder, build, starts=3, seed=7) for _ in range(2))
    assert one.fit.positions.tobytes() == two.fit.positions.tobytes()
    assert one.covariance.tobytes() == two.covariance.tobytes()


@pytest.mark.slow
def test_a_scenario_takes_what_was_found(folder, build):
    result = found(folder, build)
    (folder / "mine.yaml").write_text(result.text())
    scenario = parse_scenario(MODEL + "parameter_sets: mine.yaml\n", folder / "s.yaml")
    assert scenario.cases()[0].members["sheath"].parameters == {"play[2]": result.values[0]}
    tip = simulated(build, f"sheath.play[2]={result.values[0]!r}").values["sheath.tip_position"][::25]
    assert np.allclose(tip, result.predicted[0], atol=1e-12)
    estimate = read_estimate(folder / "mine.yaml")
    assert estimate.names == ("sheath.play[2]",)
    assert estimate.values == result.values
    assert estimate.covariance.tobytes() == result.covariance.tobytes()
    assert result.identified()["files"][1]["sha256"] == result.problem.files[1].sha256


@pytest.mark.slow
def test_a_set_names_an_fmu_by_its_path(folder, build):
    path = exporter.build(catalog.component("sheath"), "3.0", build / "tests")
    (folder / "mine.fmu").write_bytes(path.read_bytes())
    text = FILE.replace("component: sheath", "component: mine.fmu").replace("sheath.", "mine.") + "to: 0.5 s\n"
    result = found(folder, build, text, starts=1)
    (folder / "sets").mkdir()
    (folder / "sets" / "mine.yaml").write_text(result.text(folder / "sets"))
    assert "\n../mine.fmu: {play[2]: " in (folder / "sets" / "mine.yaml").read_text().replace("'", "")
    scenario = parse_scenario(
        "stop_time: 1 s\nmembers: {part: {component: mine.fmu}}\nparameter_sets: sets/mine.yaml\n", folder / "s.yaml"
    )
    assert scenario.cases()[0].members["part"].parameters == {"play[2]": result.values[0]}


def test_a_scenario_that_overrules_is_told(folder, build):
    own = MODEL.replace("{component: sheath}", '{component: sheath, parameters: {"play[2]": 0.2 mm}}')
    (folder / "model.yaml").write_text(own)
    text = FILE.replace("component: sheath", "scenario: model.yaml").replace(
        "sheath.gripper_position", "chirp.position"
    )
    notes = load(identify_file(folder, text)).notes
    assert notes == (
        f"{folder / 'model.yaml'}:5: sheath.play[2] is set there, which wins over a parameter set. Remove it there.",
    )


@pytest.mark.slow
def test_the_command_writes_its_files(folder, build, monkeypatch):
    monkeypatch.chdir(folder)
    identify_file(folder)
    arguments = ["identify.yaml", "--starts", "1", "--build", str(build)]
    done = CliRunner().invoke(command, arguments)
    assert done.exit_code == 0, done.output
    assert "sheath.play[2]" in done.output
    page = (folder / "identify_parameters.html").read_text()
    assert "<svg" in page
    assert "all unknowns identified" in page
    assert (folder / "identify_parameters.yaml").exists()
    assert "exists. Use --force" in str(CliRunner().invoke(command, arguments).exception)
    wide = FILE.replace("fit: {", 'fit: {"sheath.play[3]": {from: 0 mm, to: 1.5 mm}, ')
    identify_file(folder, wide)
    assert CliRunner().invoke(command, [*arguments, "--force", "--no-report"]).exit_code == 1
