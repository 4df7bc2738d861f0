"""What a person who watches over drives is told: who holds control, what a second master did, what the shadow sees."""

import json
import struct
from types import SimpleNamespace

import pytest

from hw_bridge.bridge import status
from hw_bridge.bridge.hardware import Hardware
from hw_bridge.bus import Frame, SimulatedNetwork
from hw_bridge.session.run_outcome import RunOutcome
from tests.hw_bridge.axis import Rig, node
from twin.console import safety
from twin.errors import SimulationError

BANDS = {"position": "0.1 mm", "velocity": "10 mm/s", "current": "60 mA"}


@pytest.fixture
def rig(build):
    """An axis that moves, with its shadow; its encoder slips after 0.3 s."""
    slips = {"at": "0.3 s", "node": "servomotor", "fault": "encoder_offset", "offset": "0.5 mm"}
    return Rig(build, {"servomotor": node(shadow={"window": "50 ms", **BANDS})}, faults=[slips])


def told(rig):
    """What the page is sent, and shows."""
    found = json.loads(json.dumps(rig.hardware.status(), allow_nan=False))
    return found, safety.heading(found) + safety.drives(found) + safety.details(found)


@pytest.mark.slow
def test_the_master_is_this_session_from_its_first_step_to_its_end(rig):
    rig.hardware.status()  # asked for before there is a bus
    status, page = told(rig)
    assert (status["control"], status["brought_up"], status["nodes"]) == ("no program", False, {})
    assert "<dt>master</dt><dd>no program</dd>" in page
    rig.set(target_velocity=0.05)
    rig.go(100)
    status, page = told(rig)
    assert (status["control"], status["brought_up"], status["stopped"]) == ("this session", True, "")
    assert status["nodes"]["servomotor"]["state"] == "Operation enabled"
    assert "<dt>master</dt><dd>this session</dd>" in page
    rig.axis.close()
    status, page = told(rig)
    assert (status["control"], status["stopped"]) == ("no program", "stopped")
    assert status["nodes"]["servomotor"]["state"] == "Switch on disabled"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (Frame(0x080), "another master on the bus sent SYNC"),
        (Frame(0x201, struct.pack("<i", 0)), "another master on the bus sends servomotor targets"),
        (Frame(0x77F, b"\5"), "node 127: another master tells that it lives on this ID"),
    ],
)
def test_a_second_master_is_named_before_and_after_the_stop(rig, frame, text):
    rig.set(target_velocity=0.05)
    rig.go(100)
    other = SimulatedNetwork(rig.session.bench.bus)
    other.send(Frame(0x700 + 99, b"\5"))
    other.send(frame)
    rig.go(1)  # the frame is heard; the master judges at its next cycle
    status, page = told(rig)
    assert status["stopped"] == ""
    assert status["control"].startswith(text)
    assert status["control"].endswith("It may be node 99, not in the hardware file.")
    assert safety.escaped(text) in page
    with pytest.raises(SimulationError, match="another master"):
        rig.go(20)
    status, page = told(rig)
    assert status["control"].startswith(text)
    assert text in status["stopped"]
    assert status["nodes"]["servomotor"]["state"] == "Switch on disabled"
    assert f'twin-bad">stopped: {safety.escaped(text)}' in page
    assert any("can enable the drives again" in note for note in status["notes"])
    assert "can enable the drives again" in page


@pytest.mark.slow
def test_the_shadows_residual_is_told_beside_its_band(rig):
    rig.set(target_velocity=0.02)
    rig.go(200)
    status, page = told(rig)
    shadow = status["shadow"]["servomotor"]
    assert shadow["now"] == {"position": 0.0, "velocity": 0.0, "current": 0.0}  # the same to the bit without a fault
    assert shadow["bands"] == pytest.approx({"position": 1e-4, "velocity": 0.01, "current": 0.06})
    assert "shadow servomotor" in page
    assert "position 0 mm (band 0.1 mm, largest 0 mm)" in page
    rig.go(300)
    status, page = told(rig)
    shadow = status["shadow"]["servomotor"]
    assert abs(shadow["now"]["position"]) == pytest.approx(0.5e-3, abs=0.05e-3)
    assert shadow["largest"]["position"] >= abs(shadow["now"]["position"])
    assert "the encoder" in shadow["warnings"][0]
    assert safety.escaped(shadow["warnings"][0]) in page


