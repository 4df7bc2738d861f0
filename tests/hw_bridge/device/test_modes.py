"""Demands and status bits of each mode of operation, control cycle by control cycle, with a motor that follows exactly.

The drive counts um, mm/s and mm/s2. What a cycle demands, the motor has reached in the next one.
"""

import pytest

from hw_bridge.device.modes import CyclicPosition
from hw_bridge.dictionary import Mode, State
from tests.every_case import every_case
from tests.hw_bridge.device.ideal_motor import Turned

RATED = 0.79e-3  # current of one unit of torque [A]
RAMP = {"x6081": 20, "x6083": 100, "x6084": 200, "x6085": 400}  # 20 mm/s after 0.2 s, braking within 0.1 s


def demands(turned, milliseconds):
    """Commands of the drive to its motor, one of each cycle."""
    before = len(turned.motor.calls)
    turned.go(milliseconds)
    return turned.motor.calls[before:]


def values(calls, number=1):
    """One value of each command, in thousandths: mm, mm/s or mA."""
    return [pytest.approx(1e3 * call[number], abs=1e-9) for call in calls]


def until(turned, bits, most=1000):
    """Milliseconds until the statusword first shows these bits."""
    for milliseconds in range(most):
        if turned.bits == bits:
            return milliseconds
        turned.go(1)
    raise AssertionError(f"{turned.bits} after {most} ms")


# ---------------------------------------------------------------------------------------------------------------- pp


def test_pp_follows_a_trapezoid_and_tells_that_it_has_arrived():
    turned = Turned(**RAMP, x6067=40, x6068=48).enable(Mode.PP)
    assert turned.bits == "10"
    turned.write(0x607A, 10_000)
    turned.write(0x6040, 0x1F)
    assert turned.bits == "12"
    turned.write(0x6040, 0x0F)
    assert turned.bits == ""
    calls = demands(turned, 650)
    assert {call[0] for call in calls} == {"position"}
    # 2 mm while it speeds up, 7 mm at 20 mm/s, 1 mm while it brakes
    place = {1: 5e-5, 100: 0.5, 200: 2.0, 300: 4.0, 550: 9.0, 600: 9.75, 650: 10.0}
    assert {time: 1e3 * calls[time - 1][1] for time in place} == {time: pytest.approx(x) for time, x in place.items()}
    assert turned.drive.axis.speed == pytest.approx(0.0, abs=1e-9)
    assert turned.bits == ""
    assert until(turned, "10") == 48
    assert turned.read(0x6064) == 10_000


@every_case(
    ("window", "time", "beside", "arrives"),
    [(40, 0, 0.0, True), (40, 0, 39.9e-6, True), (40, 0, 41e-6, False), (0xFFFFFFFF, 5, 1.0, True), (0, 0, 0.0, True)],
)
def test_pp_has_arrived_within_its_window(window, time, beside, arrives):
    turned = Turned(x6067=window, x6068=time).enable(Mode.PP)
    turned.write(0x607A, 0)
    turned.write(0x6040, 0x1F)
    turned.drive.axis.measure = lambda: None
    turned.drive.axis.position = beside
    turned.go(2)
    assert ("10" in turned.bits) is arrives


def test_pp_takes_one_set_point_more_and_goes_on_to_it():
    turned = Turned(**RAMP, x6067=0xFFFFFFFF).enable(Mode.PP)

    def set_point(target, word):
        turned.write(0x607A, target)
        turned.write(0x6040, word)
        taken = "12" in turned.bits
        turned.write(0x6040, 0x0F)
        return taken, "12" in turned.bits

    assert set_point(1000, 0x1F) == (True, False)
    assert set_point(2000, 0x1F) == (True, True)  # waits: no other can be taken
    assert set_point(9000, 0x1F) == (True, True)  # not taken
    assert (turned.drive.mode.active.target, turned.drive.mode.waiting.target) == pytest.approx((1e-3, 2e-3))
    turned.go(600)
    assert turned.motor.measured_position == pytest.approx(2e-3)
    assert turned.bits == "10"
    # relative: to the demand, to the set-point before, to the one that waits; immediately
    assert set_point(500, 0x5F) == (True, False)
    assert turned.drive.mode.active.target == pytest.approx(2.5e-3)
    assert set_point(500, 0x5F) == (True, True)
    assert turned.drive.mode.waiting.target == pytest.approx(3.0e-3)
    assert set_point(500, 0x7F) == (True, False)
    assert (turned.drive.mode.active.target, turned.drive.mode.waiting) == (pytest.approx(3.5e-3), None)


