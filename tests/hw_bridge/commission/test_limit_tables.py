"""Tables of limits that `check` shows: where each acts, and the drive's own beside those of the file, in SI."""

import pytest

from hw_bridge.commission.limit_effects import grouped, rows
from hw_bridge.commission.limits import compare
from hw_bridge.hardware import HardwareKeys
from tests.hw_bridge.axis import node
from tests.hw_bridge.master.test_limits import Bench

LIMITS = {"velocity": "50 mm/s", "acceleration": "2 m/s^2"}


def keys(*profiles, **more):
    nodes = {
        f"axis{number}": node(profile, number, limits=LIMITS, **more) for number, profile in enumerate(profiles, 1)
    }
    return HardwareKeys.model_validate({"simulated": True, "cycle": "5 ms", "nodes": nodes})


@pytest.mark.parametrize(
    ("profile", "velocity", "acceleration"),
    [
        ("faulhaber_v3", "targets of csv, to 80 %; ", "targets of csp and csv; in cst"),
        ("mclm", "targets of pv, instead of csp and csv, to 80 %; ", "targets of pp and pv; the drive's 6083h"),
    ],
)
def test_modes_in_which_a_limit_acts(profile, velocity, acceleration):
    found = keys(profile)
    texts = dict(rows(found, found.nodes["axis1"]))
    assert texts["velocity"].startswith(velocity)
    assert texts["acceleration"].startswith(acceleration)
    assert texts["acceleration"].endswith("it takes 25 ms to stop")
    assert ("targets of cst" in texts["force"]) is (profile == "faulhaber_v3")


@pytest.mark.parametrize(
    ("given", "shown"), [({}, "21.25 ms at SYNC: "), ({"actual_value_age": "12.5 ms"}, "12.5 ms at SYNC: ")]
)
def test_how_old_actual_values_may_be(given, shown):
    found = HardwareKeys.model_validate(
        {"simulated": True, "cycle": "5 ms", "nodes": {"axis": node("faulhaber_v3", limits=given)}}
    )
    assert dict(rows(found, found.nodes["axis"]))["actual_value_age"].startswith(shown)


@pytest.mark.parametrize("absent", [(), (0x6080,), (0x607F, 0x6080), (0x607D, 0x6065)])
def test_objects_that_a_drive_does_not_have_are_not_named(absent):
    found = keys("faulhaber_v3")
    texts = " ".join(text for _, text in rows(found, found.nodes["axis1"], absent))
    for index in (0x607D, 0x607F, 0x6080, 0x6065):
        assert (f"{index:04X}h" in texts) is (index not in absent)


def test_drives_with_equal_effects_share_a_table():
    found = keys("faulhaber_v3", "mclm", "faulhaber_v3")
    assert [names for names, _ in grouped(found, {})] == [["axis1", "axis3"], ["axis2"]]
    assert [names for names, _ in grouped(found, {"axis3": (0x6080,)})] == [["axis1"], ["axis2"], ["axis3"]]


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_limits_of_the_drive_in_si(build, scale):
    """Units of an MCLM are 1 mm/s and 1 um."""
    own = {(0x607F, 0): 150, (0x607D, 1): -5000, (0x607D, 2): 7500}
    bench = Bench("mclm", build, own, scale=scale)
    bench.master.wait(500_000_000)
    found = {row.source: row for row in compare(bench.master.nodes["axis"])}
    assert found["607Fh"].own == pytest.approx(0.150 * scale)
    assert found["607Dh"].own == pytest.approx(12_500e-6 * scale)
    assert (found["607Fh"].file, found["607Dh"].file) == pytest.approx((0.9, 0.6))
    assert (found["607Fh"].unit, found["607Dh"].unit) == ("m/s", "m")


@pytest.mark.parametrize(
    ("span", "is_limit"), [(0, False), (-1, False), (1, True), (0x7FFFFFFE, True), (0x7FFFFFFF, False)]
)
def test_a_range_that_is_none_or_open_is_no_limit(build, span, is_limit):
    low = -(span // 2)
    bench = Bench("mclm", build, {(0x607D, 1): low, (0x607D, 2): low + span})
    bench.master.wait(500_000_000)
    assert any(row.source == "607Dh" for row in compare(bench.master.nodes["axis"])) is is_limit
