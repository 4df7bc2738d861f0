"""Following a recording: hidden parameters are found with honest deviations; bad files are told in one line each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.follow import parts
from twin.errors import ScenarioError
from twin.face import open_run
from twin.follow import follow, in_band, load, remarks, write_run

VAN_DER_POL = """
component: "tests.follow.parts:VanDerPol"
step: 10 ms
data: data.csv
inputs: {"force [m/s2]": VanDerPol.u}
outputs: {"position [mm]": {signal: VanDerPol.y, noise: 20 mm}}
estimate:
  VanDerPol.x: {start: 0.8 m, deviation: 0.3 m, walk: 1 mm}
  VanDerPol.v: {start: 0, deviation: 0.3, walk: 0.001}
  VanDerPol.mu: {start: 1.0, deviation: 0.5, walk: 0.01, from: 0, to: 5}
"""
NOISE, MU = 0.02, 1.7


def recording(seed, count=400, every=0.05):
    """Time, force and measured position of an oscillator with its own damping; the true states."""
    random = np.random.default_rng(seed)
    oscillator = parts.VanDerPol(mu=MU, x=1.0 + 0.1 * random.standard_normal())
    oscillator.start(0.0)
    rows, true = [(0.0, 0.0, 1e3 * float(oscillator.y))], [(float(oscillator.x), float(oscillator.v))]
    for i in range(count):
        for k in range(5):
            t = i * every + k * every / 5
            oscillator.u = 0.5 * np.sin(0.9 * t)
            oscillator.advance(t, every / 5)
        t = (i + 1) * every
        measured = float(oscillator.y) + NOISE * random.standard_normal()
        rows.append((t, 0.5 * np.sin(0.9 * t), 1e3 * measured))
        true.append((float(oscillator.x), float(oscillator.v)))
    return rows, np.array(true)


def write(folder, rows, text=VAN_DER_POL):
    lines = ["time [s],force [m/s2],position [mm]", *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    (folder / "data.csv").write_text("\n".join(lines) + "\n")
    (folder / "oscillator.yaml").write_text(text)
    return folder / "oscillator.yaml"


@pytest.mark.slow
@pytest.mark.parametrize("method", ["unscented", "{name: ensemble, size: 60, seed: 1}"])
def test_hidden_states_and_parameters(tmp_path, build, method):
    rows, true = recording(1)
    problem = load(write(tmp_path, rows, f"{VAN_DER_POL}method: {method}\n"))
    estimates = list(follow(problem, build))
    assert len(estimates) == 400
    last = estimates[-1]
    assert last.time == pytest.approx(20.0)
    assert abs(last.values[2] - MU) < 3.0 * last.deviations[2]
    assert last.deviations[2] < 0.1
    errors = np.array([one.values[:2] for one in estimates[100:]]) - true[101:]
    assert np.sqrt((errors**2).mean(axis=0)) == pytest.approx([0.0, 0.0], abs=0.03)
    assert 0.85 < in_band(estimates) <= 1.0
    folder = write_run(problem, estimates, tmp_path / "runs", 1.0)
    run = open_run(folder)
    assert run["estimate.VanDerPol.mu"].values[-1].item() == pytest.approx(last.values[2])
    assert run.summary["follow"]["measurements"] == 400
    assert set(run.signals) >= {"deviation.VanDerPol.mu", "innovation.VanDerPol.y", "nis.value", "nis.high"}


SCENARIO = """
stop_time: 30 s
step: 10 ms
members:
  oscillator: {component: "tests.follow.parts:VanDerPol"}
  sampler: {component: "tests.follow.parts:Sampler"}
connections: [oscillator.y -> sampler.u]
groups: {plant: [oscillator, sampler]}
"""
SAMPLED = """
data: data.csv
inputs: {"force [m/s2]": oscillator.u}
outputs: {"position [mm]": {signal: sampler.y, noise: 20 mm, delay: -50 ms}}  # the sampler is 50 ms late
estimate:
  oscillator.x: {start: 0.8 m, deviation: 0.3 m, walk: 1 mm}
  oscillator.v: {start: 0, deviation: 0.3, walk: 0.001}
  oscillator.mu: {start: 1.0, deviation: 0.5, walk: 0.01, from: 0, to: 5}
