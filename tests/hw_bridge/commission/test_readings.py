"""Approval test of what `twin hil status`, `check` and the comparison of limits read from each profile's drive.

`python -m tests.hw_bridge.commission.test_readings` writes the files anew; read the difference before it is committed.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.commission import BOOT, SdoSession, inspect, limits, status_report
from hw_bridge.device import Drive, Motor
from hw_bridge.hardware import HardwareKeys
from hw_bridge.profiles import DRIVE_PROFILES, profile

READINGS = Path(__file__).parent / "readings"


def lines(name: str, build: Path | None) -> Iterator[str]:
    """Every row and note about a drive with its factory settings, and a hardware file that states defaults only."""
    described = profile(name)
    bus = Bus()
    bus.attach(Drive(described, 1, Motor(described.motor, build=build)))
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": {"node": 1, "profile": name}}})
    session = SdoSession(SimulatedNetwork(bus), keys.nodes)
    session.wait(BOOT)
    node = session.drive("axis")
    node.rotary = described.motor.unit == "rad"
    for group, rows in status_report.status(node).groups.items():
        yield from (f"status, {group}: {label}: {value}" for label, value in rows)
    found = inspect(node)
    for group, checked in found.groups.items():
        yield from (f"check, {group}: {address} {label}: {value}" for address, label, value in checked)
    yield from (f"check, note: {note}" for note in found.notes)
    for row in limits.compare(node):
        yield f"limits: {row.name} {row.file:g} {row.unit}, of the drive {row.own:g} ({row.source})"


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_readings_are_as_recorded(name: str, build: Path) -> None:
    assert list(lines(name, build)) == (READINGS / f"{name}.txt").read_text().splitlines()


if __name__ == "__main__":
    READINGS.mkdir(exist_ok=True)
    for known in DRIVE_PROFILES:
        (READINGS / f"{known}.txt").write_text("\n".join(lines(known, Path("build"))) + "\n")
