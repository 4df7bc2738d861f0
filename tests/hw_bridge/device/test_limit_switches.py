"""Limit switches outside of homing: a closed one stops what moves towards it, and nothing else."""

import pytest

from hw_bridge.dictionary import Mode, State


def on_a_switch(make, name, side, mode):
    """An enabled drive that stands where the limit switch of one side begins to close."""
    bench = make(name)
    switches = bench.drive.axis.switches
    switches.negative, switches.positive = (1e-3, None) if side < 0 else (None, -1e-3)
    bench.enable(mode)
    return bench


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("name", ["faulhaber_v3", "epos4"])
def test_a_drive_without_a_demand_stays_on_it(make, name, side):
    bench = on_a_switch(make, name, side, Mode.CST)
    bench.go(20)
    assert bench.state is State.ENABLED
    assert not bench.word & 1 << 11
    assert bench.emergencies() == []


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("name", "error"), [("faulhaber_v3", []), ("epos4", [0x8A80])])
def test_it_is_left_in_one_direction_only(make, name, error, side):
    bench = on_a_switch(make, name, side, Mode.PV)
    bench.write(0x60FF, -5 * side)
    bench.control(0x0F)
    bench.go(40)
    away = bench.drive.axis.position
    assert away * side < 0.0
    assert (bench.state, bench.word & 1 << 11) == (State.ENABLED, 0)
    bench.write(0x60FF, 5 * side)
    bench.go(200)
    assert [code - (side > 0) for code in bench.emergencies()] == error
    assert bench.state is (State.FAULT if error else State.ENABLED)
    assert bool(error) or bench.word & 1 << 11
    assert abs(bench.drive.axis.velocity) < 1e-3