"""


@pytest.mark.slow
@pytest.mark.parametrize("model", ["scenario: system.yaml", 'component: "system.yaml#plant"\nstep: 10 ms'])
def test_a_system_with_a_slow_member_and_its_group(tmp_path, build, model):
    rows, _ = recording(2)
    (tmp_path / "system.yaml").write_text(SCENARIO)
    text = SAMPLED.replace(": oscillator.", ": plant.oscillator.").replace("  oscillator", "  plant.oscillator")
    text = text.replace("signal: sampler.y", "signal: plant.oscillator.y").replace("delay: -50 ms", "delay: 0 ms")
    text = text if "#" in model else SAMPLED
    estimates = list(follow(load(write(tmp_path, rows, f"{model}\n{text}")), build))
    assert len(estimates) > 390
    assert abs(estimates[-1].values[2] - MU) < 3.0 * estimates[-1].deviations[2] < 0.3
    assert 0.85 < in_band(estimates) <= 1.0


@pytest.mark.slow
def test_what_does_not_fit_is_remarked(tmp_path, build):
    rows, _ = recording(3)
    text = VAN_DER_POL.replace(
        "deviation: 0.5, walk: 0.01, from: 0, to: 5", "deviation: 0.1, walk: 0.1, from: 0.9, to: 1.1"
    )
    problem = load(write(tmp_path, rows, text.replace("noise: 20 mm", "noise: 5 mm")))
    estimates = list(follow(problem, build))
    (line,) = remarks(problem, estimates)
    assert line.startswith("the model does not represent the recording: NIS is in its 95 % band at ")
    covariance = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -0.98], [0.0, -0.98, 1.0]])
    last = replace(estimates[-1], values=np.array([0.0, 0.0, 1.1]), covariance=covariance)
    assert remarks(problem, [*estimates, last])[:2] == [
        "VanDerPol.mu cannot be separated from VanDerPol.v (correlation -0.98): measure more, or estimate one of them.",
        "VanDerPol.mu is at its bound: widen it, or check the model.",
    ]


@pytest.mark.slow
def test_what_was_estimated_before_a_failure_is_written(tmp_path, build, command_line):
    rows, _ = recording(3)
    write(tmp_path, [(time, 1e300 if time > 10.0 else force, position) for time, force, position in rows])
    done = command_line.run(["follow", "oscillator.yaml", "--build", str(build)], tmp_path)
    assert done.returncode == 1
    assert "failed: a point of the filter cannot be simulated: VanDerPol" in done.stderr
    assert open_run(tmp_path / "runs" / "oscillator" / "latest").status == "failed"


def test_bad_files_are_told_in_one_line_each(tmp_path, build):
    rows, _ = recording(1, count=40)
    cases = {
        'outputs: {"position [mm]": {signal: VanDerPol.z, noise: 20 mm}}': "VanDerPol has no variable 'z'",
        'outputs: {"position [mm]": {signal: VanDerPol.v, noise: 20 mm/s}}': "is in mm, VanDerPol.v in m/s. Correct one.",
        'outputs: {"position [mm]": {signal: VanDerPol.y}}': "`noise` is missing. Add its standard deviation",
        'outputs: {"speed [mm]": {signal: VanDerPol.y, noise: 1 mm}}': "no file has this column.",
    }
    for line, expected in cases.items():
        text = "\n".join(line if one.startswith("outputs") else one for one in VAN_DER_POL.splitlines())
        with pytest.raises(ScenarioError) as error:
            load(write(tmp_path, rows, text))
        assert len(error.value.problems) == 1
        assert expected in error.value.problems[0]
        assert error.value.problems[0].startswith(f"{tmp_path}/oscillator.yaml:6: outputs.")
    estimates = {
        "VanDerPol.mu: {start: 1.0}": "estimate.VanDerPol.mu: `deviation` is missing. Add it, such as",
        "VanDerPol.mu: {start: 9, deviation: 1, from: 0, to: 5}": "start 9 1/s is outside of its bounds. Move it.",
        "VanDerPol.mu: {deviation: 1, from: 5, to: 0}": "from 5 is not below to 0. Swap them.",
        "VanDerPol.mu: {deviation: -1}": "is not above zero. Give the standard deviation of the start value.",
        "VanDerPol.side: {deviation: 1}": "VanDerPol.side is fixed: it is read at the start only. Name a tunable parameter.",
        "VanDerPol.nu: {deviation: 1}": "VanDerPol has no variable 'nu'",
    }
    for line, expected in estimates.items():
        text = "\n".join(f"  {line}" if ".mu:" in one else one for one in VAN_DER_POL.splitlines())
        with pytest.raises(ScenarioError) as error:
            load(write(tmp_path, rows, text))
        assert len(error.value.problems) == 1
        assert expected in error.value.problems[0]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda row: (*row[:2], 3.0), "outputs.position [mm]: is constant (0.003 m): the sensor does not measure."),
        (
            lambda row: (row[0] + 3600.0 * (row[0] > 1.0), *row[1:]),
            "time jumps from 1 s to 3601.05 s. Correct the clock",
        ),
        (lambda row: (*row[:2], float("nan") if row[0] == 1.0 else row[2]), "data.csv:22: position [mm] is"),
        (
            lambda row: (row[0] - 3600.0 * (row[0] > 1.0), *row[1:]),
            "data.csv:23: time is before that of the row above.",
        ),
    ],
)
def test_bad_recordings_are_told_in_one_line(tmp_path, change, expected):
    rows, _ = recording(1, count=40)
    text = VAN_DER_POL.replace('inputs: {"force [m/s2]": VanDerPol.u}\n', "")
    with pytest.raises(ScenarioError) as error:
        load(write(tmp_path, [change(row) for row in rows], text))
    assert len(error.value.problems) == 1, error.value.problems
    assert expected in error.value.problems[0]


LINEAR = """
component: "tests.follow.parts:Mass"
step: 50 ms
data: data.csv
outputs: {"position [m]": {signal: Mass.y, noise: 0.1 m}}
estimate:
  Mass.x: {start: 0, deviation: 1, walk: 0.2}
  Mass.v: {start: 0, deviation: 1, walk: 0.5}