def test_a_shadow_that_has_not_looked_yet(rig):
    rig.go(1)
    status, page = told(rig)
    assert status["shadow"]["servomotor"]["now"] == {"position": None, "velocity": None, "current": None}
    assert "position not known (band 0.1 mm" in page


def test_how_a_run_ended_is_told_by_the_last_case_that_began():
    def case(number, is_started=True):
        outcome = RunOutcome()
        outcome.stopped = number, f"case {number}"
        return SimpleNamespace(is_started=is_started, outcome=outcome)

    ended, waiting = [case(1), case(2)], case(3, is_started=False)
    for sessions, reason in (([], ""), (ended, "case 2"), ([*ended, waiting], ""), ([waiting], "")):
        assert Hardware.termination(SimpleNamespace(sessions=sessions)).reason == reason


IDLE = {
    "file": "bench.yaml",
    "interface": "socketcan",
    "channel": "can0",
    "armed": True,
    "simulated": False,
    "software": True,
    "cycle": 0.005,
    "control": "no program",
    "brought_up": False,
    "stopped": "",
    "nodes": {},
    "modules": {},
    "watches": {},
    "shadow": {},
    "notes": [],
}


def test_the_status_without_and_with_a_session():
    """As a page gets it: before a bus is there, while it runs, after a stop, beside another master."""
    keys = SimpleNamespace(
        interface="socketcan", channel="can0", simulated=False, cycle=5_000_000, is_software=lambda: True
    )
    hardware = SimpleNamespace(keys=keys, path="bench.yaml", arm=True, present=None)
    assert status.status(hardware, None) == IDLE
    outcome = SimpleNamespace(stopped=None, notes=["hot"])
    master = SimpleNamespace(
        foreign_master=SimpleNamespace(text=""),
        timing=SimpleNamespace(sent=[0, 5_000_000, 10_100_000]),
        cycle=5_000_000,
        nodes={},
        modules={},
    )
    force = {"contact_force": float("nan")}
    watch = SimpleNamespace(keys=SimpleNamespace(signal="wall.force", above=0.4), reason="")
    session = SimpleNamespace(
        master=None,
        outcome=outcome,
        closed=False,
        running=True,
        real_time=True,
        late_cycle_policy=SimpleNamespace(report=lambda: {"overruns": 2}),
        watches={"slide": watch},
        orders=SimpleNamespace(axes={"slide": SimpleNamespace(views=force)}),
        observers={"slide": SimpleNamespace(report=lambda: {"now": 1.0})},
    )
    hardware.present = session
    assert status.status(hardware, None) == IDLE
    session.master = master
    running = IDLE | {
        "control": "this session",
        "brought_up": True,
        "notes": ["hot"],
        "cycles": 3,
        "jitter_99": pytest.approx(0.99 * 1e-4),
        "jitter_max": pytest.approx(1e-4),
        "bus_load": 0.25,
        "real_time_priority": True,
        "overruns": 2,
        "watches": {"slide": {"signal": "wall.force", "above": 0.4, "retracts": "", "force": None}},
        "shadow": {"slide": {"now": 1.0}},
    }
    assert status.status(hardware, SimpleNamespace(share=0.25)) == running
    session.closed = True
    ended = running | {"control": "no program", "stopped": "stopped", "bus_load": 0.0}
    assert status.status(hardware, None) == ended
    outcome.stopped = 7, "too hot"
    master.foreign_master.text = "another master"
    assert status.status(hardware, None) == ended | {"control": "another master", "stopped": "too hot"}
    session.running, master.timing.sent = False, []
    found = status.status(hardware, None)
    assert (found["brought_up"], found["cycles"], found["jitter_99"], found["jitter_max"]) == (False, 0, 0.0, 0.0)