@pytest.mark.parametrize(
    ("target", "reached", "limited"),
    [(2000, 2e-3, False), (2001, 2e-3, True), (-1000, -1e-3, False), (-1001, -1e-3, True)],
)
def test_pp_clips_a_target_at_the_software_limits(target, reached, limited):
    turned = Turned(x607D_1=-1000, x607D_2=2000).enable(Mode.PP)
    turned.write(0x607A, target)
    turned.write(0x6040, 0x1F)
    turned.go(400)
    assert turned.motor.measured_position == pytest.approx(reached, abs=1e-12)
    assert ("11" in turned.bits) is limited


@pytest.mark.parametrize(("profile_speed", "largest", "speed"), [(20, 30, 20e-3), (20, 10, 10e-3), (1, 30, 1e-3)])
def test_pp_goes_no_faster_than_the_largest_speed(profile_speed, largest, speed):
    turned = Turned(x6081=profile_speed, x607F=largest, x6083=1000, x6084=1000).enable(Mode.PP)
    turned.write(0x607A, 20_000)
    turned.write(0x6040, 0x1F)
    turned.go(100)
    assert turned.drive.axis.speed == pytest.approx(speed)


@pytest.mark.parametrize(("option", "rate"), [(1, 0.2), (2, 0.4)])
def test_a_halt_brakes_by_605dh_and_goes_on_afterwards(option, rate):
    turned = Turned(**RAMP, x605D=option, x6067=0xFFFFFFFF).enable(Mode.PP)
    turned.write(0x607A, 20_000)
    turned.write(0x6040, 0x1F)
    turned.go(300)
    turned.write(0x6040, 0x11F)
    calls = demands(turned, 11)
    # the ramp begins in the cycle that sees the halt, at 301 ms
    start = 2e-3 + 0.020 * 0.101
    expected = [start + 0.020 * t - 0.5 * rate * t * t for t in (0.0, 5e-3, 10e-3)]
    assert [calls[k][1] for k in (0, 5, 10)] == [pytest.approx(x) for x in expected]
    assert turned.bits == "12"
    assert until(turned, "10 12") == round(20 / rate) - 10
    standing = turned.motor.calls[-1][1]
    assert standing == pytest.approx(start + 0.5 * 0.020**2 / rate)
    assert {call[1] for call in demands(turned, 50)} == {standing}
    turned.write(0x6040, 0x1F)
    turned.go(2000)
    assert turned.motor.measured_position == pytest.approx(20e-3)


# ---------------------------------------------------------------------------------------------------------------- pv


def test_pv_ramps_and_tells_speed_reached_and_speed_zero():
    turned = Turned(x6083=350, x6084=700, x606D=1, x606E=10, x606F=1, x6070=5).enable(Mode.PV)
    assert until(turned, "10 12") == 10
    turned.write(0x60FF, 40)
    calls = demands(turned, 120)
    assert {call[0] for call in calls} == {"velocity"}
    assert values(calls[:4]) == [0.0, 0.35, 0.7, 1.05]
    assert values(calls[114:]) == [39.9] + 5 * [40.0]
    assert calls[0][2:] == (pytest.approx(1.58), 0.0)
    # within 1 mm/s of 40 from cycle 113 on, which the motor shows one cycle later, for 10 ms
    assert turned.bits == ""
    assert until(turned, "10") == 124 - 120
    turned.write(0x60FF, -10)
    calls = demands(turned, 90)
    assert values(calls[:3]) == [40.0, 39.3, 38.6]  # slower with 6084h, through zero, then faster with 6083h
    assert values(calls[58:60]) == [pytest.approx(-0.3, abs=1e-6), pytest.approx(-0.65, abs=1e-6)]
    assert values(calls[-1:]) == [-10.0]


@pytest.mark.parametrize(("target", "speed"), [(60, 50.0), (50, 50.0), (-60, -50.0), (-50, -50.0)])
def test_pv_goes_no_faster_than_the_largest_speed(target, speed):
    turned = Turned(x607F=50).enable(Mode.PV)
    turned.write(0x60FF, target)
    assert values(demands(turned, 100)[-1:]) == [speed]


