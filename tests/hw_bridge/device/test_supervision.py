"""What a drive watches, what it tells of it and how it reacts, in numbers: a motor that follows exactly, no bus."""

from dataclasses import replace

import pytest

from hw_bridge.bus import MILLISECOND
from hw_bridge.device import Drive
from hw_bridge.device.axis import Switches
from hw_bridge.dictionary import Mode, State
from hw_bridge.profiles import profile
from tests.every_case import every_case
from tests.hw_bridge.device.ideal_motor import IdealMotor, Turned
from twin.errors import DeclarationError, SimulationError

OPERATIONAL = b"\1\1"


def emergencies(turned):
    """Data of the EMCY messages sent, and forget them."""
    sent = [frame.data.hex() for frame in turned.sent if frame.id == 0x81]
    turned.sent.clear()
    return sent


def started(name="faulhaber_v3", mode=Mode.CSP, **values):
    turned = Turned(name, **values)
    turned.drive.nmt.command(OPERATIONAL)
    turned.enable(mode)
    turned.go(2)
    turned.sent.clear()
    return turned


def codes(turned):
    return sorted(f"{code:04X}" for code in turned.drive.active)


# -------------------------------------------------------------------------------------------------------- statusword


@every_case(
    ("name", "words", "operational", "shown"),
    [
        # bit 4 voltage, bit 5 quick stop, bit 9 remote; EPOS4 shows the power stage in bit 4
        ("faulhaber_v3", (), False, 0x0050),
        ("faulhaber_v3", (), True, 0x0250),
        ("faulhaber_v3", (0x06,), True, 0x0231),
        ("faulhaber_v3", (0x06, 0x07), True, 0x0233),
        ("faulhaber_v3", (0x06, 0x07, 0x0F), True, 0x0237),
        ("faulhaber_v3", (0x06, 0x07, 0x0F, 0x02), True, 0x0217),
        ("epos4", (), False, 0x0040),
        ("epos4", (0x06,), False, 0x0021),
        ("epos4", (0x06, 0x07), False, 0x0033),
        ("epos4", (0x06, 0x07, 0x0F, 0x02), False, 0x0017),
    ],
)
def test_statuswords(name, words, operational, shown):
    turned = Turned(name)
    if operational:
        turned.drive.nmt.command(OPERATIONAL)
    turned.write(0x6060, 3)
    for word in words:
        turned.write(0x6040, word)
    assert turned.read(0x6041) & ~0x1400 == shown


def test_a_supply_that_is_off_is_shown():
    turned = Turned()
    turned.drive.supply = 0.0
    assert (turned.motor.supply, turned.drive.supply) == (0.0, 0.0)
    turned.drive._show()
    assert turned.read(0x6041) & 0x10 == 0


@pytest.mark.parametrize(
    ("derated", "active", "warns"), [(True, False, True), (False, True, True), (False, False, False)]
)
def test_warnings(derated, active, warns):
    turned = started("mclm", Mode.PV)
    turned.drive.axis.derated = derated
    if active:
        turned.drive.error(0x8110)  # told only
    turned.drive._show()
    assert bool(turned.read(0x6041) & 0x80) is warns


def test_a_fault_is_no_warning():
    turned = started()
    turned.drive.error(0x5410)
    turned.go(2)
    assert turned.drive.state is State.FAULT
    assert turned.read(0x6041) & 0x80 == 0


def test_a_reference_is_shown_where_the_vendor_does():
    turned = Turned("epos4")
    assert turned.read(0x6041) & 0x8000 == 0
    turned.drive.axis.referenced = True
    turned.drive._show()
    assert turned.read(0x6041) & 0x8000
    turned.drive.power_on()
    assert turned.read(0x6041) & 0x8000 == 0


def test_outputs_are_enabled_by_their_mask():
    turned = Turned(x60FE_1=0xFF00, x60FE_2=0x0FF0)
    assert turned.drive.outputs == 0x0F00
    other = Turned("epos4", x60FE_1=0xFF00)  # it has no mask
    assert other.drive.outputs == 0xFF00


# ------------------------------------------------------------------------------------------------------- supervision


