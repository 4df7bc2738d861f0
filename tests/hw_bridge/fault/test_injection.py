"""What a fault does, of every cause: disturbed frames, and the property of the drive that becomes faulty."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import NEVER, Disturbance, Kind
from hw_bridge.fault import Cause, Fault, inject, problem
from hw_bridge.fault.action import disturbance
from hw_bridge.profiles import profile
from tests.every_case import every_case
from twin.errors import SimulationError

DRIVE = frozenset({0x083, 0x183, 0x283, 0x383, 0x483, 0x583, 0x703})
MASTER = frozenset(
    {0, 0x080, 0x77F, *(base + node for base in (0x200, 0x300, 0x400, 0x500, 0x600) for node in range(1, 128))}
)


@every_case(
    ("fault", "kind", "count", "drive", "master"),
    [
        (Fault(Cause.DROP), Kind.DROP, NEVER, DRIVE, MASTER),
        (Fault(Cause.DELAY, count=4), Kind.DELAY, 4, DRIVE, MASTER),
        (Fault(Cause.CORRUPT, count=1), Kind.CORRUPT, 1, DRIVE, MASTER),
        (Fault(Cause.BUS_OFF, count=1), Kind.CORRUPT, 32, DRIVE, MASTER),
        (Fault(Cause.SYNC), Kind.DROP, NEVER, frozenset({0x80}), frozenset({0x80})),
        (Fault(Cause.HEARTBEAT), Kind.DROP, NEVER, frozenset({0x703}), frozenset({0x77F})),
        (
            Fault(Cause.DROP, identifiers=(0x181, 0x183)),
            Kind.DROP,
            NEVER,
            frozenset({0x181, 0x182, 0x183}),
            frozenset({0x181, 0x182, 0x183}),
        ),
    ],
)
def test_frames_that_a_fault_disturbs(fault, kind, count, drive, master):
    for node, is_master, identifiers in ((3, False, drive), (127, True, master)):
        made = disturbance(fault, 100, node, is_master)
        assert made == Disturbance(
            kind, start=100, end=NEVER, share=1.0, count=count, delay=10_000_000, jitter=0, only=identifiers
        )


def test_how_long_and_how_often_frames_are_disturbed():
    fault = Fault(Cause.DELAY, duration=50, share=0.25, delay=7, jitter=3)
    made = disturbance(fault, 100, 3, False)
    assert (made.start, made.end, made.share, made.delay, made.jitter) == (100, 150, 0.25, 7, 3)
    assert disturbance(Fault(Cause.DROP, duration=0), 100, 3, False).end == 100


@pytest.fixture
def drive():
    """A drive that records what is done to it; its bus is at 500."""
    made = SimpleNamespace(profile=profile("epos4"), calls=[], now=200)
    note = made.calls.append
    made.advance = lambda time: note(("advance", time))
    made.restart = lambda: note(("restart",))
    made.inject = lambda code, lasting: note(("inject", code, lasting))
    motor = SimpleNamespace(grip=1.0, offset=0.0)
    motor.stick = lambda: note(("stick",))
    motor.scale = lambda name, factor: note(("scale", name, factor))
    made.axis = SimpleNamespace(motor=motor)
    return made


@pytest.mark.parametrize(
    ("fault", "calls"),
    [
        (Fault(Cause.EMCY, code=0x7300, lasting=True), [("inject", 0x7300, True)]),
        (Fault(Cause.OVERCURRENT), [("inject", 0x2310, False)]),
        (Fault(Cause.ENCODER), [("stick",), ("inject", 0x7320, False)]),
        (Fault(Cause.FRICTION, factor=3.0), [("scale", "friction_coulomb", 3.0)]),
        (Fault(Cause.SLOW, factor=0.2), [("scale", "velocity_gain", 0.2), ("scale", "velocity_integral", 0.2)]),
        (Fault(Cause.RESET), [("restart",)]),
        (Fault(Cause.GRIP, factor=0.3, offset=9.0), []),
        (Fault(Cause.ENCODER_OFFSET, factor=9.0, offset=-1e-3), []),
    ],
)
def test_what_becomes_faulty_in_a_drive(drive, fault, calls):
    medium = SimpleNamespace(now=500, disturbances=[])
    inject(fault, medium, 3, drive)
    assert drive.calls == [("advance", 500), *calls]
    assert drive.axis.motor.grip == (0.3 if fault.cause is Cause.GRIP else 1.0)
    assert drive.axis.motor.offset == (-1e-3 if fault.cause is Cause.ENCODER_OFFSET else 0.0)
    assert medium.disturbances == []
    drive.now = 900  # a drive that is ahead of its bus stays there
    inject(Fault(Cause.RESET), medium, 3, drive)
    assert drive.calls[-2] == ("advance", 900)


def test_a_fault_of_frames_goes_to_the_bus(drive):
    medium = SimpleNamespace(now=500, disturbances=[])
    inject(Fault(Cause.DROP), medium, 3, drive)
    inject(Fault(Cause.DROP), medium, 127, None)
    assert [made.only for made in medium.disturbances] == [DRIVE, MASTER]
    assert drive.calls == []
    with pytest.raises(SimulationError, match=r"^grip: is a fault of a drive\. Name a drive instead of the master\.$"):
        inject(Fault(Cause.GRIP), medium, 127, None)


@every_case(
    ("key", "fitting", "wrong"),
    [
        ("code", (0, 0xFFFF), (-1, 0x10000, True, "7300h")),
        ("duration", (0, NEVER), (-1, NEVER + 1)),
        ("share", (0.0, 1.0), (-0.001, 1.001, float("nan"))),
        ("count", (1, NEVER), (0, NEVER + 1)),
        ("delay", (0, NEVER), (-1,)),
        ("jitter", (0, NEVER), (-1,)),
        ("offset", (-1e6, 1e6), (-1.1e6, 1.1e6, float("inf"))),
        ("factor", (0.0, 1e6), (-1e-9, 1.1e6, None)),
        ("identifiers", ((0, 0x7FF), (5, 5)), ((0, 0x800), (6, 5), (-1, 5), (5,), (1.0, 5))),
    ],
)
def test_numbers_of_a_fault(key, fitting, wrong):
    drop = Cause.DROP
    assert [problem(Fault(drop, **{key: value}), profile("epos4")) for value in fitting] == [""] * len(fitting)
    for value in wrong:
        assert problem(Fault(drop, **{key: value}), profile("epos4")).startswith(
            (f"{key} is {value}", f"{key} are {value}")
        )


@every_case("cause", Cause)
def test_nodes_that_can_have_a_fault(cause):
    """A master and a module have no motor; a module can start anew, this program cannot."""
    of_drives = {
        Cause.EMCY,
        Cause.OVERCURRENT,
        Cause.ENCODER,
        Cause.ENCODER_OFFSET,
        Cause.FRICTION,
        Cause.GRIP,
        Cause.SLOW,
    }
    text = f"{cause} is a fault of a drive. Name a drive"
    fault = Fault(cause, code=0x7320)
    assert problem(fault, None, master=True) == (text if cause in {*of_drives, Cause.RESET} else "")
    assert problem(fault, None, master=False) == (text if cause in of_drives else "")
    assert problem(fault, profile("epos4")) == ""
