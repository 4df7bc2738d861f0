"""Consistency of following: normalized errors (NEES) and innovations (NIS) over 50 rigs with hidden parameters.

    python -m benchmarks.follow_consistency [RIGS]               prints `name: value` lines

For a consistent filter the NEES of n estimates is chi-square distributed with n degrees of freedom; the mean over the rigs has
the band that is printed. Rigs: `benchmarks.follow_rig`, with hidden parameters that stay constant, for which the filter assumes small
walks, and with such that change by the walks that it assumes; and the sheath of docs/how-to/follow.md with a hidden play that changes so.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.stats import chi2

from benchmarks.follow_rig import BUILD, FOLLOW, hidden, record
from twin.face import load as load_scenario
from twin.follow import Estimate, follow, in_band, load

SECONDS = 8.0
PLAY, PLAY_DEVIATION, PLAY_WALK = 1.0, 0.1, 0.05  # of the sheath: mean and deviation at first, walk in a second [mm]
PLAY_EVERY = 0.5  # interval at which it changes [s]
FORCE_WALKS = (4e-6, 2e-3, 10e-6, 0.3e-3)  # of play, friction, surface and zero in a second [m], [N], [m], [N]
FORCE_EVERY = 0.1  # interval at which they change [s]
CONSTANT = 0.25  # walks of parameters that stay constant, as a part of those; chosen on rigs 101 to 112 (0: NEES 10.5, 0.25: 4.5)
START = {"chirp": {"component": "chirp", "parameters": {"total_time": "20 s", "frequency_final": "1 Hz"}}}


def correlations(estimates: Sequence[Estimate]) -> list[float]:
    """Return the autocorrelation of each signal's normalized innovations, mean of the lags 1 to 10: 0 if they are white."""
    result = []
    for column in np.array([estimate.innovation / estimate.expected for estimate in estimates]).T:
        values = column[np.isfinite(column)]
        products = [np.mean(values[lag:] * values[:-lag]) for lag in range(1, 11)]
        result.append(float(np.mean(products) / np.mean(values**2)))
    return result


def with_small_walks() -> dict[str, Any]:
    """Return the estimates of the follow file with smaller walks of the hidden parameters."""
    small = {}
    for name in list(FOLLOW["estimate"])[: len(FORCE_WALKS)]:
        value, unit = FOLLOW["estimate"][name]["walk"].split()
        small[name] = {**FOLLOW["estimate"][name], "walk": f"{CONSTANT * float(value)} {unit}"}
    return {**FOLLOW["estimate"], **small}


def force(folder: Path, seed: int, walks: bool) -> list[float]:
    """Return NEES of the hidden parameters at the end, mean NIS for each measured value, the fraction of NIS in its band, and `correlations`.

    `walks`: whether the hidden parameters change each tenth of a second, by the walks that the filter assumes.
    """
    own, random = hidden(seed), np.random.default_rng(5000 + seed)
    play, friction = (float(own["sheath"][name].split()[0]) for name in ("play[3]", "friction[2]"))
    values = np.array([1e-3 * play, friction, 1e-3 * float(own["wall"]["surface_position"].split()[0]), 0.0])
    events = []
    for i in range(1, round(SECONDS / FORCE_EVERY) if walks else 1):
        values += np.sqrt(FORCE_EVERY) * random.standard_normal(4) * FORCE_WALKS
        play, friction, surface, zero = values.tolist()
        changed = {
            "sheath.play": ["0 mm", "0.3 mm", f"{play} m"],
            "sheath.friction": ["0.6 N", f"{friction} N", "0.8 N"],
            "wall.surface_position": f"{surface} m",
            "sensor.zero_offset": f"{zero} N",
        }
        events.append({"at": f"{FORCE_EVERY * i:.1f} s", "set": changed})
    path, true = record(folder, seed, SECONDS, events, follow={} if walks else {"estimate": with_small_walks()})
    problem = load(path)
    walk = [variable.walk for variable in problem.estimates[:4]]
    wanted = np.array(FORCE_WALKS) * (1.0 if walks else CONSTANT)
    assert np.allclose(walk, wanted), f"the walks of the follow file are {walk}; correct FORCE_WALKS"
    estimates = list(follow(problem, BUILD))
    last = estimates[-1]
    row = int(np.searchsorted(true["time"], last.time - 1e-9))
    values[3] += true["sensor.initial_zero_error"][row] + true["sensor.drift_rate"][row] * last.time
    error = last.values[:4] - values
    counts = [np.isfinite(estimate.measured).sum() for estimate in estimates]
    nis = sum(estimate.nis for estimate in estimates) / sum(counts)
    nees = float(error @ np.linalg.solve(last.covariance[:4, :4], error))
    return [nees, float(nis), in_band(estimates), *correlations(estimates)]


