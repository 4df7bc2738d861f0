"""The origin of a drive is defined from a position that it has sent, not from the zero of before."""

from contextlib import suppress

import pytest

from hw_bridge.master import node as node_module
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError


@pytest.fixture
def lossy(monkeypatch):
    """Loses the first process data with a position; says when each drive had sent one as its origin was defined."""
    process, zero, origins = node_module.Node.process_frame, node_module.Node.zero, []

    def lose(count):
        left = [count]

        def lossy_process(self, frame, now):
            if frame.id - self.number == node_module.STATE_PDO and left[0] > 0:
                left[0] -= 1
                return
            process(self, frame, now)

        def recorded_zero(self, position):
            origins.append((left[0], self.answered_at))
            zero(self, position)

        monkeypatch.setattr(node_module.Node, "process_frame", lossy_process)
        monkeypatch.setattr(node_module.Node, "zero", recorded_zero)
        return origins

    return lose


@pytest.mark.parametrize("profile", ["faulhaber_v3", "epos4"])
@pytest.mark.parametrize("lost", [0, 3, 5])
def test_the_origin_waits_for_the_first_position(lossy, build, profile, lost):
    origins = lossy(lost)
    rig = Rig(build, {"axis": node(profile)})
    rig.set(target_position=0.010)
    with suppress(SimulationError):  # three lost answers leave in doubt how old a value is, which ends the run
        rig.go(50)
    ((left, answered_at),) = origins
    assert left == 0
    assert answered_at > 0


def test_without_a_position_nothing_is_enabled(lossy, build):
    origins = lossy(10**9)
    rig = Rig(build, {"axis": node()})
    with pytest.raises(SimulationError, match=r"axis: no process data while it was brought up"):
        rig.go(50)
    assert origins == []