@pytest.mark.parametrize(("option", "step"), [(1, 0.2), (2, 0.4)])
def test_a_halt_in_pv_brakes_by_605dh(option, step):
    turned = Turned(**RAMP, x605D=option).enable(Mode.PV)
    turned.write(0x60FF, 20)
    turned.go(250)
    turned.write(0x6040, 0x10F)
    assert values(demands(turned, 3)) == [20.0, 20.0 - step, 20.0 - 2 * step]
    assert values(demands(turned, 100)[-1:]) == [0.0]
    turned.write(0x6040, 0x0F)
    assert values(demands(turned, 3)) == [0.0, 0.1, 0.2]


def test_windows_of_pv_begin_anew_when_operation_is_enabled():
    turned = Turned(x606D=1, x606E=10, x606F=1, x6070=5).enable(Mode.PV)
    turned.go(50)
    turned.write(0x6040, 0x06)
    turned.go(5)
    turned.write(0x6040, 0x07)
    turned.write(0x6040, 0x0F)
    assert turned.bits == ""
    assert until(turned, "12") == 5
    assert until(turned, "10 12") == 5


def test_pv_begins_with_the_speed_that_there_is():
    turned = Turned(**RAMP)
    turned.write(0x6060, Mode.PV)
    turned.motor.calls.append(("velocity", 5e-3, 0.0, 0.0))
    turned.go(2)
    turned.motor.off = lambda: None
    turned.write(0x60FF, 10)
    for word in (0x06, 0x07, 0x0F):
        turned.write(0x6040, word)
    assert values(demands(turned, 3)) == [5.0, 5.1, 5.2]


@every_case(
    ("window", "threshold", "velocity", "bits"),
    [
        (5, 5, 20.0, "10"),
        (5, 5, 15.0, "10"),
        (5, 5, 14.9, ""),
        (5, 5, 25.0, "10"),
        (5, 5, 25.1, ""),
        (5, 5, 5.0, "12"),
        (5, 5, -5.0, "12"),
        (5, 5, -5.1, ""),
        (0, 0, 21.0, "10"),  # a window of 0 is the smallest one
        (0, 0, 1.0, "12"),
        (0, 0, 1.1, ""),
    ],
)
def test_windows_of_pv(window, threshold, velocity, bits):
    turned = Turned(x6083=32750, x6084=32750, x606D=window, x606E=0, x606F=threshold, x6070=0).enable(Mode.PV)
    turned.write(0x60FF, 20)
    turned.go(5)
    turned.drive.axis.windows.clear()
    turned.drive.axis.velocity = (
        1e-3 * velocity * (1.0 + 1e-12 * (-1 if velocity in (5.0, -5.0, 25.0, 1.0, 21.0) else 1))
    )
    turned.drive._show()
    assert turned.bits == bits


# --------------------------------------------------------------------------------------------------------------- csp


@every_case(
    ("value", "index", "period"),
    [
        (0, -3, 0),
        (5, -3, 5_000_000),
        (250, -6, 250_000),
        (1, 0, 1_000_000_000),
        (7, -9, 7),
        (7, -12, 7),
        (2, -2, 20_000_000),
    ],
)
def test_the_interpolation_period(value, index, period):
    """60C2h.1 times ten to the power of 60C2h.2 [s]."""
    turned = Turned()
    turned.drive.dictionary.put(0x60C2, value, 1)
    turned.drive.dictionary.put(0x60C2, index, 2)
    assert CyclicPosition(turned.drive.axis, turned.drive.error).period() == period


def test_csp_interpolates_over_its_period():
    turned = Turned(x60C2_1=5).enable(Mode.CSP)
    assert values(demands(turned, 2)) == [0.0, 0.0]
    turned.write(0x607A, 1000)
    assert turned.bits == "12"
    assert values(demands(turned, 7)) == [0.2, 0.4, 0.6, 0.8, 1.0, 1.0, 1.0]
    turned.write(0x607A, 500)
    assert values(demands(turned, 2)) == [0.9, 0.8]
    assert turned.drive.axis.speed == pytest.approx(-0.1)
    turned.write(0x607A, 1800)  # early: from where it is
    assert values(demands(turned, 6)) == [1.0, 1.2, 1.4, 1.6, 1.8, 1.8]
    assert turned.drive.axis.speed == 0.0


