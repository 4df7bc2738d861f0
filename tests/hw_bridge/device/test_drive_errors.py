"""Errors of the drives, what watches their supply and their heat, and their units, on motors of the twin."""

import pytest

from hw_bridge.device.motor import CYCLE
from hw_bridge.dictionary import Code, Mode, State
from tests.hw_bridge.bench import NODE, AbortedError


def test_following_error_as_in_the_manual(faulhaber):
    """The frame of the communications manual, 11 86 20 02 00 00 00 00, with bit 0 of 1001h, which CiA 301 asks for."""
    bench = faulhaber
    bench.write(0x6065, 100)
    bench.write(0x6066, 20)
    bench.enable(Mode.PP)
    bench.drive.axis.motor.load(-60.0)  # more than the motor can push [N]
    bench.write(0x607A, 5000)
    bench.control(0x1F)
    bench.go(300)
    assert bench.frames(0x080 + NODE)[0].hex(" ") == "11 86 21 02 00 00 00 00"
    assert bench.state is State.FAULT
    assert bench.read(0x603F) == 0x8611
    assert (bench.read(0x1003, 0), bench.read(0x1003, 1)) == (1, 0x8611)
    assert bench.read(0x1001) == 0x21
    bench.drive.axis.motor.load(0.0)
    bench.control(0x00, 0x80)
    assert bench.frames(0x080 + NODE) == [bytes(8)]
    assert (bench.read(0x1001), bench.read(0x603F)) == (0, 0)
    with pytest.raises(AbortedError) as found:
        bench.write(0x1003, 1)
    assert found.value.code is Code.VALUE_RANGE
    bench.write(0x1003, 0)
    assert bench.read(0x1003) == 0


def test_history_keeps_the_newest_first(bench):
    codes = sorted(bench.profile.faults)[:4]
    for code in codes:
        bench.drive.inject(code)
        bench.go(1)
    size = len(bench.drive.dictionary.objects[0x1003]) - 1
    kept = [bench.read(0x1003, place) for place in range(1, min(size, 4) + 1)]
    assert kept == codes[::-1][: len(kept)]


def test_every_error_ends_as_its_table_says(make, name):
    bench = make(name)
    for code, fault in bench.profile.faults.items():
        bench.drive.power_on()
        bench.drive.emergency.clear()
        bench.go(3)
        bench.enable(Mode.PV)
        bench.emergencies()
        bench.drive.inject(code, lasting=True)
        bench.go(50)
        trips = fault.reaction in ("fault, with reaction option 605Eh", "fault, power stage off at once")
        masked = bench.profile.masks  # of a new drive, and none trips then
        expected = State.FAULT if trips and not masked else State.ENABLED
        if fault.reaction == "abort connection option 6007h":
            expected = {"faulhaber_v3": State.FAULT, "epos2": State.ENABLED}.get(
                name, State.QUICK_STOP
            )  # 6007h: 1, 0, 3
        assert bench.state is expected, f"{code:04X}"
        assert bench.emergencies() == [code]
        bench.drive.remove(code)


def test_supply_voltage(epos):
    epos.enable(Mode.PV)
    epos.drive.supply = 60.0
    epos.go(5)
    assert epos.emergencies() == [0x3210]
    assert epos.state is State.FAULT
    assert epos.read(0x2200, 1) == 600
    epos.control(0x80)
    epos.go(5)
    assert epos.state is State.FAULT  # still too high
    epos.drive.supply = 24.0
    epos.control(0x00, 0x80)
    epos.go(5)
    assert epos.state is State.DISABLED


def test_the_supply_that_is_watched_drives_the_motor(make, name):
    """Half of the voltage: half of the current that a motor has when it is held."""
    bench = make(name)
    motor, found = bench.drive.axis.motor, []
    for voltage in (24.0, 12.0):
        bench.drive.supply = voltage
        assert motor.supply == voltage
        motor.set("resistance", 100.0)  # the current's limits are far
        motor.follow_velocity(1.0, 99.0)
        for cycle in range(100):
            motor.advance(cycle * CYCLE)
            motor.set("rotor_velocity" if name.startswith("epos") else "rod_velocity", 0.0)
        found.append(motor.current)
    assert found[0] == pytest.approx(2.0 * found[1], rel=0.05)


def test_i2t_takes_the_current_back(make):
    bench = make("mclm")
    bench.write(0x2350, 24, 4)
    bench.write(0x2350, 1000, 5)  # [ms]
    bench.enable(Mode.PP)
    bench.drive.axis.motor.load(-20.0)
    bench.write(0x607A, 5000)
    bench.control(0x1F)
    bench.go(100)
    assert bench.read(0x6078) > 1200
    bench.go(1500)
    assert bench.emergencies()[0] == 0x2310
    assert bench.read(0x2334) == 790
    assert abs(bench.read(0x6078)) <= 795
    assert bench.word & 0x0880 == 0x0880  # limited, and a warning


def test_the_factor_group_scales(faulhaber):
    bench = faulhaber
    bench.write(0x6092, 24, 1)  # 24 user units for one pitch: mm
    bench.enable(Mode.PP)
    bench.write(0x6081, 1000)
    bench.write(0x607A, 5)
    bench.control(0x1F)
    bench.go(500)
    assert bench.drive.axis.motor.position == pytest.approx(5e-3, abs=5e-5)


def test_velocity_unit_of_epos4(epos):
    """60A9h with the prefix milli: 60FFh in mrpm."""
    epos.write(0x60A9, 0xFDB44700)
    epos.write(0x607F, 5_000_000)
    epos.write(0x6080, 5_000_000)
    epos.enable(Mode.PV)
    epos.write(0x60FF, 120_500)
    epos.go(200)
    assert epos.read(0x606B) == 120_500
