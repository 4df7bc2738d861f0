"""Rules of CiA 402 (parts 2 and 3, IEC 61800-7-201): limit switches and touch probes.

Each check names its object or function. What a vendor's drive does not offer is skipped.
"""

from itertools import product

import pytest

from hw_bridge.dictionary import Mode, State
from tests.hw_bridge.device.conformance.motions import (
    LIMITED,
    has,
    on,
    place,
    room,
    units,
    velocity,
    widened,
)
from tests.hw_bridge.profiles import fast

# ------------------------------------------------------------------------------------------------ digital inputs


def test_switches_are_digital_inputs(bench):
    """60FDh: bit 0 negative limit, bit 1 positive limit, bit 2 home."""
    switches = bench.drive.axis.switches
    seen = []
    for values in ((0.1, None, None), (None, -0.1, None), (None, None, (-0.1, 0.1))):
        switches.negative, switches.positive, switches.home = values
        bench.go(2)
        seen.append(bench.read(0x60FD) & 7)
    assert seen == [1, 2, 4]


MOTIONS = [Mode.PP, Mode.PV, Mode.CSP, Mode.CSV, Mode.CST]


def moved(bench, mode, sign, milliseconds=1500):
    """Move in a direction as far as it goes, in any mode."""
    axis = bench.drive.axis
    if mode in (Mode.PV, Mode.CSV):
        bench.write(0x60FF, sign * velocity(bench))
    elif mode is Mode.CST:
        bench.write(0x6071, sign * (700 if bench.profile.name == "epos4" else 300))
    elif mode is Mode.PP:
        bench.write(0x6081, velocity(bench))
        bench.write(0x607A, units(bench, axis.position + sign * 4 * place(bench)))
        bench.control(0x0F, 0x3F)
    if mode is not Mode.CSP:
        bench.go(milliseconds)
        return
    begin, step = axis.position, velocity(bench) * axis.units.velocity * 4e-3
    for k in range(milliseconds // 4):
        target = begin + sign * min(step * k, 4 * place(bench))
        if bench.state is State.ENABLED:
            bench.write(0x607A, units(bench, target))
        bench.go(1.5)


@pytest.mark.slow_repetitions
@on("faulhaber_v3", "epos4")  # of which one takes a closed switch for an error
@pytest.mark.parametrize(
    ("mode", "sign"), fast(*((mode, 1) for mode in MOTIONS), (Mode.PV, -1), of=list(product(MOTIONS, (1, -1))))
)
def test_a_limit_switch_stops_every_mode(bench, mode, sign):
    """60FDh bits 0 and 1: the drive does not go on into a closed limit switch, and says so (bit 11, or the vendor's error)."""
    has(bench, mode)
    switches, axis = bench.drive.axis.switches, bench.drive.axis
    widened(bench)
    switches.negative, switches.positive = -place(bench), place(bench)
    bench.enable(mode)
    moved(bench, mode, sign)
    assert abs(axis.velocity) < 0.02 * velocity(bench) * axis.units.velocity
    assert place(bench) - 1e-5 <= sign * axis.motor.position < place(bench) + room(bench)
    error = {1: 0x8A81, -1: 0x8A80}[sign]
    if error in bench.profile.faults:
        assert error in bench.emergencies()
        assert bench.state is State.FAULT
    else:
        assert bench.state is State.ENABLED
        assert bench.read(0x6041) & LIMITED


@pytest.mark.slow_repetitions
@on("faulhaber_v3", "epos4")
@pytest.mark.parametrize("mode", MOTIONS)
def test_the_way_out_of_a_limit_switch_is_free(bench, mode):
    """60FDh: the other direction is not blocked; after the vendor's error it is reset first."""
    has(bench, mode)
    switches, axis = bench.drive.axis.switches, bench.drive.axis
    widened(bench)
    switches.positive = place(bench)
    bench.enable(mode)
    moved(bench, mode, 1)
    if bench.state is State.FAULT:
        bench.control(0x00, 0x80)
        bench.write(0x607A, units(bench, axis.position))
        bench.write(0x60FF, 0)
        bench.write(0x6071, 0)
        bench.control(0x06, 0x07, 0x0F)
    assert bench.state is State.ENABLED
    inside = axis.motor.position
    moved(bench, mode, -1, 600)
    assert axis.motor.position < inside - place(bench) / 2
    assert bench.state is State.ENABLED


def test_without_limit_switches_nothing_stops(bench):
    """60FDh: open inputs limit nothing."""
    bench.write(0x607D, units(bench, -100 * place(bench)), 1)
    bench.write(0x607D, units(bench, 100 * place(bench)), 2)
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(1500)
    assert bench.drive.axis.motor.position > 2 * place(bench)
    assert not bench.read(0x6041) & LIMITED


# --------------------------------------------------------------------------------------------------- touch probe


def probed(bench, function, back_and_forth=1):
    """With this function, once or more over a probe that is closed on [1, 2] of the place; what 60B9h tells."""
    if 0x60B8 not in bench.drive.dictionary:
        pytest.skip("no touch probe")
    axis = bench.drive.axis
    widened(bench)
    axis.switches.probes = ((place(bench), 2 * place(bench)), (1.5 * place(bench), 2 * place(bench)))
    bench.write(0x60B8, function)
    bench.write(0x6081, velocity(bench))
    bench.enable(Mode.PP)
    for _ in range(back_and_forth):
        for target in (3 * place(bench), 0):
            bench.write(0x607A, units(bench, target))
            bench.control(0x0F, 0x3F)
            bench.go(2000)
    return bench.read(0x60B9)


def near(bench, index, factor):
    assert bench.read(index) == pytest.approx(units(bench, factor * place(bench)), rel=0.05)


def test_a_touch_probe_that_is_off(bench):
    """60B8h bit 0; 60B9h."""
    assert probed(bench, 0x0030) == 0


def test_the_positive_edge(bench):
    """60B8h bits 0 and 4: 60BAh, 60B9h bits 0 and 1."""
    assert probed(bench, 0x0011) & 0x0707 == 0x0003
    near(bench, 0x60BA, 1.0)


def test_the_negative_edge(bench):
    """60B8h bits 0 and 5: 60BBh, 60B9h bits 0 and 2. The first one is on the far side."""
    assert probed(bench, 0x0021) & 0x0707 == 0x0005
    near(bench, 0x60BB, 2.0)


def test_both_edges_of_both_probes(bench):
    """60B8h bits 8, 12 and 13 as well: 60BCh, 60BDh, 60B9h bits 8 to 10."""
    assert probed(bench, 0x3131) & 0x0707 == 0x0707
    for index, factor in ((0x60BA, 1.0), (0x60BB, 2.0), (0x60BC, 1.5), (0x60BD, 2.0)):
        near(bench, index, factor)


@pytest.mark.slow
def test_the_first_event_is_kept(bench):
    """60B8h bit 1 = 0: single."""
    probed(bench, 0x0011)
    first = bench.read(0x60BA)
    bench.drive.axis.switches.probes = ((1.3 * place(bench), 2 * place(bench)), None)
    bench.write(0x607A, units(bench, 3 * place(bench)))
    bench.control(0x0F, 0x3F)
    bench.go(1500)
    assert bench.read(0x60BA) == first


def test_continuous_takes_every_event(bench):
    """60B8h bit 1 = 1: the way back closes it on the far side."""
    probed(bench, 0x0013)
    near(bench, 0x60BA, 2.0)


def test_switching_it_off_and_on_begins_anew(bench):
    """60B9h bits 1 and 2 are 0 with 60B8h bit 0."""
    probed(bench, 0x0011)
    bench.write(0x60B8, 0)
    bench.go(2)
    assert bench.read(0x60B9) == 0
    bench.write(0x60B8, 0x0011)
    bench.go(2)
    assert bench.read(0x60B9) & 0x0707 == 0x0001


def test_the_index_pulse_triggers(bench):
    """60B8h bits 2 and 3 = 1: zero impulse of the position sensor."""
    if 0x60B8 not in bench.drive.dictionary:
        pytest.skip("no touch probe")
    pitch = bench.drive.axis.motor.model.index
    bench.drive.axis.motor.offset = -0.02 * pitch
    bench.go(2)
    bench.write(0x60B8, 0x0015)
    bench.enable(Mode.PV)
    bench.write(0x60FF, velocity(bench))
    bench.go(300)
    assert bench.read(0x60B9) & 0x0003 == 0x0003


def test_touch_probes_are_process_data(bench):
    """60B8h into an RPDO, 60B9h to 60BDh into a TPDO."""
    objects = bench.drive.dictionary.objects
    if 0x60B8 not in objects:
        pytest.skip("no touch probe")
    assert all(objects[index][0].mappable for index in range(0x60B8, 0x60BE))
    assert [objects[index][0].access for index in range(0x60B8, 0x60BE)] == ["rw"] + ["ro"] * 5
