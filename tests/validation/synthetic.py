"""Synthetic recordings in the formats of real ones: CSV with foreign names, MATLAB matrices, bracketed lists."""

import numpy as np
from scipy.io import savemat

from tests.validation.bending import Bending

PERIOD = 0.01
TRUE = {"rest": 0.6, "gain": 120.0, "play": 0.4e-3}
ROBOT = """
title: A robot
source: Ask the makers.
sets:
  decaying:
    files: robot/*.txt
    train: robot/train_*.txt
    time: Time
    columns: {tendon: {name: "Tendon Disp.", unit: mm}, angle: {name: "Angle x", unit: deg}, height: {name: Pos z, unit: mm}}
    component: tests.validation.bending:Bending
    step: 10 ms
    inputs: {tendon: tendon}
    outputs:
      angle: {signal: angle, unit: deg, quantity: bending angle}
      height: {signal: height, unit: mm}
    fit:
      rest: {from: 0 deg, to: 60 deg}
      gain: {from: 50, to: 200}
      play: {from: 0, to: 2 mm}
    rezero: {rest: {from: -30 deg, to: 90 deg}}
    baselines: [line, cubic, play_cubic]
"""


def true_angle(time, tendon, rest=TRUE["rest"]):
    """The component in plain Python."""
    model = Bending(rest=rest, gain=TRUE["gain"], play=TRUE["play"])
    model.tendon = tendon[0]
    model.initialize()
    angles = [model.angle]
    for t, value in zip(time[1:], tendon[1:], strict=True):
        model.tendon = value
        model.step(t, PERIOD)
        angles.append(model.angle)
    return np.array(angles)


def run(seed, rest=TRUE["rest"], spread=0.004, noise=0.002, duration=10.0):
    """Time [s], tendon [m] and angle [rad] of a decaying sine; `spread`: of the rest angle between runs."""
    generator = np.random.default_rng(seed)
    time = np.arange(0, duration, PERIOD)
    tendon = 2e-3 + 2e-3 * np.exp(-time / 8) * np.sin(2 * np.pi * (0.2 + 0.1 * (seed % 5)) * time)
    angle = true_angle(time, tendon, rest + generator.normal(0, spread)) + generator.normal(0, noise, len(time))
    return time, tendon, angle


def write_csv(path, time, tendon, angle, header="Time,Tendon Disp.,Angle x,Pos z"):
    path.parent.mkdir(exist_ok=True)
    table = np.stack([time, 1e3 * tendon, np.degrees(angle), 100 * angle], 1)
    np.savetxt(path, table, "%.9g", ",", header=header, comments="")


def write_matlab(path, time, tendon, angle):
    """As motion capture tools do: n x 1, 1 x n and n x 3."""
    path.parent.mkdir(exist_ok=True)
    marker = np.stack([0 * angle, 0 * angle, 100 * angle], 1)
    content = {"Time": time[:, None], "Stroke": 1e3 * tendon[None, :], "Bend": np.degrees(angle)[:, None]}
    savemat(path, {**content, "tip_marker": marker, "reference": np.zeros((1, 3)), "note": "text"})


def robot(folder, runs=5, slipped=None):
    """A data folder with training runs and two test runs; the second one rests at another angle if `slipped` [rad]."""
    for number in range(runs):
        write_csv(folder / f"robot/train_{number}.txt", *run(number))
    write_csv(folder / "robot/good.txt", *run(101))
    write_csv(folder / "robot/slipped.txt", *run(102, TRUE["rest"] + (slipped or 0.0)))
    (folder / "validation").mkdir(exist_ok=True)
    path = folder / "validation/robot.yaml"
    path.write_text(ROBOT)
    return path