@every_case(
    ("supply", "error"),
    [(56.0, []), (56.01, ["3210"]), (9.0, []), (8.99, ["3220"]), (24.0, [])],
)
def test_over_and_undervoltage(supply, error):
    turned = started()
    turned.drive.supply = supply
    turned.go(1)
    assert codes(turned) == error
    assert (
        emergencies(turned) == [{"3210": "1032050400000000", "3220": "2032050800000000"}[code] for code in error]
        or not error
    )
    turned.drive.supply = 24.0
    turned.go(3)
    assert turned.drive.state is (State.FAULT if error else State.ENABLED)


def test_an_error_without_a_fault_ends_with_its_cause():
    turned = started("mclm", Mode.PV)
    turned.drive.supply = 57.0
    turned.go(1)
    assert (codes(turned), turned.drive.state) == (["3210"], State.ENABLED)  # 2321h.2 is 0: it does not trip
    turned.go(5)
    assert emergencies(turned) == ["1032050400000000"]
    turned.drive.supply = 24.0
    turned.go(1)
    assert (codes(turned), turned.read(0x1001), turned.read(0x2320)) == ([], 0, 0)
    assert emergencies(turned) == ["0000000000000000"]


@pytest.mark.parametrize(("error", "after"), [(100, None), (101, 21), (-101, 21)])
def test_a_following_error_trips_after_its_time(error, after):
    turned = started(x6065=100, x6066=20)
    axis = turned.drive.axis
    turned.motor.advance = lambda _time: setattr(
        turned.motor, "measured_position", axis.origin - 1e-6 * error * (1 - 1e-9)
    )
    ended = next((k for k in range(1, 40) if turned.go(1) or turned.drive.active), None)
    assert ended == after
    if after:
        assert codes(turned) == ["8611"]
        assert emergencies(turned) == ["1186210200000000"]
        assert turned.read(0x603F) == 0x8611


@pytest.mark.parametrize(("speed", "tripped"), [(20.0, False), (20.1, True), (-20.1, True)])
def test_a_speed_deviation_trips_after_its_time(speed, tripped):
    turned = started(mode=Mode.CSV, x2344_3=20, x2344_4=10)
    turned.motor.advance = lambda _time: setattr(turned.motor, "measured_velocity", 1e-3 * speed * (1 - 1e-9))
    turned.go(10)
    assert codes(turned) == []
    turned.go(1)
    assert codes(turned) == ["84F0"] * tripped
    assert turned.read(0x1001) == 0x21 * tripped


def test_no_deviation_while_it_is_off():
    turned = Turned(x2344_3=20, x2344_4=0)
    turned.motor.advance = lambda _time: setattr(turned.motor, "measured_velocity", 1.0)
    turned.go(5)
    assert codes(turned) == []


@every_case(
    ("mode", "period", "silence"),
    [(Mode.CSP, 5, 16), (Mode.CSV, 5, 16), (Mode.CST, 2, 7), (Mode.PP, 5, None), (Mode.CSP, 0, None)],
)
def test_targets_that_stay_away(mode, period, silence):
    """8250h after more than three periods of 60C2h, in cyclic modes, once targets have come."""
    turned = started("epos4", mode, x60C2_1=period, x6065=0xFFFFFFFF)
    turned.go(50)
    assert codes(turned) == []
    turned.drive.data_received([turned.drive.dictionary.entry(0x6040)])  # no target
    turned.go(50)
    assert codes(turned) == []
    turned.drive.data_received([turned.drive.dictionary.entry(0x6040), turned.drive.dictionary.entry(0x607A)])
    assert turned.drive.last_target_at == turned.drive.axis.last_target_at == turned.drive.now
    assert next((k for k in range(1, 60) if turned.go(1) or turned.drive.active), None) == silence
    assert codes(turned) == ["8250"] * (silence is not None)


