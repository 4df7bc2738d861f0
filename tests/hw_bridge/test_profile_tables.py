"""Approval test of the profiles' tables: they are as recorded, so a change is deliberate and visible in the difference.

It does not show that the tables are those of the vendors: that is for who changes them, with the manual.

`python -m tests.hw_bridge.test_profile_tables` writes them anew; read the difference against the manual before it is committed.
"""

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from hw_bridge.profiles import DEVICES, DRIVE_PROFILES, GENERIC, MOTORS, GivenUnits, device, generic, profile
from tests.every_case import every_case

TABLES = Path(__file__).parent / "profile_tables"
NAMES = sorted({*DEVICES, *DRIVE_PROFILES, *GENERIC})
LISTED = {"objects", "faults", "homing", "setup"}


def lines(name: str) -> Iterator[str]:
    """Everything of a profile that is a value: its objects, errors, homing methods, writes, then single fields."""
    if name in GENERIC:
        described = generic((), GivenUnits(), GENERIC[name])  # what it has without a file
    else:
        described = device(name) if name in DEVICES else profile(name)
    for entry in described.objects:
        yield (
            f"{entry.index:04X}h.{entry.sub} {entry.type.name} {entry.access} {entry.default!r} {entry.low} {entry.high} "
            f"{entry.mappable} {entry.name}"
        )
    for code, fault in described.faults.items():
        yield f"fault {code:04X}h {fault!r}"
    for number, moves in getattr(described, "homing", {}).items():
        yield f"homing {number} " + " ".join(
            f"{move.direction:+d}{move.until.name}{move.slow:d}{move.closed:d}" for move in moves
        )
    for write in getattr(described, "setup", ()):
        yield f"setup {write!r}"
    for field in fields(described):
        value = getattr(described, field.name)
        if field.name not in LISTED and not callable(value):
            yield f"{field.name} {sorted(value) if isinstance(value, frozenset) else value!r}"


@every_case("name", NAMES)
def test_a_profile_is_as_recorded(name):
    assert list(lines(name)) == (TABLES / f"{name}.txt").read_text().splitlines()


def test_motors_are_as_recorded():
    assert [f"{name} {motor!r}" for name, motor in MOTORS.items()] == (TABLES / "motors.txt").read_text().splitlines()


if __name__ == "__main__":
    for known in NAMES:
        (TABLES / f"{known}.txt").write_text("\n".join(lines(known)) + "\n")
    (TABLES / "motors.txt").write_text("".join(f"{name} {motor!r}\n" for name, motor in MOTORS.items()))