def test_csp_without_a_period_steps_and_adds_offsets():
    turned = Turned().enable(Mode.CSP)
    turned.write(0x60B0, 250)
    turned.write(0x60B1, -30)
    turned.write(0x60B2, 100)
    turned.write(0x607A, 1000)
    (call, other) = demands(turned, 2)
    assert call[:1] + call[3:] == ("position", pytest.approx(-0.03), pytest.approx(100 * RATED))
    assert values([call, other]) == [1.25, 1.25]
    assert turned.drive.axis.speed == 0.0


def test_csp_begins_at_its_target():
    turned = Turned(x607A=700, x60C2_1=5).enable(Mode.CSP)
    assert values(demands(turned, 1)) == [0.7]


@every_case(
    ("window", "error", "bits"),
    [(100, 100.0, "12"), (100, 100.1, "12 13"), (100, -100.1, "12 13"), (0xFFFFFFFF, 1e6, "12"), (0, 0.1, "12 13")],
)
def test_csp_tells_its_following_error(window, error, bits):
    turned = Turned(x6065=window, x6066=1000).enable(Mode.CSP)
    turned.go(2)
    turned.drive.axis.position = turned.drive.axis.demand - 1e-6 * error * (1.0 - 1e-9)
    turned.drive._show()
    assert turned.bits == bits


# ------------------------------------------------------------------------------------------------------ csv, cst, none


def test_csv_adds_its_offsets():
    turned = Turned(x60B1=-5, x60B2=200).enable(Mode.CSV)
    turned.write(0x60FF, 25)
    assert demands(turned, 1) == [("velocity", pytest.approx(20e-3), pytest.approx(1.58), pytest.approx(200 * RATED))]
    assert turned.bits == "12"
    turned.write(0x60FF, -2500)
    assert values(demands(turned, 1)) == [-2000.0]
    assert turned.bits == "11 12"


def test_cst_adds_its_offset():
    turned = Turned(x60B2=200).enable(Mode.CST)
    turned.write(0x6071, -500)
    assert demands(turned, 1) == [("current", pytest.approx(-300 * RATED), pytest.approx(1.58))]
    assert turned.bits == "12"
    turned.write(0x6071, 1801)
    turned.go(1)
    assert turned.bits == "11 12"


def test_no_mode_has_no_current():
    turned = Turned()
    for word in (0x06, 0x07, 0x0F):
        turned.write(0x6040, word)
    assert turned.drive.state is State.ENABLED
    assert demands(turned, 2) == [("off",), ("off",)]
    assert turned.bits == ""


# -------------------------------------------------------------------------------------------------------------- stops


@pytest.mark.parametrize(
    ("option", "step", "after"),
    [(1, 0.2, State.DISABLED), (2, 0.4, State.DISABLED), (5, 0.2, State.QUICK_STOP), (6, 0.4, State.QUICK_STOP)],
)
def test_a_quick_stop_brakes_by_605ah(option, step, after):
    turned = Turned(**RAMP, x605A=option).enable(Mode.PV)
    turned.write(0x60FF, 20)
    turned.go(250)
    turned.write(0x6040, 0x02)
    assert turned.drive.state is State.QUICK_STOP
    assert values(demands(turned, 3)) == [20.0 - step * k for k in (1, 2, 3)]
    turned.go(round(20 / step) - 4)
    assert turned.drive.state is State.QUICK_STOP
    turned.go(2)
    assert turned.drive.state is after


def test_a_quick_stop_of_0_is_the_end_of_the_current():
    turned = Turned(x605A=0).enable(Mode.PV)
    turned.write(0x6040, 0x02)
    assert turned.drive.state is State.DISABLED


def test_a_stop_out_of_pp_stays_on_its_way():
    """The demand is a position: the ramp goes on from it, not from where the motor is."""
    turned = Turned(**RAMP, x605A=6).enable(Mode.PP)
    turned.write(0x607A, 20_000)
    turned.write(0x6040, 0x1F)
    turned.go(300)
    turned.motor.measured_position -= 1e-3
    turned.write(0x6040, 0x02)
    calls = demands(turned, 2)
    assert [call[0] for call in calls] == ["position", "position"]
    t = 1e-3
    assert calls[0][1] == pytest.approx(4e-3 + 0.020 * t - 0.5 * 0.4 * t * t)
    turned.go(60)
    assert turned.motor.measured_position == pytest.approx(4e-3 + 0.5 * 0.020**2 / 0.4)
