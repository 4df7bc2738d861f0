"""The loop: order, delays, periods, overrides, failures, recording; compiled and interpreted agree to the bit."""

import numpy as np
import pytest

from tests.coupling.parts import (
    Bomb,
    Clock,
    Diverging,
    Gain,
    Hold,
    Lag,
    Millimeters,
    SlowClock,
    SlowHold,
    couple,
    trajectory,
)
from twin.coupling import Algorithm
from twin.errors import CouplingError, SimulationError

MS = 1_000_000


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", Algorithm)
def test_modes_agree_to_the_bit(build, algorithm):
    parts = {"a": Lag, "b": Gain, "c": SlowHold}
    wires = ["a.y -> b.u", "b.y -> a.u"]
    runs = [
        trajectory(couple(build, {n: c() for n, c in parts.items()}, wires, algorithm, mode=m), 200 * MS, "a.y")
        for m in ("compiled", "interpreted")
    ]
    assert runs[0].tobytes() == runs[1].tobytes()
    assert 0.5 < runs[0][-1] < 2.0


def test_jacobi_delays_each_hop_by_one_step(build):
    chain = couple(build, {"clock": Clock(), "one": Hold(), "two": Hold()}, ["clock.y -> one.u", "one.y -> two.u"])
    two = trajectory(chain, 10 * MS, "two.y")
    assert two.tolist() == [max(0.0, (k - 2) / 1000) for k in range(11)]


def test_gauss_seidel_follows_the_connections_not_the_declaration(build):
    parts = {"two": Hold(), "one": Hold(), "clock": Clock()}
    chain = couple(build, parts, ["clock.y -> one.u", "one.y -> two.u"], Algorithm.gauss_seidel)
    assert chain.order() == [["clock"], ["one"], ["two"]]
    assert {delay for _, delay in chain.delays()} == {0}
    np.testing.assert_allclose(trajectory(chain, 10 * MS, "two.y"), np.arange(11) / 1000)


