"""Times are exact ratios: no step is too odd, and none adds up."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

import twin
from tests.coupling.parts import Clock
from tests.every_case import every_case
from twin import clock
from twin.component import catalog
from twin.errors import CouplingError
from twin.fmi.exporting import fmu_cache
from twin.results.recording.run_folder import read_signals
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, duration, parse_scenario

if TYPE_CHECKING:
    from pathlib import Path


@every_case(
    ("written", "seconds"),
    [
        (0.1, Fraction(1, 10)),
        ("0.001", Fraction(1, 1000)),
        (1 / 30, Fraction(1, 30)),
        ("1/30", Fraction(1, 30)),
        (0.001 / 3, Fraction(1, 3000)),
        ("0.3333333333333333", Fraction(1, 3)),
        (1e-10, Fraction(1, 10**10)),
    ],
)
def test_a_time_is_the_ratio_that_is_meant(written: float | str, seconds: Fraction) -> None:
    time = clock.nanoseconds(written)
    assert Fraction(time) / 10**9 == seconds
    assert isinstance(time, int) == ((seconds * 10**9).denominator == 1)
    assert clock.seconds(time) == float(seconds)


@given(st.floats(1e-12, 1e6))
def test_no_float_is_too_odd(value: float) -> None:
    assert clock.seconds(clock.nanoseconds(value)) == value


@given(st.fractions(1, 10**12, max_denominator=1000), st.integers(0, 10**6))
def test_what_the_loop_counts_is_exact(step: Fraction, number: int) -> None:
    begin, size, per_second = clock.to_ticks(0, clock.to_time(step))
    assert Fraction(begin + number * size, per_second) == number * step / 10**9
    assert clock.at(size, per_second) == step


@every_case("text", ["x", "1/0", "", "nan", "1e-400", "1 / 3 /"])
def test_no_time(text: str) -> None:
    with pytest.raises(CouplingError, match=r"is not a time. Give seconds, such as 0.001 or 1/30"):
        clock.nanoseconds(text)


def test_the_step_common_to_ratios() -> None:
    assert clock.common_step([clock.nanoseconds("1/30"), clock.nanoseconds("1/50")]) == clock.nanoseconds("1/150")
    assert clock.common_step([6_000_000, 4_000_000]) == 2_000_000


@pytest.mark.parametrize(
    ("time", "text"), [("1/30", "1/30 s"), (0.0015, "1.5 ms"), (0.0333333333333333, "0.0333333333 s")]
)
def test_text(time: float | str, text: str) -> None:
    assert clock.text(clock.nanoseconds(time)) == text
    assert duration(clock.exact_text(clock.nanoseconds("1/30"))) == clock.nanoseconds("1/30")


def test_a_step_that_cannot_be_counted_so_far() -> None:
    with pytest.raises(
        CouplingError, match=r"step 0.0333333333 s: so odd a step cannot be counted exactly to 1e\+11 s"
    ):
        clock.to_ticks(0, clock.nanoseconds("0.0333333333333333"), 10**20)


@pytest.mark.slow
@pytest.mark.parametrize("form", [Backend.fmu, Backend.interpreted])
def test_a_run_in_steps_of_a_thirtieth(tmp_path: Path, build: Path, form: Backend) -> None:
    scenario = parse_scenario(
        """
        start_time: 1/3 s
        stop_time: 4/3 s
        step: 1/30 s
        members: {rail: {component: chirp, communication_step: 1/15 s}, wall: {component: wall}}
        connections: ["rail.position -> wall.tip_position"]
        events: [{at: 1/2 s, set: {rail.amplitude: 0 mm}}]
        metrics: {still: {signal: abs(rail.position), reduce: max, from: 18/30 s, unit: mm}}
        """,
        tmp_path / "s.yaml",
    )
    done = run_scenario(scenario, RunOptions(backend=form, root=tmp_path, build=build, report=False))
    signals = read_signals(done.folder / "signals.parquet")[0]["base", 0]
    assert signals.time.tolist() == [float(Fraction(10 + n, 30)) for n in range(31)]
    assert done.summary["metrics"]["still"]["variants"]["base"]["mean"] == 0.0
    assert done.summary["step"] == 1 / 30


def test_steps_of_a_third_of_a_millisecond_in_python() -> None:
    system = twin.System()
    system.add("counter", Clock)
    with system.simulate(step="1/3 ms", backend="interpreted") as simulation:
        for _ in range(7):
            simulation.advance()
        assert simulation.time == float(Fraction(7, 3000))
        simulation.advance(until="1 s")
        assert simulation.time == 1.0


def test_a_component_samples_at_whole_nanoseconds(tmp_path: Path) -> None:
    text = "stop_time: 1 s\nstep: 1/30 s\nmembers: {c: {component: pi_control, period: 1/30 s}}\n"
    with pytest.raises(twin.TwinError, match=r"s.yaml:3: period: 1/30 s: components count in whole nanoseconds"):
        run_scenario(parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path))


def test_a_row_belongs_to_the_step_that_its_time_names(build: Path) -> None:
    fmu = fmu_cache.build(catalog.component("chirp"), "3.0", build)
    found = twin.simulate(fmu, step_size=1 / 30, stop_time=0.2, output_interval="1/15 s")
    assert found["time"].tolist() == [float(Fraction(n, 15)) for n in range(4)]
