"""Modes, options and limits of the drives, on motors of the twin."""

import struct

import pytest

from hw_bridge.dictionary import Mode, State
from tests.hw_bridge.bench import NODE, AbortedError

ACKNOWLEDGE, REACHED, LIMITED = 0x1000, 0x0400, 0x0800


def test_only_the_vendors_modes(bench):
    offered = bench.read(0x6502)
    for mode in Mode:
        if mode and not offered >> (mode - 1) & 1:
            with pytest.raises(AbortedError):
                bench.write(0x6060, mode)
        elif mode:
            bench.write(0x6060, mode)
            assert bench.read(0x6061) == mode
    assert offered == (0x25 if bench.profile.name in ("mclm", "epos2") else 0x3A5)
    with pytest.raises(AbortedError):
        bench.write(0x6060, 7)  # interpolated position


@pytest.mark.parametrize(("absent", "expected"), [((), 2.0), ((0x6085,), 3.0), ((0x6084, 0x6085), 5.0)])
def test_another_ramp_acts_for_one_that_a_drive_has_not(faulhaber, absent, expected):
    for index, value in ((0x6083, 5000), (0x6084, 3000), (0x6085, 2000)):
        faulhaber.write(index, value)
    for index in absent:
        faulhaber.drive.dictionary.remove(index)
    assert faulhaber.drive.axis.rate(0x6085) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("faulhaber_v3", [0x0250, 0x0231, 0x0233, 0x0237, 0x0250]),  # bit 4: supply; no mode by default; 605Ah = 2
        ("mclm", [0x0250, 0x0231, 0x0233, 0x0637, 0x0250]),
        ("epos4", [0x0240, 0x0221, 0x0233, 0x0637, 0x0217]),  # bit 4: power stage; 605Ah = 6
    ],
)
def test_statuswords(make, name, words):
    bench = make(name)
    bench.nmt(1)
    assert bench.read(0x6041) == bench.word
    seen = [bench.word]
    for controlword in (0x06, 0x07, 0x0F, 0x02):
        bench.send(0x200 + NODE, [controlword, 0])
        bench.go(2)
        seen.append(bench.word)
    assert [f"{word:04X}" for word in seen] == [f"{word:04X}" for word in words]


# ---------------------------------------------------------------------------------------------------------------- pp


def test_set_point_handshake(faulhaber):
    bench = faulhaber
    bench.enable(Mode.PP)
    bench.write(0x607A, 5000)
    bench.control(0x1F)
    assert bench.word & (ACKNOWLEDGE | REACHED) == ACKNOWLEDGE
    bench.control(0x0F)
    assert bench.word & ACKNOWLEDGE == 0
    bench.write(0x607A, 8000)
    bench.control(0x1F, 0x0F)  # a second one waits
    assert bench.word & ACKNOWLEDGE == ACKNOWLEDGE  # the buffer is full although bit 4 has fallen
    bench.write(0x607A, 1000)
    bench.control(0x1F, 0x0F)  # a third is not taken
    bench.go(1500)
    assert bench.word & (ACKNOWLEDGE | REACHED) == REACHED
    assert bench.read(0x6064) == pytest.approx(8000, abs=8)


def test_change_immediately_and_relative(faulhaber):
    bench = faulhaber
    bench.enable(Mode.PP)
    bench.write(0x607A, 10000)
    bench.control(0x1F, 0x0F)
    bench.go(50)
    bench.write(0x607A, 2000)
    bench.control(0x3F, 0x0F)
    bench.go(800)
    assert bench.read(0x6064) == pytest.approx(2000, abs=8)
    bench.write(0x607A, -500)
    bench.control(0x7F, 0x0F)
    bench.go(500)
    bench.control(0x5F, 0x0F)
    bench.go(500)
    assert bench.read(0x6064) == pytest.approx(1000, abs=8)


def test_halt_and_go_on(faulhaber):
    bench = faulhaber
    bench.enable(Mode.PP)
    bench.write(0x607A, 20000)
    bench.control(0x1F, 0x0F)
    bench.go(80)
    bench.control(0x10F)
    bench.go(300)
    halted = bench.read(0x6064)
    assert bench.word & REACHED
    bench.go(100)
    assert 2000 < bench.read(0x6064) == halted < 19000
    bench.control(0x0F)
    bench.go(800)
    assert bench.read(0x6064) == pytest.approx(20000, abs=8)


