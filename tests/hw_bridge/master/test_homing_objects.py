"""Objects of a homing: speeds in the drive's units, and its own force limits, which are only made narrower."""

import pytest

from hw_bridge.master.limits import LoweredLimit, lowered_for_homing
from tests.hw_bridge.master.test_limits import Bench


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "speed", "keys", "written"),
    [
        ("mclm", "10 mm/s", {}, (10, 5)),
        ("mclm", "15 mm/s", {}, (15, 7)),
        ("mclm", "10 mm/s", {"scale": 0.5}, (20, 10)),
        ("mclm", "1 mm/s", {}, (1, 1)),  # never 0: the drive would not move
        ("faulhaber_v3", "20 mm/s", {}, (20, 10)),
    ],
)
def test_speeds_of_a_homing(build, name, speed, keys, written):
    """Both of 6099h [mm/s]; the second, for what is measured, is half of the first."""
    units = {"units": {"acceleration": "1 mm/s^2"}} if name == "faulhaber_v3" else {}
    bench = Bench(
        name,
        build,
        {},
        homing={"method": 37 if name == "faulhaber_v3" else 35, "at": "0 mm", "speed": speed},
        **keys,
        **units,
    )
    bench.master.begin({"axis": 0.0})
    values = [bench.written[0x6099, sub] for sub in (1, 2) if (0x6099, sub) in bench.written]
    assert [each[0] for each in values] == list(written)[: len(values)]
    assert values
    bench.master.stop()


@pytest.mark.parametrize("before", [None, 0, 1999, 2000, 2001, 6000])
def test_force_limits_of_a_drive_are_only_lowered(build, before):
    """8 N, 80 % of the limit, at 4 N/A are 2 A: 2000 of a rated current of 1 A in thousandths."""
    bench = Bench("faulhaber_v3", build, {}, force_constant="4 N/A", units={"acceleration": "1 mm/s^2"})
    node = bench.master.nodes["axis"]
    node.keys = node.keys.model_copy(update={"limits": node.keys.limits.model_copy(update={"force": 10.0})})
    for index, sub, unit in node.profile.homing_force:
        value = int(2.0 / (unit or node.units.torque))
        shown = None if before is None else before * value // 2000
        lowered = [one for one in lowered_for_homing(node, lambda *_, shown=shown: shown) if one.index == index]
        expected = [LoweredLimit(index, sub, value, shown)] if shown is not None and shown > value else []
        assert lowered == (expected if sub in node.mirror.objects.get(index, {}) else [])
