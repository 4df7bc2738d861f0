"""Simulated rig for the benchmarks of following: a gripper holds a tip on a moving wall, with hidden parameters and noise.

Heart, controller, drive, sheath, wall, force sensor and tracker are shipped members. The followed model knows the recorded
target velocity of the drive and the position of the wall's motor; it measures force, encoder, current, and the tracked tip. What
it does not know is drawn from the seed of a rig: the place of the wall, the sensor's zero error, play and friction of the sheath, noise.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import yaml
from pyarrow import parquet

from twin.run import build_simulation, noop, resolve_catalogs, run_case
from twin.scenario import Backend, load_scenario

if TYPE_CHECKING:
    from collections.abc import Mapping

BUILD = Path("build")
ENCODER, CURRENT = 10e-6, 50e-3  # standard deviations of the noise that the benchmark adds [m], [A]

MEMBERS: dict[str, dict[str, Any]] = {
    "heart": {"component": "heart", "parameters": {"wander": 0.03, "irregularity": 0.03}},
    "controller": {
        "component": "pi_feedforward_control",
        "parameters": {"setpoint": "0.2 N", "proportional": "100 mm/(s*N)", "integral": "0 mm/(s^2*N)"},
    },
    "servomotor": {"component": "servomotor"},
    "sheath": {"component": "sheath"},
    "wall": {"component": "wall", "parameters": {"free_length": "20 mm", "surface_position": "-2.4 mm"}},
    "sensor": {"component": "force_sensor"},
    "tracker": {"component": "em_tracker"},
}
CONNECTIONS = [
    "heart.position -> wall.heart_position, controller.heart_position",
    "sensor.measured_force -> controller.force",
    "controller.target_velocity -> servomotor.target_velocity",
    "servomotor.position -> sheath.gripper_position, tracker.reference",
    "sheath.reaction_force -> servomotor.load_force",
    "sheath.tip_position -> wall.tip_position, tracker.position",
    "wall.force -> sheath.contact_force, sensor.force",
]
# The followed model neither adds noise nor rounds. The points of the filter differ by less than a step of the encoder: a rounded
# output is a staircase between them, from which the filter learns what was not measured. Rounding is part of the noise.
PERFECT = {
    "sensor": {"noise": "0 N", "zero_deviation": "0 N", "drift_maximum": "0 N/s", "resolution": "1e-9 N"},
    "servomotor": {"position_resolution": "1e-9 m"},
}

FOLLOW: dict[str, Any] = {
    "scenario": "model.yaml",
    "data": ["fast.parquet", "slow.parquet", "tracked.parquet"],
    "inputs": {
        "heart.position [m]": "heart.position",
        "controller.target_velocity [m/s]": "controller.target_velocity",
    },
    "outputs": {
        "sensor.measured_force [N]": {"signal": "sensor.measured_force", "noise": "3.13 mN"},
        "servomotor.position_actual_value [m]": {"signal": "servomotor.position_actual_value", "noise": "10.5 um"},
        "servomotor.current [A]": {"signal": "servomotor.current", "noise": "52 mA"},
        "tracker.measured_position [m]": {"signal": "sheath.tip_position", "noise": "0.2 mm", "delay": "25 ms"},
    },
    "estimate": {
        "sheath.play[3]": {"deviation": "15 um", "walk": "4 um", "from": "0 mm", "to": "1 mm"},
        "sheath.friction[2]": {"deviation": "0.04 N", "walk": "2 mN", "from": "0.1 N", "to": "3 N"},
        "wall.surface_position": {"deviation": "0.2 mm", "walk": "10 um"},
        "sensor.zero_offset": {"deviation": "2 mN", "walk": "0.3 mN"},
        # the first two act through the positions of the sheath, and the drive's loop holds the position by its integral
        **{f"sheath.position[{i}]": {"deviation": "10 um", "walk": "10 um"} for i in (1, 2, 3)},
        "servomotor.current_integral": {"deviation": "20 mA", "walk": "20 mA"},
        # the encoder measures the rod; the drive differentiates what it measured last, so that this moves with the rod
        "servomotor.rod_position": {"deviation": "5 um", "walk": "1 um"},
        "servomotor.measured_position": {"deviation": "5 um"},
        # The sensor samples at the instant of a correction: without these two, the force that it is predicted to sample there
        # depends neither on a corrected tip nor on the wall that has given way, but on the place of a rigid wall.
        "wall.indentation": {"deviation": "10 um", "walk": "10 um"},
        "wall.tip_position": {"deviation": "10 um"},
    },
}
COLUMNS = {
    "fast": (1, {"heart.position": "m", "controller.target_velocity": "m/s"}),
    "slow": (5, {"sensor.measured_force": "N", "servomotor.position_actual_value": "m", "servomotor.current": "A"}),
    "tracked": (25, {"tracker.measured_position": "m"}),
}  # period [ms] and columns of each file


def hidden(seed: int) -> dict[str, dict[str, Any]]:
    """Return the parameters of a rig that the followed model does not know."""
    random = np.random.default_rng(seed)
    surface, play, friction = random.standard_normal(3)
    return {
        "heart": {"seed": 100 + seed},
        "sensor": {"seed": 200 + seed},
        "tracker": {"seed": 300 + seed},
        "wall": {"surface_position": f"{-2.4 + 0.2 * surface} mm"},
        "sheath": {
            "play[3]": f"{0.3 * (1.0 + 0.05 * play)} mm",
            "friction[2]": f"{0.8 * (1.0 + 0.05 * friction)} N",
        },
    }


def scenario(stop: float, parameters: Mapping[str, Mapping[str, Any]], events: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the keys of a scenario with other parameters."""
    members = {
        name: {**keys, "parameters": {**keys.get("parameters", {}), **parameters.get(name, {})}}
        for name, keys in MEMBERS.items()
    }
    keys = {"title": "Rig", "stop_time": f"{stop} s", "step": "1 ms", "members": members, "connections": CONNECTIONS}
    return keys | {"events": events, "record": {"every": "1 ms", "variables": ["*.*"]}}