"""


@pytest.mark.slow
def test_errors_and_innovations_are_consistent_over_50_runs(tmp_path, build):
    """NEES and NIS of the linear model: their means lie in the 95 % bands of chi-square for 50 runs."""
    nees, nis = [], []
    every, count = 0.05, 60
    for seed in range(50):
        random = np.random.default_rng(seed)
        x, v = random.standard_normal(2)
        rows, true = [(0.0, x)], []
        for i in range(count):
            x, v = (
                x + 0.2 * np.sqrt(every) * random.standard_normal(),
                v + 0.5 * np.sqrt(every) * random.standard_normal(),
            )
            x = x + every * v
            rows.append(((i + 1) * every, x + 0.1 * random.standard_normal()))
            true.append((x, v))
        lines = ["time [s],position [m]", *(f"{time:.9g},{value:.12g}" for time, value in rows)]
        (tmp_path / "data.csv").write_text("\n".join(lines) + "\n")
        (tmp_path / "mass.yaml").write_text(LINEAR)
        estimates = list(follow(load(tmp_path / "mass.yaml"), build))
        assert len(estimates) == count
        nis += [one.nis for one in estimates]
        nees.append([((one.values - of) / one.deviations) ** 2 for one, of in zip(estimates, true, strict=True)])
    # means of 3000 and of 50 values at an instant: 1 plus or minus 1.96 sqrt(2 / n)
    assert np.mean(nis) == pytest.approx(1.0, abs=1.96 * np.sqrt(2 / len(nis)) * 1.2)
    at_end = np.array(nees)[:, -1, :]
    assert at_end.mean(axis=0) == pytest.approx([1.0, 1.0], abs=1.96 * np.sqrt(2 / 50))
