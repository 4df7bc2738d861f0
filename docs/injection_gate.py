"""Write the tables of the needle's gate to docs/data, from runs made now.

python docs/injection_gate.py
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from figures import ROOT
from tables import write_data

from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable

    Row = tuple[str, Iterable[str], Iterable[int]]  # label, overrides, heart rates

SCENARIO = ROOT / "scenarios" / "injection_sequence.yaml"
RATES = (40, 48, 60, 75, 100, 125, 150)  # [1/min]
FEW_RATES = (48, 100)
SEEDS = (11, 12)  # no value of wall_rest was chosen with one of these
TARGETS = 3

OPTIONS = ("sequence.target_count=3", "stop_time=110 s")
# the gate that was there before: a fixed part of the beat, in which the plant's wall was said to rest
WINDOW = (
    (
        "injection_sequence, parameters: {enable: true}}",
        "injection_sequence, parameters: {enable: true, gate_center: 2.3, gate_width: 0.9}}",
    ),
    (
        "gate:        {component: heart_phase, parameters: {lead: 0 ms}}",
        "gate:        {component: heart_phase, parameters: {lead: 270 ms}}",
    ),
    (
        "  - rest.open -> sequence.gate\n",
        "  - gate.phase -> sequence.gate_phase\n  - gate.valid -> sequence.gate_valid\n",
    ),
)
# the same, put where the wall rests at 60 /min by what this gate finds, as somebody would who sees that the other is wrong
RETUNED = tuple(
    (old, new.replace("gate_center: 2.3, gate_width: 0.9", "gate_center: 0.19, gate_width: 0.69"))
    for old, new in WINDOW
)
GATES = {"window": WINDOW, "retuned window": RETUNED, "force": ()}
OWN_SYSTOLE = "heart.systole_by_rate=true"
WANDER, ECTOPIC, MISSED = "heart.wander=0.05", "heart.ectopic_every=12", ("gate.miss=0.03", "phase.miss=0.03")
FEEDFORWARD = (
    "feedforward.systole_deflection=0.97",
    "feedforward.systole_shift=[0, 0.22, -0.65]",
    "feedforward.systole_wall=[0, 0, -1.3]",
)
CONDITIONS: dict[str, tuple[str, ...]] = {
    "rate wanders by 5 %": (WANDER,),
    "one beat in twelve is ectopic": (ECTOPIC,),
    "3 % of the R waves are missed": MISSED,
    "all three": (WANDER, ECTOPIC, *MISSED),
    "fibrillation: 20 % from beat to beat": ("heart.irregularity=0.2",),
    "all three, systole of the feedforward off by 30 %": (WANDER, ECTOPIC, *MISSED, *FEEDFORWARD),
    "all three, the feedforward knows no systole": (WANDER, ECTOPIC, *MISSED, "feedforward.model=0"),
}
NAMES = ("entries", "resting", "entry_speed", "entry_speed_middle", "missed", "waited", "injected", "force_max")


@dataclass
class Group:
    """Metrics of runs that make one row."""

    values: dict[str, Any]

    @property
    def cells(self) -> str:
        """Entries at rest of entries, largest and middle speed, targets left out, time in contact for each target."""
        entries, resting = (int(self.values[name].sum()) for name in ("entries", "resting"))
        speeds = self.values["entry_speed"]
        largest = f"{np.nanmax(speeds):.2f}" if np.isfinite(speeds).any() else "-"
        middle = f"{np.nanmedian(self.values['entry_speed_middle']):.2f}" if np.isfinite(speeds).any() else "-"
        targets = TARGETS * len(speeds)
        without = targets - int(self.values["injected"].sum())
        waited = self.values["waited"].sum() / targets
        return f"{resting} of {entries}; {middle}, {largest}; {without} of {targets}; {waited:.1f} s"


def outcome(gate: str, options: Iterable[str], rates: Iterable[int], folder: Path) -> Group:
    """Runs of three targets at some rates."""
    found: dict[str, list[float]] = {name: [] for name in NAMES}
    for rate in rates:
        text = SCENARIO.read_text()
        for old, new in GATES[gate]:
            if old not in text:
                raise ValueError(f"{SCENARIO}: no {old.strip()!r} to replace. Adapt {__file__}")
            text = text.replace(old, new)
        scenario = parse_scenario(text, SCENARIO, [f"heart.rate={rate} /min", *OPTIONS, OWN_SYSTOLE, *options])
        metrics = run_scenario(
            scenario,
            RunOptions(
                backend=Backend.compiled,
                variants=["normal"],
                seeds=list(SEEDS),
                root=folder / "gate",
                build=ROOT / "build",
                report=False,
            ),
        ).summary["metrics"]
        for name in NAMES:
            found[name] += [
                np.nan if one is None else one for one in metrics[name]["variants"]["normal"]["values"].values()
            ]
    return Group({name: np.array(values, float) for name, values in found.items()})


def table(first: str, rows: Iterable[Row], folder: Path) -> str:
    """The gates side by side."""
    text = [f"| {first} | {' | '.join(GATES)} |", "|---" * (1 + len(GATES)) + "|"]
    for label, options, rates in rows:
        own = tuple(rates)
        text.append(f"| {label} | {' | '.join(outcome(gate, options, own, folder).cells for gate in GATES)} |")
        print(text[-1], flush=True)
    return "\n".join(text)


def main() -> None:
    """Write both tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        by_rate: list[Row] = [(f"{rate} /min", (), (rate,)) for rate in RATES]
        by_rate += [
            (f"{rate} /min, systole a fixed part", ("heart.systole_by_rate=false",), (rate,)) for rate in FEW_RATES
        ]
        write_data("needle_gate_rates", table("heart rate", by_rate, folder))
        conditions = [(label, options, FEW_RATES) for label, options in CONDITIONS.items()]
        write_data("needle_gate_conditions", table(f"at {', '.join(map(str, FEW_RATES))} /min", conditions, folder))


if __name__ == "__main__":
    main()
