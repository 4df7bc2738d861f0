"""Write the tables of cross-validated errors in docs/explanation and of bands in docs/data, from validation/.

python docs/measured_machines.py
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tables import write_data, write_table

from twin.validation import read_frozen

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin.validation import FrozenSet

ROOT = Path(__file__).parents[1]
NAMES = {
    "line": "straight line",
    "play_cubic": "plays with cubic",
    "linear_second_order": "linear, second order",
    "narx": "black box: recurrent network (NARX)",
    "network": "black box: static network",
    "play_network": "black box: network of plays",
}
MACHINES = {
    "tendon_robot": ("tendon_robot", "docs/explanation/tendon_robot.md"),
    "ablation_catheter": ("ablation_catheter", "docs/explanation/measured_machines.md"),
    "nine_tendon_robot": ("nine_tendon_robot", "docs/explanation/measured_machines.md"),
}


def frozen_sets(machine: str) -> dict[str, FrozenSet]:
    """Frozen sets of a machine by name."""
    return read_frozen(ROOT / "validation" / f"{machine}.yaml")


def spread(values: Sequence[float], unit: str) -> str:
    """Mean, least and largest value."""
    numbers = [format(value, "#.3g").rstrip(".") for value in (np.mean(values), min(values), max(values))]
    return f"{numbers[0]} ({numbers[1]} to {numbers[2]}) {unit}"


def errors(machine: str) -> str:
    """RMS errors of left-out folds: the model and its baselines as rows, sets and quantities as columns."""
    columns = [(name, frozen, quantity) for name, frozen in frozen_sets(machine).items() for quantity in frozen.band]
    predictors = list(dict.fromkeys(key for _, frozen, _ in columns for key in frozen.baselines))
    head = [f"{name}, {quantity}" for name, _, quantity in columns]
    lines = [f"| predicted by | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    for predictor in ["model", *predictors]:
        cells = []
        for _, frozen, quantity in columns:
            rows = [row for row in frozen.cross_validation if row["quantity"] == quantity]
            values = [row["rmse"] if predictor == "model" else row["baselines"].get(predictor) for row in rows]
            cells.append(spread(values, rows[0]["unit"]) if None not in values else "")
        lines.append(f"| {NAMES.get(predictor, predictor)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def bands() -> str:
    """Share of left-out samples in the band of 90 %, per machine, set and quantity."""
    lines = ["| machine | set, quantity | half width | each fold left out | mean |", "|---|---|---|---|---|"]
    for machine in MACHINES:
        for name, frozen in frozen_sets(machine).items():
            for quantity, band in frozen.band.items():
                unit = next(row["unit"] for row in frozen.cross_validation if row["quantity"] == quantity)
                shares = [f"{100 * share:.0f}" for share in band["coverages"]]
                lines.append(
                    f"| {machine.replace('_', ' ')} | {name}, {quantity} | {band['half_width']:#.3g} {unit} "
                    f"| {', '.join(shares)} % | {100 * np.mean(band['coverages']):.0f} % |"
                )
    return "\n".join(lines)


ALARM_ROWS = 20  # rows of the shortest parts in the table


def false_alarms() -> str:
    """Share of parts of left-out folds that the consistency test flags, per set and quantity."""
    lines = ["| machine | set, quantity | rows of a part: flagged of all parts |", "|---|---|---|"]
    for machine in MACHINES:
        for name, frozen in frozen_sets(machine).items():
            for quantity, levels in frozen.false_alarms.items():
                shown = [level for level in levels[::2] if level["rows"] >= ALARM_ROWS]
                cells = [f"{level['rows']}: {level['alarms']}/{level['parts']}" for level in shown]
                lines.append(f"| {machine.replace('_', ' ')} | {name}, {quantity} | {'; '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Write all tables."""
    for machine, (table, page) in MACHINES.items():
        write_table(page, table, errors(machine))
    write_data("measured_machines_bands", bands())
    write_data("measured_machines_false_alarms", false_alarms())


if __name__ == "__main__":
    main()