def test_a_target_beyond_the_limits(make):
    for name, code in (("faulhaber_v3", None), ("epos4", 0x8A82)):
        bench = make(name)
        bench.write(0x607D, -1000, 1)
        bench.write(0x607D, 1000, 2)
        bench.enable(Mode.PP)
        bench.write(0x607A, 3000)
        bench.control(0x1F)
        bench.go(500)
        assert bench.emergencies() == ([code] if code else [])
        if code is None:
            assert bench.read(0x6064) == pytest.approx(1000, abs=8)
            assert bench.word & LIMITED
            bench.write(0x607A, 0)
            bench.control(0x0F, 0x1F)
            bench.go(500)
            assert not bench.word & LIMITED


# ----------------------------------------------------------------------------------------------------------- pv, csx


def test_pv_ramps_and_tells_speed_zero(faulhaber):
    bench = faulhaber
    bench.write(0x6083, 200)
    bench.enable(Mode.PV)
    bench.go(60)
    assert bench.word & 0x1000
    bench.write(0x60FF, 40)
    bench.go(100)
    assert bench.read(0x606B) == pytest.approx(20, abs=2)  # 200 mm/s2 for about 0.1 s
    assert not bench.word & REACHED
    bench.go(300)
    assert bench.read(0x606C) == pytest.approx(40, abs=3)
    assert bench.word & REACHED
    assert not bench.word & 0x1000


def test_a_stale_velocity_moves_at_enable(bench):
    """What hosts fear: the drive does what 60FFh says as soon as operation is enabled."""
    bench.write(0x60FF, 50)
    bench.enable(Mode.PV)
    bench.go(300)
    assert bench.read(0x606C) == pytest.approx(50, rel=0.25)


def test_csp_follows_with_the_lag_of_the_position_loop(faulhaber):
    """40 mm/s lag by 1 / position_gain = 20 ms: 0.8 mm, which 60F4h shows."""
    bench = faulhaber
    bench.write(0x60C2, 5, 1)
    bench.nmt(1)
    bench.enable(Mode.CSP)
    for cycle in range(100):
        bench.send(0x300 + NODE, struct.pack("<Hi", 0x0F, 200 * cycle))
        bench.go(4.5)
    assert bench.read(0x60F4) == pytest.approx(800, abs=200)
    assert bench.word & 0x3000 == 0x1000
    assert abs(bench.read(0x6078)) < 500


@pytest.mark.parametrize(
    ("vendor", "gain", "half", "parameters"),
    [
        ("faulhaber_v3", (0x2344, 1), 500, {"velocity_gain": 0.5, "velocity_integral": 0.5}),
        ("faulhaber_v3", (0x2344, 2), 160, {"velocity_integral": 0.5}),
        ("epos4", (0x30A1, 1), 750000, {"position_gain": 0.5}),
        ("epos4", (0x30A2, 1), 10000, {"velocity_gain": 0.5}),
        ("epos4", (0x30A2, 2), 250000, {"velocity_integral": 0.5}),
    ],
)
def test_gains_are_those_of_the_motors_loops(make, vendor, gain, half, parameters):
    """As multiples of what the component has, until a reset; a fault of the loop stays beside them."""
    bench = make(vendor)
    motor = bench.drive.axis.motor
    names = ("velocity_gain", "velocity_integral", "position_gain")
    own = {name: motor.get(name) for name in names}
    bench.write(gain[0], half, gain[1])
    bench.go(2)
    assert {name: motor.get(name) for name in names} == pytest.approx(
        {name: value * parameters.get(name, 1.0) for name, value in own.items()}
    )
    motor.scale("velocity_gain", 3.0)
    bench.nmt(129)
    bench.go(110)
    own["velocity_gain"] *= 3.0
    assert {name: motor.get(name) for name in names} == pytest.approx(own)


def test_a_weaker_velocity_loop_takes_longer(make):
    """Half the gain, and a speed is reached later."""
    times = []
    for gain in (1000, 250):
        bench = make("faulhaber_v3")
        bench.write(0x2344, gain, 1)
        bench.enable(Mode.CSV)
        bench.write(0x60FF, 50)
        start = bench.bus.now
        while bench.drive.axis.velocity < 0.045:
            bench.go(1)
        times.append(bench.bus.now - start)
    assert times[1] > 2 * times[0]


def test_a_csp_target_that_was_not_preloaded_jumps(epos):
    """The trap: at enable csp goes to 607Ah; EPOS4's following error trips at once."""
    bench = epos
    bench.write(0x607A, 50000)
    bench.write(0x6060, Mode.CSP)
    bench.control(0x06, 0x07, 0x0F)
    assert bench.emergencies() == [0x8611]
    bench.go(300)
    assert bench.state is State.FAULT