def sheath(folder: Path, seed: int) -> list[float]:
    """Return the same of the sheath of the page. Its hidden play changes each half second, by the walk that the filter assumes."""
    random = np.random.default_rng(seed)
    steps = PLAY_WALK * np.sqrt(PLAY_EVERY) * random.standard_normal(round(20.0 / PLAY_EVERY) - 1)
    plays = PLAY + PLAY_DEVIATION * random.standard_normal() + np.cumsum([0.0, *steps])
    members = {
        **START,
        "sheath": {"component": "sheath", "parameters": {"play[3]": f"{plays[0]} mm"}},
        "tracker": {"component": "em_tracker", "parameters": {"seed": seed}},
    }
    keys = {
        "title": "Sheath",
        "stop_time": "20 s",
        "members": members,
        "connections": [
            "chirp.position -> sheath.gripper_position, tracker.reference",
            "sheath.tip_position -> tracker.position",
        ],
        "events": [
            {"at": f"{PLAY_EVERY * i} s", "set": {"sheath.play[3]": f"{play} mm"}}
            for i, play in enumerate(plays[1:].tolist(), 1)
        ],
        "record": {"every": "25 ms", "variables": ["*.*"]},
    }
    (folder / "sheath_rig.yaml").write_text(yaml.safe_dump(keys))
    run = load_scenario(folder / "sheath_rig.yaml").run(build=BUILD, out=folder / "runs", report=False)
    estimate = {"start": f"{PLAY} mm", "deviation": f"{PLAY_DEVIATION} mm", "walk": f"{PLAY_WALK} mm"}
    (folder / "sheath.yaml").write_text(
        yaml.safe_dump(
            {
                "component": "sheath",
                "step": "1 ms",
                "data": str(run.folder),
                "inputs": {"chirp.position": "sheath.gripper_position"},
                "outputs": {
                    "tracker.measured_position": {"signal": "sheath.tip_position", "noise": "0.2 mm", "delay": "25 ms"}
                },
                "estimate": {"sheath.play[3]": {**estimate, "from": "0 mm", "to": "2 mm"}},
            }
        )
    )
    estimates = list(follow(load(folder / "sheath.yaml"), BUILD))
    error = (estimates[-1].values[0] - 1e-3 * plays[-1]) / estimates[-1].deviations[0]
    nis = float(np.mean([estimate.nis for estimate in estimates]))
    return [float(error**2), nis, in_band(estimates), *correlations(estimates)]


def main() -> None:
    """Print means and bands."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    cases = (
        ("sheath", sheath, 1, 1),
        ("force", partial(force, walks=False), 4, 401),  # seeds that chose nothing
        ("force_walking", partial(force, walks=True), 4, 301),
    )
    for name, function, n, first in cases:
        with tempfile.TemporaryDirectory() as folder:
            results = np.array([function(Path(folder), seed) for seed in range(first, first + count)])
        nees, nis, inside, *correlated = results.mean(axis=0)
        low, high = chi2.ppf([0.025, 0.975], count * n) / count
        print(f"follow_nees_{name}: {nees:.2f}, 95 % band {low:.2f} to {high:.2f}")
        print(f"follow_nis_{name}: {nis:.2f} for each measured value, {100 * inside:.1f} % in its band")
        print(f"follow_correlation_{name}: {', '.join(f'{value:.3f}' for value in correlated)}", flush=True)


if __name__ == "__main__":
    main()