def test_silence_counts_from_the_first_target_after_enable():
    turned = started("epos4", Mode.CSP, x60C2_1=5)
    turned.drive.data_received([turned.drive.dictionary.entry(0x607A)])
    turned.write(0x6040, 0x06)
    turned.go(100)
    turned.write(0x6040, 0x07)
    turned.write(0x6040, 0x0F)
    turned.go(100)
    assert (turned.drive.state, codes(turned)) == (State.ENABLED, [])
    turned.drive.data_received([turned.drive.dictionary.entry(0x607A)])
    turned.drive.nmt.command(b"\x80\1")  # Pre-operational: no targets are expected
    assert turned.drive.last_target_at == 0
    turned.go(100)
    assert codes(turned) == []


@pytest.mark.parametrize(("name", "mode", "is_told"), [("mclm", Mode.PV, True), ("faulhaber_v3", Mode.CSV, False)])
def test_overcurrent_of_a_drive_that_derates_is_told_where_the_vendor_has_it(name, mode, is_told):
    turned = started(name, mode)
    turned.drive.axis.heat = 10.0
    turned.go(1)
    assert codes(turned) == ["2310"] * is_told


# ------------------------------------------------------------------------------------------------------------ errors


def test_messages_of_several_errors():
    """Code, error register 1001h with its generic bit, the vendor's register 2320h; the history has the newest first."""
    turned = started()
    turned.drive.inject(0x43F0)
    turned.drive.inject(0x43F0)
    turned.drive.inject(0x8110)
    assert emergencies(turned) == ["f043091000000000", "1081191008000000"]
    assert [turned.read(0x1003, sub) for sub in range(4)] == [2, 0x8110, 0x43F0, 0]
    assert (turned.read(0x1001), turned.read(0x2320), turned.read(0x603F)) == (0x19, 0x0810, 0x8110)
    assert turned.drive.state is State.ENABLED  # both are told only
    turned.write(0x6040, 0x8F)
    assert (turned.read(0x1001), turned.read(0x2320), turned.read(0x603F)) == (0, 0, 0)
    assert emergencies(turned) == ["0000000000000000"]
    turned.write(0x6040, 0x0F)
    turned.write(0x6040, 0x8F)
    assert emergencies(turned) == []  # there is nothing to reset


def test_a_vendor_without_2320h_has_no_bytes_of_its_own():
    turned = started("epos4")
    turned.drive.inject(0x1000)
    assert emergencies(turned) == ["0010010000000000"]


def test_a_cause_that_stays_cannot_be_reset():
    turned = started()
    turned.drive.inject(0x7300, lasting=True)
    turned.drive.inject(0x5410)
    turned.go(2)
    for word in (0x80, 0x00):
        turned.write(0x6040, word)
    assert (codes(turned), turned.drive.state) == (["7300"], State.FAULT)
    assert turned.read(0x1001) == 0x21
    turned.drive.remove(0x7300)
    turned.write(0x6040, 0x80)
    assert (codes(turned), turned.drive.state) == ([], State.DISABLED)


def test_masks_say_which_errors_are_told_and_which_trip():
    """2321h.1 and 2321h.2 of an MCLM, by the bits of 2320h."""
    for told, trips in ((0xFFFF, 0), (0, 0xFFFF), (0x0100, 0x0100), (0x0080, 0x0080)):
        turned = started("mclm", Mode.PV, x2321_1=told, x2321_2=trips)
        turned.drive.inject(0x8130)
        assert emergencies(turned) == ["3081110001000000"] * bool(told & 0x100)
        turned.go(300)
        assert turned.drive.state is (State.FAULT if trips & 0x100 else State.ENABLED)


def test_an_error_that_the_vendor_has_not():
    with pytest.raises(SimulationError, match=r"^mclm: has no error 7300h\. There are: 2310, 3210, .*, FF01\.$"):
        Turned("mclm").drive.inject(0x7300)


def test_a_table_without_what_every_drive_has():
    described = profile("epos4")
    objects = tuple(entry for entry in described.objects if entry.index not in (0x6041, 0x1018))
    with pytest.raises(
        DeclarationError, match=r"^maxon EPOS4: lacks 1018, 6041\. A CiA 402 drive has these objects\.$"
    ):
        Drive(replace(described, objects=objects), 1, IdealMotor(described.motor))


