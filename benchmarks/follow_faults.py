"""Changes of a simulated rig, named: time to name, missed, wrong names, and false alarms per hour.

    python -m benchmarks.follow_faults [SEEDS [HOURS [FIRST]]]   a line per fault, then the table; seeds begin with FIRST, 1

Each fault begins at 6 s plus a part of a beat. A rig is followed for 15 s after that; what is named first counts. Faults that
are not in the list of changes must be called `none of these`. Sound rigs give the false alarms. What the follower does not
know of a rig is drawn from its seed (`benchmarks.follow_rig`).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.follow_rig import BUILD, hidden, record
from twin.follow import Follower, load
from twin.follow.changes import UNKNOWN
from twin.follow.problem import times_of

ONSET, AFTER = 6.0, 15.0  # [s]
GOAL = 10.0  # longest time to name a change [s]
SOUND = 60.0  # length of a recording of a sound rig [s]

# The rig's event for each change of the list, and the model's hypothesis. `zero`, `friction`: so that the zero begins to drift
# where it is, and that the friction of the rig is half as large again as it is.
FAULTS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "friction of the gripper's carriage": (
        {"servomotor.friction_coulomb": "1.05 N"},
        {"servomotor.friction_coulomb": "x0.7"},
    ),
    "friction of the sheath": ({"sheath.friction": ["0.9 N", "{friction} N", "1.2 N"]}, {"sheath.friction": "x1.5"}),
    "drift of the sensor's zero": (
        {"sensor.drift": "3e-3 N/s", "sensor.zero_offset": "{zero} N"},
        {"sensor.zero_offset": ["+8 mN", "-8 mN", "+20 mN", "-20 mN"]},
    ),
    "lost contact": ({"wall.surface_position": "80 mm"}, {"wall.surface_position": "80 mm"}),
    "stiff wall": ({"wall.wall_modulus": "1050 kPa"}, {"wall.wall_modulus": "x10"}),
    "slip of the encoder": ({}, {"servomotor.position_actual_value": ["+0.2 mm", "-0.2 mm", "+0.5 mm", "-0.5 mm"]}),
    "a cycle of delay": ({"sensor.latency": "5 ms"}, {"sensor.latency": "5 ms"}),
    "half the drive's bandwidth": (
        {"servomotor.velocity_gain": "7 A*s/m", "servomotor.velocity_integral": "437.5 A/m"},
        {"servomotor.velocity_gain": "x0.5", "servomotor.velocity_integral": "x0.5"},
    ),
}
UNLISTED: dict[str, dict[str, Any]] = {
    "metal near the tracker": {"tracker.distortion": "3 mm"},
    "kink of the sheath": {"sheath.stiffness": ["2200 N/m", "1500 N/m", "12000 N/m"]},
}
CHANGES = {"changes": {name: {"set": changed, "rate": 0.1} for name, (_, changed) in FAULTS.items()}}


def events(changed: dict[str, Any], at: float, seed: int) -> list[dict[str, Any]]:
    """Return the events of a rig at a time [s]."""
    own = {"zero": -0.003 * at, "friction": 1.5 * float(hidden(seed)["sheath"]["friction[2]"].split()[0])}
    values = {
        key: [item.format(**own) for item in value] if isinstance(value, list) else value.format(**own)
        for key, value in changed.items()
    }
    return [{"at": f"{at} s", "set": values}] if values else []


def alarms(folder: Path, seed: int, seconds: float, changed: dict[str, Any], at: float, slip: float = 0.0) -> Any:
    """Follow a rig; return the alarms and the fraction of NIS in its band before the onset."""
    path, _ = record(folder, seed, round(seconds, 3), events(changed, at, seed), (at, slip), CHANGES)
    problem, inside = load(path), []
    with Follower(problem, BUILD) as follower:
        for tick, measurements in times_of(problem).items():
            follower.advance(tick)
            estimate = follower.correct(measurements)
            if 1.0 < estimate.time < at:
                inside.append(estimate.is_in_band)
            if any(alarm.time > at for alarm in follower.alarms):
                break
        return follower.alarms, float(np.mean(inside))


def fault(folder: Path, name: str, seed: int) -> tuple[float, str, float]:
    """Follow a rig with a fault; return time to name [s], name (empty if missed) and error of the onset [s]."""
    at = round(ONSET + 0.17 * seed % 1.0, 3)
    changed = FAULTS[name][0] if name in FAULTS else UNLISTED[name]
    slip = 0.5e-3 if name == "slip of the encoder" else 0.0
    found, inside = alarms(folder, seed, at + AFTER, changed, at, slip)
    later = [alarm for alarm in found if alarm.time > at]
    early = [alarm.name for alarm in found if alarm.time <= at]
    first = later[0] if later else None
    print(
        f"{name}, seed {seed}: {first.name if first else 'missed'}"
        + (
            f" after {first.time - at:.1f} s, onset {first.onset - at:+.1f} s, p {first.probability:.3f}"
            if first
            else ""
        )
        + (f"; before: {', '.join(early)}" if early else "")
        + f"; NIS in band {100 * inside:.0f} %",
        flush=True,
    )
    return (first.time - at, first.name, first.onset - at) if first else (AFTER, "", np.nan)


def table(seeds: range) -> None:
    """Print a row for each fault."""
    rows, named, total = [], 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for name in [*FAULTS, *UNLISTED]:
            results = [fault(Path(folder), name, seed) for seed in seeds]
            right = name if name in FAULTS else UNKNOWN
            times = [time for time, given, _ in results if given == right]
            wrong = sum(given not in (right, "") for _, given, _ in results)
            missed = sum(given == "" for _, given, _ in results)
            median = f"{np.median(times):.1f}" if times else "-"
            rows.append((name, median, f"{max(times):.1f}" if times else "-", missed, wrong))
            if name in FAULTS:
                named, total = named + sum(time <= GOAL for time in times), total + len(results)
    print(f"\n{'fault':36}{'median [s]':>12}{'longest [s]':>12}{'missed':>8}{'wrong':>7}")
    for row in rows:
        print(f"{row[0]:36}{row[1]:>12}{row[2]:>12}{row[3]:8}{row[4]:7}")
    print(f"\nfollow_faults_named_within_10_s: {named} of {total}")


def false_alarms(hours: float, seed: int) -> None:
    """Print the false alarms of sound rigs, from a seed on."""
    count, seconds = 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        while seconds < 3600.0 * hours:
            found, inside = alarms(Path(folder), seed, SOUND, {}, SOUND)
            names = ", ".join(f"{alarm.name} at {alarm.time:.1f} s" for alarm in found)
            print(f"sound rig, seed {seed}: {names or 'no alarm'}; NIS in band {100 * inside:.0f} %", flush=True)
            count, seconds, seed = count + len(found), seconds + SOUND, seed + 1
    print(f"follow_false_alarms: {count} in {seconds / 3600.0:.2f} h")


def main() -> None:
    """Print the table and the false alarms."""
    count, hours, first = (*map(float, sys.argv[1:]), *(3.0, 1.0, 1.0)[len(sys.argv) - 1 :])
    table(range(int(first), int(first + count)))
    false_alarms(hours, 999 + int(first))


if __name__ == "__main__":
    main()
