"""Windows that are not run across: bracketed lists, initial states from the first sample, roll-outs of any length."""

import numpy as np
import pytest

from tests.validation.bending import Oscillator
from twin.errors import TwinError
from twin.validation import fit_and_freeze, frozen_path, frozen_text, load, validate
from twin.validation.baselines import fit_baseline, predict_baseline
from twin.validation.rollout import RollOut

STEP = 2e-3
FILE = """
title: Windows
sets:
  sines:
    files: arm/*.txt
    sample_time: 2 ms
    columns:
      q: {name: "input[1]", unit: mm}
      x: {name: "state[1]", unit: mm}
      x_dot: {name: "state[2]", unit: mm/s}
    component: tests.validation.bending:Oscillator
    step: 2 ms
    inputs: {q: q}
    outputs: {x: {signal: x, unit: mm, rate: x_dot}}
    initial: {first_position: x, first_velocity: x_dot}
    window: 500
    train_window: 50
    fit:
      frequency: {from: 5, to: 100, scale: log}
      damping: {from: 0.01, to: 2}
      gain: {from: 1, to: 10}
    folds: {by: block, count: 4}
    baselines: [line, linear_second_order]
"""


def movement(count, seed):
    """Displacement [m], position [m] and velocity [m/s] of an oscillator that is driven by a sum of sines."""
    generator = np.random.default_rng(seed)
    time = STEP * np.arange(count)
    q = sum(generator.normal(0, 1e-3) * np.sin(2 * np.pi * f * time + generator.uniform(0, 6)) for f in (0.3, 0.8, 1.9))
    model = Oscillator(frequency=25.0, damping=0.2, gain=6.0)
    model.q = q[0]
    model.initialize()
    rows = [(model.position, model.velocity)]
    for t, value in zip(time[1:], q[1:], strict=True):
        model.q = value
        model.advance(t, STEP)
        rows.append((model.position, model.velocity))
    return q, *np.array(rows).T


def write(path, lengths, seed):
    """Windows of a longer movement, not contiguous, one below the other, as `"[x,x_dot,z,z_dot]","[q]"`."""
    path.parent.mkdir(exist_ok=True)
    lines = ["state,input"]
    for number, length in enumerate(lengths):
        q, x, v = (1e3 * one[200:] for one in movement(length + 200, seed + number))
        lines += [f'"[{a:.6f},{b:.6f},0.000,0.000]","[{c:.6f}]"' for a, b, c in zip(x, v, q, strict=True)]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def arm(tmp_path_factory, build):
    folder = tmp_path_factory.mktemp("arm")
    write(folder / "arm/train.txt", [50] * 40, 0)
    path = folder / "arm.yaml"
    path.write_text(FILE)
    own = load(path, folder, build)
    frozen = fit_and_freeze(own, starts=2)
    frozen_path(path).write_text(frozen_text(own.title, frozen))
    write(folder / "arm/test.txt", [500] * 3, 100)
    return own, frozen["sines"]


@pytest.mark.slow
def test_parameters_are_recovered_from_short_windows(arm):
    _, frozen = arm
    assert frozen.values["frequency"] == pytest.approx(25, rel=1e-3)
    assert frozen.values["damping"] == pytest.approx(0.2, rel=1e-2)
    assert frozen.values["gain"] == pytest.approx(6, rel=1e-3)


@pytest.mark.slow
def test_long_roll_outs_start_from_the_first_state(arm):
    own, _ = arm
    (row,) = validate(own, ["arm/test.txt"])[0].rows
    assert row["rmse"] < 1e-2
    assert row["baselines"]["linear_second_order"] < 0.2
    assert row["baselines"]["line"] > 0.5


@pytest.mark.slow
def test_window_of_the_command_line(arm):
    own, _ = arm
    (prediction,) = validate(own, ["arm/test.txt"], window=250)
    assert len(prediction.data.inputs) == 6
    assert prediction.rows[0]["remarks"][-1].startswith("roll-outs of 250 rows are longer than the 50 of the fit")
    with pytest.raises(TwinError, match=r"arm/test.txt: has 1500 rows, fewer than a window of 2000"):
        validate(own, ["arm/test.txt"], window=2000)


@pytest.mark.slow
def test_roll_outs_do_not_cross_joined_windows_of_another_length(arm):
    """A file of windows of 120 rows, predicted with --window 500: a roll-out begins where the state jumps."""
    own, frozen = arm
    assert frozen.changes["x"] > 0
    write(own.folder / "arm/joined.txt", [120] * 6, 100)
    (prediction,) = validate(own, ["arm/joined.txt"])
    (own.folder / "arm/joined.txt").unlink()
    assert np.bincount(prediction.data.window_index).tolist() == [120] * 6
    assert prediction.rows[0]["rmse"] < 1e-2
    assert "jump in 5 places" in prediction.rows[0]["remarks"][0]


@pytest.mark.slow
def test_list_of_another_length_is_refused(arm):
    own, _ = arm
    path = own.folder / "arm/short.txt"
    lines = (own.folder / "arm/test.txt").read_text().splitlines()
    lines[9] = '"[1,2,3]","[4]"'
    path.write_text("\n".join(lines))
    try:
        with pytest.raises(TwinError, match=r"arm/short.txt:10: state has 3 elements, expected 4 as in the first row"):
            validate(own, ["arm/short.txt"])
    finally:
        path.unlink()


def test_roll_out_equals_the_component_in_python(build):
    q, x, _ = movement(300, 7)
    roll_out = RollOut(
        "tests.validation.bending:Oscillator",
        {"frequency": 25.0, "damping": 0.2, "gain": 6.0},
        STEP,
        ["q"],
        ["x"],
        build,
    )
    outputs = roll_out([q[:, None], q[:100, None]], {})
    assert np.array_equal(outputs[1:300, 0], x[1:])
    assert np.array_equal(outputs[300:, 0], outputs[:100, 0])


def test_start_values_differ_between_windows(build):
    roll_out = RollOut("tests.validation.bending:Oscillator", {}, STEP, ["q"], ["x"], build)
    outputs = roll_out([np.zeros((3, 1))] * 2, {"first_position": np.array([1.0, -2.0])})
    assert np.allclose(outputs[:, 0], [*outputs[:3, 0], *(-2 * outputs[:3, 0])])


@pytest.mark.slow
def test_narx_follows_what_it_was_fitted_to(arm):
    pytest.importorskip("sklearn")
    own, _ = arm
    current = own.open_set("sines")
    data = current.reader().read(own.folder, ["arm/test.txt"])
    rows = np.ones(len(data.time), bool)
    error = predict_baseline("narx", fit_baseline("narx", data, rows), data) - data.measured
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.std(data.measured)
