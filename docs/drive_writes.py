"""Write the tables of docs/how-to/drive_writes.md anew: what a run writes into a simulated drive of each profile.

python docs/drive_writes.py
"""

from __future__ import annotations

from pathlib import Path

from hw_bridge.commission import PlannedRow, planned_rows
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.plant import bench_network

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "how-to" / "drive_writes.md"
LIMITS = {"position": ["-35 mm", "35 mm"], "velocity": "100 mm/s", "force": "8 N", "following_error": "3 mm",
          "acceleration": "2 m/s^2"}  # fmt: skip
NODES = {  # those of the benches of the first motion
    "faulhaber_v3": {"limits": LIMITS, "homing": {"method": -3, "at": "-40 mm", "speed": "20 mm/s"}},
    "mclm": {"limits": LIMITS, "homing": {"method": 35, "at": "0 mm", "speed": "20 mm/s"}},
    "epos4": {
        "scale": 1.5915e-3,
        "limits": {"position": ["-20 mm", "20 mm"], "velocity": "50 mm/s", "force": "250 N", "following_error": "2 mm",
                   "acceleration": "1 m/s^2"},
        "homing": {"method": 37, "at": "0 mm", "speed": "10 mm/s"},
    },
}  # fmt: skip


def rows(profile: str, build: Path) -> list[PlannedRow]:
    """What a run writes into a simulated drive of a profile."""
    keys = HardwareKeys.model_validate(
        {"simulated": True, "nodes": {"axis": {"node": 1, "profile": profile, **NODES[profile]}}}
    )
    master = Master(keys, bench_network(keys, build))
    master.identify()
    return planned_rows(master.plan(master.nodes["axis"]))


def table(profile: str, build: Path) -> str:
    """The same as a table of Markdown."""
    lines = ["| object | name | before | after | why |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows(profile, build)]
    return "\n".join(lines) + "\n"


def marked(profile: str) -> tuple[str, str]:
    """Between these lines of the page a table stands."""
    return f"<!-- writes of {profile} -->\n", f"<!-- end of {profile} -->\n"


def main() -> None:
    """Replace each table."""
    text = PAGE.read_text()
    for profile in NODES:
        begin, end = marked(profile)
        before, _, rest = text.partition(begin)
        _, _, after = rest.partition(end)
        text = f"{before}{begin}\n{table(profile, ROOT / 'build')}\n{end}{after}"
    PAGE.write_text(text)


if __name__ == "__main__":
    main()
