"""Calibration of forecasts: how often the 90 % band of the force in the next second holds the true one, and the chance that it leaves its limits.

    python -m benchmarks.follow_forecast [SEEDS]                 prints `name: value` lines

Simulated rigs with hidden parameters (`benchmarks.follow_rig`), the loop of the controller closed in the model. The motion of the
wall's motor is planned, hence known; nothing else of the future is. With the whole motion the force leaves its limits in every second:
the chance is judged on other rigs, whose motion is a tenth to a quarter of it, by a factor drawn from the seed.
"""

from __future__ import annotations

import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.follow_rig import BUILD, FOLLOW, record
from twin.follow import Follower, load
from twin.follow.problem import times_of

SECONDS, FROM = 20.0, 4.0  # length of a rig, and begin of the forecasts [s]
LIMITS = (0.1, 0.4)  # [N]
FORECAST = {
    "inputs": {"heart.position [m]": "heart.position"},
    "outputs": {name: keys for name, keys in FOLLOW["outputs"].items() if keys["signal"] != "servomotor.current"},
    "forecast": {
        "horizon": "1 s",
        "every": "250 ms",
        "interval": "100 ms",
        "signals": ["wall.force"],
        "limits": {"wall.force": [f"{limit} N" for limit in LIMITS]},
        "planned": ["heart.position [m]"],
        "draws": 60,
    },
}


SMALL = (0.1, 0.25)  # factors on the motion of the heart with which the force leaves its limits now and then
SMALL_FROM = 101  # first seed of these rigs
CLASSES = (0.0, 0.1, 0.3, 0.7, 0.9, 1.0)  # forecast chances that are counted together


def small_motion(seed: int) -> list[dict[str, Any]]:
    """Return the events of a rig with a small motion of the heart."""
    factor = float(np.random.default_rng(6000 + seed).uniform(*SMALL))
    return [{"at": "0 s", "set": {"heart.scale": factor}}]


def held(folder: Path, seed: int, events: list[dict[str, Any]]) -> tuple[list[list[bool]], list[tuple[float, bool]]]:
    """Return for each forecast which of its points the band holds, and the chance to leave the limits with what happened."""
    path, true = record(folder, seed, SECONDS, events, follow=FORECAST)
    problem = load(path)
    assert problem.forecast is not None
    inside, chances, due = [], [], 0
    with Follower(problem, BUILD) as follower:
        for tick, measurements in times_of(problem).items():
            follower.advance(tick)
            time = follower.correct(measurements).time
            if time < FROM or time > SECONDS - 1.0 or tick < due:
                continue
            due = tick + problem.forecast.repeat
            forecast = follower.forecast()
            low, _, high = forecast.bands[:, :, 0]
            force = np.interp(forecast.time, true["time"], true["wall.force"])
            inside.append(((force >= low) & (force <= high)).tolist())
            left = bool(np.any((force < LIMITS[0]) | (force > LIMITS[1])))
            chances.append((float(forecast.chance[0]), left))
    return inside, chances


def main() -> None:
    """Print how many points the bands hold, by their distance, and the Brier score of the chance."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    inside, chances = [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(1, 1 + count):
            own, _ = held(Path(folder), seed, [])
            print(f"seed {seed}: {100 * np.mean(own):.0f} %", flush=True)
            inside += own
        for seed in range(SMALL_FROM, SMALL_FROM + count):
            own, leaving = held(Path(folder), seed, small_motion(seed))
            chance, left = np.array(leaving).T
            text = f"{100 * np.mean(own):.0f} %; left limits {100 * left.mean():.0f} %, forecast {100 * chance.mean():.0f} %"
            print(f"seed {seed}, small motion: {text}", flush=True)
            chances += leaving
    for i, part in enumerate(np.mean(inside, axis=0)):
        print(f"follow_forecast_held_after_{i + 1}00_ms: {100 * part:.1f} %")
    print(f"follow_forecast_held: {100 * np.mean(inside):.1f} % of {len(inside)} forecasts")
    chance, left = np.array(chances).T
    for low, high in pairwise(CLASSES):
        here = (chance >= low) & ((chance < high) | (high == 1.0))
        if here.any():
            text = (
                f"{here.sum()} forecasts, mean {100 * chance[here].mean():.0f} %, left {100 * left[here].mean():.0f} %"
            )
            print(f"follow_forecast_chance_{low:g}_to_{high:g}: {text}")
    print(f"follow_forecast_left_limits: {100 * left.mean():.1f} %, forecast {100 * chance.mean():.1f} %")
    print(
        f"follow_forecast_brier: {np.mean((chance - left) ** 2):.3f} (always the mean: {left.mean() * (1 - left.mean()):.3f})"
    )


if __name__ == "__main__":
    main()
