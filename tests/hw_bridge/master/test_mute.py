"""A drive that lives but takes no SDO: named where it is asked, and safe where it is stopped."""

import pytest

from hw_bridge.bus import MILLISECOND
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge_safety import after, speed, stopped
from twin.errors import SimulationError


@pytest.mark.parametrize("since", [200, 300])
def test_before_and_while_it_is_set_up(build, monkeypatch, since):
    rig = Rig(build, {"servomotor": node()})
    begin = Session.network

    def mute(self):
        made, drive = begin(self), self.bench.plants["servomotor"].drive
        self.bench.bus.event_queue.at(
            since * MILLISECOND, lambda: monkeypatch.setattr(drive.sdo, "answer", lambda _: None)
        )
        return made

    monkeypatch.setattr(Session, "network", mute)
    with pytest.raises(
        SimulationError, match=r"servomotor: node 1: no answer on .* It tells that it lives, but takes no"
    ):
        rig.go(1)
    assert stopped(rig.drive)


def test_a_moving_drive_stops_all_the_same(build, monkeypatch):
    """By its process data; what could not be confirmed is told, and the drive still watches the heartbeat."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_velocity=0.05)
    rig.go(200)
    monkeypatch.setattr(rig.drive.sdo, "answer", lambda _: None)
    rig.axis.close()
    assert stopped(rig.drive)
    (note,) = rig.session.outcome.notes
    assert "did not confirm that it is disabled (last state: Switch on disabled). node 1: no answer on 6040h.0" in note
    after(rig, 500)
    assert speed(rig) < 1e-3
    assert 0x8130 in rig.drive.active