def record(
    folder: Path,
    seed: int,
    seconds: float,
    events: list[dict[str, Any]],
    slip: tuple[float, float] = (0.0, 0.0),
    follow: Mapping[str, Any] | None = None,
) -> tuple[Path, dict[str, np.ndarray[Any, Any]]]:
    """Write model, recording and follow file of a rig; return the latter and all signals of the rig.

    `slip`: time [s] and size [m] of a slip of the encoder; `follow`: further keys of the follow file.
    """
    (folder / "model.yaml").write_text(yaml.safe_dump(scenario(seconds, PERFECT, []), sort_keys=False))
    (folder / "rig.yaml").write_text(yaml.safe_dump(scenario(seconds, hidden(seed), events), sort_keys=False))
    rig = load_scenario(folder / "rig.yaml")
    (case,) = rig.cases()
    simulation = build_simulation(case, resolve_catalogs(rig)[case.variant], Backend.compiled, BUILD)
    try:
        run_case(case, simulation, noop)
        recording = simulation.recording()
    finally:
        simulation.terminate()
    signals, time, random = dict(recording.signals), recording.time, np.random.default_rng(1000 + seed)
    encoder = signals["servomotor.position_actual_value"] + ENCODER * random.standard_normal(len(time))
    measured = signals | {
        "servomotor.position_actual_value": encoder + slip[1] * (time >= slip[0]),
        "servomotor.current": signals["servomotor.current"] + CURRENT * random.standard_normal(len(time)),
    }
    for name, (period, columns) in COLUMNS.items():
        rows = slice(period if name == "tracked" else 0, None, period)
        table = {"time [s]": time[rows], **{f"{key} [{unit}]": measured[key][rows] for key, unit in columns.items()}}
        parquet.write_table(pa.table(table), folder / f"{name}.parquet")
    path = folder / "follow.yaml"
    path.write_text(yaml.safe_dump({**FOLLOW, **(follow or {})}, sort_keys=False))
    return path, {"time": time, **signals}
