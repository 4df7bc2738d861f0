"""States of a co-simulation that are saved and restored, values that are replaced, and values moved by a transfer."""

import numpy as np
import pytest

from tests.coupling.mock import Mock
from tests.coupling.parts import Bomb, Clock, Gain, Hold, Lag, SlowClock, SlowHold, couple
from tests.coupling.test_linear_equations import ThreeToTwo
from twin.coupling import (
    Algorithm,
    RecordMember,
    Transfer,
    published_address,
    published_copies,
    restore_state,
    save_state,
    serialization_problems,
)
from twin.errors import CouplingError, SimulationError

MS = 1_000_000
WIRES = ["clock.y -> hold.u", "slow.y -> slow_hold.u", "lag.y -> gain.u", "gain.y -> lag.u"]


def parts():
    return {
        "clock": Clock(),
        "hold": Hold(),
        "slow": SlowClock(),
        "slow_hold": SlowHold(),
        "lag": Lag(x=1.0),
        "gain": Gain(),
    }


def started(build, algorithm=Algorithm.jacobi, wires=WIRES, begin=0):
    simulated = couple(build, parts(), wires, algorithm)
    simulated.initialize(begin)
    return simulated


def values(simulated):
    return {key: np.array(simulated.value(key)).tolist() for key in simulated.recorded}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", ["jacobi", {"name": "jacobi", "order": 2}, "iterative", "predictive"])
def test_a_restored_run_goes_on_as_the_saved_one(algorithm, build):
    """Saved between two steps of the slow members, restored in other memory."""
    first = started(build, Algorithm(algorithm))
    first.advance(13 * MS)
    saved = save_state(first)
    at_saved = values(first)
    first.advance(40 * MS)
    second = started(build, Algorithm(algorithm))
    second.advance(2 * MS)
    restore_state(second, saved)
    assert (second.time, values(second)) == (13 * MS, at_saved)
    second.advance(40 * MS)
    assert values(second) == values(first)
    assert values(first)[("slow_hold", "y")] == pytest.approx(0.03)
    counts = [run.members["hold"].get("count") for run in (first, second)]
    assert counts[0] == counts[1] >= 40
    for run in (first, second):
        run.terminate()


def test_a_state_of_another_coupling_is_refused(build):
    saved = save_state(started(build))
    other = started(build, Algorithm("iterative"))
    with pytest.raises(CouplingError, match="the saved state is of another coupling of the members"):
        restore_state(other, saved)


def test_members_without_a_saved_state_are_named():
    members = {"lag": RecordMember("lag", Lag()), "bomb": RecordMember("bomb", Bomb())}
    clocked = RecordMember("clocked", Lag())
    clocked.clocked = True
    assert serialization_problems(members | {"clocked": clocked}) == [
        "bomb: cannot be saved in a checkpoint: it is Python-side, and its state lies in Python objects.",
        "clocked: cannot be saved in a checkpoint: it has clocks, whose state is not saved.",
    ]


def test_published_values_of_slow_members_lie_outside_of_their_records(build):
    simulated = started(build)
    members = simulated.members
    assert published_copies(simulated, "clock") == {}
    ((address, words),) = published_copies(simulated, "slow").values()
    assert words == 1
    assert published_address(simulated, ("slow", "y")) == address != members["slow"].address("y")
    assert published_address(simulated, ("clock", "y")) == members["clock"].address("y")
    assert published_address(simulated, ("hold", "u")) == members["hold"].address("u")
    assert published_address(simulated, ("hold", "count")) == members["hold"].address("count")
    simulated.terminate()


def test_a_transfer_copies_converts_and_evaluates(build):
    """Outputs follow from the states that were copied, at the time reached."""
    simulated = started(build, begin=5 * MS)
    simulated.advance(8 * MS)
    members, given, taken = simulated.members, np.array([2.5]), np.zeros(1)
    lag, hold = members["lag"], members["hold"]
    move = Transfer(
        simulated,
        build,
        copies=[(int(given.ctypes.data), lag.address("x"), 1)],
        conversions=[(hold.address("count"), np.dtype(np.int32), int(taken.ctypes.data))],
        evaluated=[lag, members["clock"]],
    )
    before = int(simulated.state["tick"]), simulated.time
    move()
    assert (lag.get("x"), lag.get("y"), taken[0]) == (2.5, 2.5, 3.0)
    assert members["clock"].get("y") == 0.008, "a step of no length from there"
    assert (int(simulated.state["tick"]), simulated.time) == before
    given[0] = -1.0
    move()
    assert lag.get("y") == -1.0
    simulated.terminate()


def test_single_elements_are_replaced_and_released(build):
    """The readers get an element's replaced value at once, and the other elements from the member."""
    plain = couple(build, {"a": ThreeToTwo(offset=0.5), "gain": Gain()}, ["a.y[2] -> gain.u"])
    simulated, key, seen = plain.renewed(split=[("a", "y")]), ("a", "y"), []

    def go(until):
        simulated.advance(until * MS)
        seen.append((simulated.value(key).tolist(), float(simulated.value(("gain", "u")))))

    simulated.initialize(0)
    go(2)
    simulated.override(key, 7.0, 1)
    assert simulated.value(key).tolist() == [0.5, 7.0]
    simulated.set(("a", "offset"), 0.75)
    go(4)
    assert simulated.members["a"].get("y").tolist() == [0.75, 0.75], "the member computes what it computed"
    simulated.override(key, 8.0, 0)
    go(6)
    simulated.release(key, 1)
    assert simulated.value(key).tolist() == [8.0, 0.75]
    go(8)
    assert seen == [([0.5, 0.5], 0.5), ([0.75, 7.0], 7.0), ([8.0, 7.0], 7.0), ([8.0, 0.75], 0.75)]
    with pytest.raises(CouplingError, match=r"gain.y: nothing reads it, so overriding it has no effect. Use set."):
        simulated.override(("gain", "y"), 1.0, 0)
    simulated.terminate()


def test_a_member_that_cannot_be_evaluated_is_named(build):
    simulated = started(build)
    refusing = Mock("hold", longest=-1.0)
    move = Transfer(simulated, build, evaluated=[simulated.members["lag"], refusing])
    with pytest.raises(SimulationError, match=r"^hold: failed with status 3\.$"):
        move()
    simulated.terminate()