@pytest.mark.parametrize("algorithm", [Algorithm.jacobi, Algorithm.gauss_seidel])
def test_what_a_slow_member_takes_is_as_old_as_its_delay_says(build, algorithm):
    coupled = couple(build, {"clock": Clock(), "slow": SlowHold()}, ["clock.y -> slow.u"], algorithm)
    ((_, delay),) = coupled.delays()
    slow, period = trajectory(coupled, 40 * MS, "slow.y"), coupled.periods["slow"]
    published = np.arange(period // MS, 41, period // MS)
    np.testing.assert_allclose(slow[published], (published - delay // MS) / 1000)


@pytest.mark.parametrize(("algorithm", "delay"), [(Algorithm.jacobi, 1), (Algorithm.gauss_seidel, 0)])
def test_who_is_fast_sees_a_slow_member_as_late_as_its_delay_says(build, algorithm, delay):
    parts = {"fast": Hold(), "clock": Clock(), "slow": SlowHold()}
    coupled = couple(build, parts, ["clock.y -> slow.u", "slow.y -> fast.u"], algorithm)
    assert [found for link, found in coupled.delays() if link.target.member == "fast"] == [delay * MS]
    coupled.initialize(0)
    coupled.advance(40 * MS)
    recorded = coupled.recording().signals
    slow, fast = recorded["slow.y"], recorded["fast.y"]
    assert len(set(slow.tolist())) > 3
    assert fast[1:].tolist() == slow[1 - delay : len(slow) - delay].tolist()
    coupled.terminate()


@pytest.mark.parametrize("algorithm", Algorithm)
def test_a_slow_member_publishes_when_due(build, algorithm):
    parts = {"clock": SlowClock(), "slow": SlowHold(), "fast": Hold()}
    chain = couple(build, parts, ["clock.y -> slow.u", "slow.y -> fast.u"], algorithm)
    chain.initialize(0, 50 * MS)
    chain.advance(50 * MS)
    signals = chain.recording().signals
    expected = np.array([k // 10 * 0.01 for k in range(51)])
    np.testing.assert_array_equal(signals["clock.y"], expected)
    assert signals["slow.y"][19] == 0.0
    assert signals["slow.y"][30] == pytest.approx(0.02)
    assert np.all(signals["fast.y"] <= np.arange(51) / 1000 + 1e-12), "nobody reads the future"


def test_a_period_that_does_not_divide_is_an_error(build):
    with pytest.raises(
        CouplingError, match=r"slow: period 10 ms is not a multiple of 3 ms. Use 9 ms or 12 ms, or .* 1 ms"
    ):
        couple(build, {"slow": SlowHold()}, [], step=3 * MS)


def test_units_and_types_convert(build):
    parts = {"lag": Lag(x=0.002), "mm": Millimeters(), "again": Millimeters()}
    pair = couple(build, parts, ["lag.y -> mm.u", "mm.positive -> again.n"])
    pair.initialize(0, 5 * MS)
    assert parts["mm"].u == pytest.approx(2.0)
    pair.advance(5 * MS)
    assert parts["again"].n == 1.0
    assert pair.recording().signals["mm.positive"].dtype == bool


def test_algebraic_loop_is_solved_at_initialization(build):
    loop = couple(build, {"a": Gain(), "b": Gain(k=-2.0)}, ["a.y -> b.u", "b.y -> a.u"])
    loop.initialize(0, 5 * MS)
    # y_a = (y_b)/2 + 1, y_b = -2 y_a + 1: y_a = 0.75
    assert loop.recording().signals["a.y"][0] == pytest.approx(0.75, abs=1e-12)


def test_unsolvable_loop_says_so(build):
    loop = couple(build, {"a": Gain(k=1.0), "b": Gain(k=1.0)}, ["a.y -> b.u", "b.y -> a.u"])
    with pytest.raises(SimulationError, match=r"algebraic loop through a\.y, b\.y"):
        loop.initialize(0)


def test_failure_names_member_time_inputs_and_log_and_keeps_the_recording(build):
    bomb = Bomb()
    pair = couple(build, {"lag": Lag(x=1.0), "bomb": bomb}, ["lag.y -> bomb.u"])
    pair.initialize(0, 100 * MS)
    with pytest.raises(
        SimulationError, match=r"bomb: failed with ERROR in the step from t = 50 ms.*u=.*ValueError: boom"
    ):
        pair.advance(100 * MS)
    pair.terminate()
    pair.terminate()
    assert len(pair.recording().time) == 51
    assert bomb.closed == 1


def test_a_state_that_is_not_finite_stops_the_run(build):
    with pytest.raises(SimulationError, match=r"diverging.der_x is inf at t = 6 ms, with finite inputs"):
        trajectory(couple(build, {"diverging": Diverging()}, []), 100 * MS, "diverging.y")


def test_override_and_release(build):
    parts = {"clock": Clock(), "hold": Hold()}
    pair = couple(build, parts, ["clock.y -> hold.u"])
    pair.initialize(0, 30 * MS)
    pair.advance(10 * MS)
    pair.override(("clock", "y"), 7.0)
    pair.advance(20 * MS)
    pair.release(("clock", "y"))
    pair.override(("hold", "u"), -1.0)
    pair.advance(25 * MS)
    pair.release(("hold", "u"))
    pair.advance(30 * MS)
    signals = pair.recording().signals
    assert signals["hold.y"][11:21].tolist() == [7.0] * 10
    assert signals["clock.y"][20] == 7.0
    assert signals["clock.y"][21] == pytest.approx(0.021)
    assert signals["hold.y"][21:26].tolist() == [-1.0] * 5
    assert signals["hold.y"][26] == pytest.approx(0.025)


def test_recording_at_its_own_rate_and_across_full_buffers(build, monkeypatch):
    monkeypatch.setattr("twin.coupling.execution.recorder.BUFFER_BYTES", 64)
    chain = couple(build, {"clock": Clock()}, [], every=5 * MS)
    chain.initialize(0)
    chain.advance(1000 * MS)
    recording = chain.recording()
    np.testing.assert_array_equal(recording.time, [k * 5 / 1000 for k in range(201)])
    np.testing.assert_allclose(recording.signals["clock.y"][1:], recording.time[1:])


def test_time_does_not_drift(build):
    chain = couple(build, {"clock": Clock()}, [], step=100_000, every=100_000_000)
    chain.initialize(0)
    chain.advance(100_000_000_000)
    assert chain.recording().time[-1] == 100.0
