"""Traps of the real drives, `facts/hardware.md` section 0: each is there."""

import pytest

from hw_bridge.dictionary import Mode, State
from tests.hw_bridge.bench import NODE, AbortedError, Code


def test_1_epos4_has_only_tpdo1_by_default(make):
    bench = make("epos4")
    assert bench.read(0x1800, 1) == 0x40000180 + NODE
    assert [bench.read(0x1801 + n, 1) for n in range(3)] == [0xC0000000 + 0x280 + 0x100 * n + NODE for n in range(3)]
    assert all(bench.read(0x1400 + n, 1) == 0x200 + 0x100 * n + NODE for n in range(4))
    bench.nmt(1)
    bench.go(5)
    assert bench.frames(0x180 + NODE)
    assert not [frame for _, frame in bench.master.received if frame.id in (0x283, 0x383, 0x483)]


def test_2_mclm_clips_at_9996_um_until_607d_is_written(make):
    bench = make("mclm")
    bench.write(0x2350, 24, 4)
    bench.enable(Mode.PP)
    bench.write(0x607A, 20000)
    bench.control(0x3F, 0x0F)
    bench.go(1000)
    assert bench.read(0x6064) == pytest.approx(9996, abs=8)
    bench.write(0x607D, 40000, 2)
    bench.control(0x3F, 0x0F)
    bench.go(1000)
    assert bench.read(0x6064) == pytest.approx(20000, abs=8)


@pytest.mark.parametrize(("pitch", "moved"), [(18, 8e-3), (24, 6e-3)])
def test_3_mclm_moves_by_its_configured_pitch(make, pitch, moved):
    bench = make("mclm")
    bench.write(0x2350, pitch, 4)
    bench.enable(Mode.PP)
    bench.write(0x607A, 6000)
    bench.control(0x3F)
    bench.go(1000)
    assert bench.read(0x6064) == pytest.approx(6000, abs=8)
    assert bench.drive.axis.motor.position == pytest.approx(moved, abs=2e-5)


@pytest.mark.parametrize("name", ["mclm", "epos4", "faulhaber_v3"])
def test_4_every_default_rpdo_carries_the_controlword(make, name):
    bench = make(name)
    assert all(bench.read(0x1600 + n, 1) == 0x60400010 for n in range(4))
    bench.enable(Mode.PV)
    bench.nmt(1)
    bench.send(0x400 + NODE, [0, 0, 1, 0, 0, 0] if name != "epos4" else [0, 0, 0, 0, 0, 0])
    bench.go(2)
    assert bench.state is State.DISABLED  # 6040h = 0 in RPDO3 switched the motor off


def test_5_epos4_trips_when_cyclic_targets_stay_away(make):
    bench = make("epos4")
    bench.write(0x60C2, 5, 1)
    bench.nmt(1)
    bench.enable(Mode.CSP)
    for _ in range(10):
        bench.send(0x400 + NODE, [0x0F, 0, 0, 0, 0, 0])
        bench.go(4.5)
    assert bench.state is State.ENABLED
    assert bench.emergencies() == []
    bench.go(20)
    assert bench.emergencies() == [0x8250]
    bench.go(100)
    assert bench.state is State.FAULT
    bench.control(0x80, 0x06, 0x07, 0x0F)
    assert bench.state is State.ENABLED
    assert bench.emergencies() == [0]


@pytest.mark.parametrize(("name", "right", "wrong"), [("epos4", 37, 35), ("mclm", 35, 37), ("faulhaber_v3", 37, 35)])
def test_6_homing_on_the_spot_has_different_numbers(make, name, right, wrong):
    bench = make(name)
    with pytest.raises(AbortedError) as refused:
        bench.write(0x6098, wrong)
    assert refused.value.code in (Code.VALUE_RANGE, Code.VALUE_TOO_HIGH)
    bench.write(0x6098, right)
    bench.enable(Mode.HM)
    bench.control(0x1F)
    bench.go(5)
    assert bench.word & 0x3400 == 0x1400
    assert bench.read(0x6064) == 0