def test_csv_and_cst(bench):
    if not bench.read(0x6502) & 0x300:
        return
    unit = bench.drive.axis.units
    bench.enable(Mode.CSV)
    bench.write(0x60FF, 100)
    bench.go(100)
    assert bench.drive.axis.velocity == pytest.approx(100 * unit.velocity, rel=0.25)
    bench.write(0x60FF, 0)
    bench.go(100)
    bench.write(0x6060, Mode.CST)
    bench.write(0x6071, 300)
    bench.go(20)
    assert bench.drive.axis.motor.current == pytest.approx(300 * unit.torque, rel=0.02)
    assert bench.read(0x6077) == pytest.approx(300, abs=8)


@pytest.mark.parametrize(("vendor", "current"), [("faulhaber_v3", 0.47), ("epos4", 2.5)])
def test_a_quick_stop_out_of_cst(make, vendor, current):
    """The ramp begins at the speed that there is, with the current that there is."""
    bench = make(vendor)
    unit = bench.drive.axis.units
    bench.enable(Mode.CST)
    bench.write(0x6071, round(current / unit.torque))
    bench.go(60)
    speed = bench.drive.axis.velocity
    assert speed > 100 * unit.velocity
    bench.control(0x02)
    fastest = speed
    for _ in range(150):
        bench.go(1)
        fastest = max(fastest, bench.drive.axis.velocity)
    assert fastest < 1.3 * speed
    assert abs(bench.drive.axis.velocity) < 0.02 * speed


def test_csp_without_interpolation_steps(epos):
    """60C2h = 0: coarse targets go to the loops as steps; with a period the demand is a line."""
    demands = {}
    for period in (0, 10):
        epos.drive.power_on()
        epos.go(2)
        epos.write(0x60C2, period, 1)
        epos.write(0x607A, epos.read(0x6064))
        epos.enable(Mode.CSP)
        epos.write(0x607A, epos.read(0x6064) + 100)
        seen = []
        for _ in range(12):
            seen.append(epos.drive.axis.demand)
            epos.go(1)
        demands[period] = len({round(one, 6) for one in seen})
        epos.control(0x00)
    assert demands[0] <= 2
    assert demands[10] >= 8


# ----------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("option", "after"),
    [(0, State.DISABLED), (1, State.DISABLED), (2, State.DISABLED), (5, State.QUICK_STOP), (6, State.QUICK_STOP)],
)
def test_quick_stop_option(epos, option, after):
    bench = epos
    bench.write(0x605A, option)
    bench.enable(Mode.PV)
    bench.write(0x60FF, 1000)
    bench.go(200)
    bench.control(0x02)
    assert bench.state is (State.DISABLED if option == 0 else State.QUICK_STOP)
    assert bench.word & 0x0020 == 0
    bench.go(300)
    assert bench.state is after
    if after is State.QUICK_STOP:
        assert bench.read(0x606C) == pytest.approx(0, abs=10)
        bench.control(0x0F)
        assert bench.state is State.ENABLED


@pytest.mark.parametrize(("option", "after"), [(1, State.QUICK_STOP), (2, State.QUICK_STOP), (6, State.ENABLED)])
def test_a_quick_stop_that_ends_disabled_cannot_be_taken_back(epos, option, after):
    bench = epos
    bench.write(0x605A, option)
    bench.enable(Mode.PV)
    bench.write(0x60FF, 1000)
    bench.go(200)
    bench.control(0x02, 0x0F)
    assert bench.state is after


def test_the_end_of_an_error_that_was_not_told_is_not_told(make):
    bench = make("mclm")
    bench.write(0x2321, 0, 1)
    bench.drive.inject(0x8400)
    bench.go(5)
    bench.control(0x80)
    assert bench.emergencies() == []
    bench.write(0x2321, 2, 1)
    bench.drive.inject(0x8400)
    bench.go(5)
    assert bench.emergencies() == [0x8400, 0x0000]


@pytest.mark.parametrize(("index", "word", "after"), [(0x605B, 0x06, State.READY), (0x605C, 0x07, State.SWITCHED_ON)])
def test_shutdown_and_disable_options(epos, index, word, after):
    bench = epos
    for option in (0, 1):
        bench.write(index, option)
        bench.enable(Mode.PV)
        bench.write(0x60FF, 1000)
        bench.go(200)
        bench.control(word)
        assert bench.state is (State.ENABLED if option else after)  # it is enabled until it stands
        bench.go(200)
        assert bench.state is after
        bench.control(0x00)
