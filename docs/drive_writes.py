"""Write docs/data/drive_writes.csv: every object that a run writes into a simulated drive of each profile.

python docs/drive_writes.py
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

from hw_bridge.commission import PlannedRow, planned_rows
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.plant import bench_network

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "docs" / "data" / "drive_writes.csv"
LIMITS = {
    "position": ["-35 mm", "35 mm"],
    "velocity": "100 mm/s",
    "force": "8 N",
    "following_error": "3 mm",
    "acceleration": "2 m/s^2",
}
NODES = {  # same settings as the hardware files of docs/tutorial/first_motion.md
    "faulhaber_v3": {"limits": LIMITS, "homing": {"method": -3, "at": "-40 mm", "speed": "20 mm/s"}},
    "mclm": {"limits": LIMITS, "homing": {"method": 35, "at": "0 mm", "speed": "20 mm/s"}},
    "epos4": {
        "scale": 1.5915e-3,
        "limits": {
            "position": ["-20 mm", "20 mm"],
            "velocity": "50 mm/s",
            "force": "250 N",
            "following_error": "2 mm",
            "acceleration": "1 m/s^2",
        },
        "homing": {"method": 37, "at": "0 mm", "speed": "10 mm/s"},
    },
}


def planned_writes(profile: str, build: Path) -> list[PlannedRow]:
    """Return the objects that a run writes into a simulated drive of a profile."""
    keys = HardwareKeys.model_validate(
        {"simulated": True, "nodes": {"axis": {"node": 1, "profile": profile, **NODES[profile]}}}
    )
    master = Master(keys, bench_network(keys, build))
    master.identify()
    return planned_rows(master.plan(master.nodes["axis"]))


def render_table(build: Path) -> str:
    """Return the CSV text for all profiles."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("profile", "object", "name", "before", "after", "reason"))
    for profile in NODES:
        writer.writerows((profile, *row) for row in planned_writes(profile, build))
    return text.getvalue()


def main() -> None:
    """Write the table."""
    TABLE.parent.mkdir(exist_ok=True)
    TABLE.write_text(render_table(ROOT / "build"))


if __name__ == "__main__":
    main()