@pytest.mark.parametrize(
    ("option", "speeds", "state"),
    [
        (0, [], State.FAULT),  # no current at once
        (1, [19.8, 19.6], State.REACTION),  # 6084h
        (2, [19.6, 19.2], State.REACTION),  # 6085h
    ],
)
def test_a_fault_brakes_by_605eh(option, speeds, state):
    turned = started(mode=Mode.CSV, x605E=option, x6084=200, x6085=400)
    turned.write(0x60FF, 20)
    turned.go(2)
    before = len(turned.motor.calls)
    turned.drive.inject(0x84FF)
    turned.go(2)
    moves = [call for call in turned.motor.calls[before:] if call[0] == "velocity"]
    assert [1e3 * call[1] for call in moves] == [pytest.approx(speed) for speed in speeds]
    assert turned.drive.state is state
    turned.go(150)
    assert turned.drive.state is State.FAULT
    assert turned.motor.calls[-1] == ("off",)


@pytest.mark.parametrize(
    ("option", "state", "later"),
    [
        (0, State.ENABLED, State.ENABLED),
        (1, State.REACTION, State.FAULT),
        (2, State.DISABLED, State.DISABLED),
        (3, State.QUICK_STOP, State.DISABLED),
    ],
)
def test_a_lost_master_by_6007h(option, state, later):
    turned = started(mode=Mode.CSV, x6007=option, x605A=2)
    turned.write(0x60FF, 20)
    turned.go(5)
    turned.drive.master_lost()
    assert turned.drive.state is state
    turned.go(100)
    assert turned.drive.state is later
    assert emergencies(turned) == ["3081110008000000"]


def test_a_master_that_is_lost_again_is_told_again():
    turned = started(mode=Mode.CSV, x6007=2)
    turned.drive.master_lost()
    turned.drive.master_lost()
    assert emergencies(turned) == ["3081110008000000"]
    for word in (0x06, 0x07, 0x0F):
        turned.write(0x6040, word)
    assert turned.drive.state is State.ENABLED
    turned.drive.master_lost()
    assert turned.drive.state is State.DISABLED
    assert emergencies(turned) == ["0000000000000000", "3081110008000000"]


# ---------------------------------------------------------------------------------------------------- limit switches


@pytest.mark.parametrize(("heading", "stops"), [(1, True), (-1, False)])
def test_a_closed_limit_switch_brakes_by_6085h(heading, stops):
    turned = started(mode=Mode.CSV, x6085=400)
    turned.write(0x60FF, 20 * heading)
    turned.go(5)
    turned.drive.axis.switches = Switches(positive=turned.motor.measured_position)
    turned.go(1)
    speeds = []
    for _ in range(3):
        speeds.append(1e3 * turned.motor.calls[-1][1])
        turned.go(1)
    expected = [20.0, 19.6, 19.2] if stops else [-20.0] * 3
    assert speeds == [pytest.approx(speed) for speed in expected]
    assert bool(turned.read(0x6041) & 0x0800) is stops
    turned.go(60)
    assert turned.motor.measured_velocity == pytest.approx(0.0 if stops else -20e-3)


def test_targets_in_increments_are_converted():
    """257Ah of an MCLM: increments of 8 um into units of 1 um, within the type."""
    turned = Turned("mclm", x2350_4=24)
    turned.go(1)
    assert turned.drive.axis.units.position == pytest.approx(1e-6)
    for increments, target in ((125, 1000), (-125, -1000), (2**31 - 1, 2**31 - 1), (-(2**31), -(2**31))):
        turned.write(0x257A, increments)
        assert turned.read(0x607A) == target


def test_a_drive_boots_and_enables_in_its_cycles():
    described = profile("faulhaber_v3")
    drive = Drive(described, 1, IdealMotor(described.motor))
    assert drive.state is State.NOT_READY
    drive.advance(MILLISECOND)
    assert drive.state is State.DISABLED
    dictionary = drive.dictionary
    for word, state in ((0x06, State.READY), (0x0F, State.SWITCHED_ON)):
        dictionary.write(dictionary.entry(0x6040), word)
        assert drive.state is state
    drive.advance(2 * MILLISECOND)
    assert drive.state is State.ENABLED
