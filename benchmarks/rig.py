"""The whole rig on one core: how many times faster than real time, which member takes how much, and the long scenario.

    python -m benchmarks.rig             prints `name: value` lines

Real-time factors and costs of members are measured as in `benchmarks.force`, in `scenarios/racs.yaml`: 100 mm in and
out at 20 mm/s. The long scenario is 500 mm in and out at 5 mm/s; its time is that of the stepping with its recording.
"""

from __future__ import annotations

import statistics
from pathlib import Path

from benchmarks.force import figures, one_core, stepping
from twin.run import resolve_catalogs
from twin.scenario import Backend, load_scenario

RIG = Path("scenarios/racs.yaml")
LONG = Path("scenarios/dynamic_regripping.yaml")
SLOWEST = ("catheter, 5 mm/s", "guidewire, 5 mm/s")
REPEATS = 5
INTERPRETED_NS = 20_000_000  # simulated time of the interpreted form


def measure(overrides: tuple[str, ...] = (), repeats: int = REPEATS) -> None:
    """Print the figures of the rig, with the first seed."""
    scenario = load_scenario(RIG, overrides)
    case = scenario.variants[0]
    figures("rig", case, resolve_catalogs(scenario)[case.variant], repeats, INTERPRETED_NS)


def long(overrides: tuple[str, ...] = (), repeats: int = REPEATS) -> None:
    """Print wall time and real-time factor of the longest experiment."""
    scenario = load_scenario(LONG, overrides)
    catalogs = resolve_catalogs(scenario)
    for case in scenario.variants:
        if case.variant not in SLOWEST:
            continue
        instrument = case.variant.partition(",")[0]
        for form in (Backend.fmu, Backend.compiled):
            took = statistics.median(stepping(case, catalogs[case.variant], form, case.stop_ns) for _ in range(repeats))
            head = f"rig_long_{instrument}_{form.value}"
            print(f"{head}_s: {took:.2f}")
            print(f"{head}_factor: {1e-9 * (case.stop_ns - case.start_ns) / took:.0f}", flush=True)


def main() -> None:
    """Print the figures, on one core."""
    one_core()
    measure()
    long()


if __name__ == "__main__":
    main()
