"""Whether a drive turns or moves along a line: by the units of its file, else by its motor; what a person types follows it."""

from math import radians

import pytest

from hw_bridge.commission import axis
from hw_bridge.hardware import load
from twin.errors import ScenarioError, SimulationError

NONE = ""
LINE = ", limits: {position: [-40 mm, 40 mm], velocity: 100 mm/s}"
TURN = ", limits: {position: [-90 deg, 90 deg], velocity: 100 deg/s, following_error: 2 deg}"
BOTH = ", limits: {position: [-90 deg, 90 deg], velocity: 100 mm/s}"


def drive(tmp_path, profile, limits):
    path = tmp_path / "bench.yaml"
    path.write_text(f"simulated: true\nnodes:\n  shaft: {{node: 3, profile: {profile}{limits}}}\n")
    return axis(path, load(path), "3")


@pytest.mark.parametrize(
    ("profile", "limits", "rotary"),
    [
        ("epos4", NONE, True),  # a motor that turns
        ("faulhaber_v3", NONE, False),  # linear motors
        ("mclm", NONE, False),
        ("epos4", f", scale: 0.001{LINE}", False),  # a spindle on it
        ("epos4", TURN, True),
        ("faulhaber_v3", LINE, False),
        ("mclm", f", scale: 20{TURN}", True),  # a pinion
    ],
)
def test_what_a_drive_moves_and_how_it_is_told(tmp_path, profile, limits, rotary):
    found = drive(tmp_path, profile, limits)
    assert (found.name, found.rotary, found.unit) == ("shaft", rotary, "rad" if rotary else "m")
    own, other = ("5 deg", "5 mm") if rotary else ("5 mm", "5 deg")
    assert found.si(own, "--by") == pytest.approx(radians(5.0) if rotary else 5e-3)
    assert found.si(f"{own}/s", "--speed", "/s") == pytest.approx(radians(5.0) if rotary else 5e-3)
    assert found.format_quantity(found.si(own, "--by")) == own
    with pytest.raises(SimulationError):
        found.si(other, "--by")


def test_quantities_of_both_kinds_are_refused(tmp_path):
    with pytest.raises(
        ScenarioError, match="`100 mm/s` is of one that moves along a line, `90 deg` of an axis that turns"
    ):
        drive(tmp_path, "epos4", BOTH)


@pytest.mark.parametrize(("profile", "limits", "unit"), [("epos4", LINE, "rad"), ("mclm", TURN, "m")])
def test_a_gear_between_kinds_has_to_be_given_before_a_command_moves_it(tmp_path, profile, limits, unit):
    """Else a degree would be 17 mm of a linear motor."""
    with pytest.raises(
        SimulationError,
        match=rf"nodes\.shaft: the motor of .* Add `scale`, the member's way for 1 {unit} of the motor\.",
    ):
        drive(tmp_path, profile, limits)
