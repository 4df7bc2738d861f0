"""What a case couples, what its members cost, whether it is stable: `twin graph`, `twin profile`, `twin check --stability`."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from twin import clock
from twin.coupling import Algorithm, Growth, Stopwatch, growth
from twin.errors import CouplingError, SimulationError
from twin.run.cases import Progress, build_simulation, noop
from twin.run.conditions import apply_event
from twin.scenario import Backend, members
from twin.structure import CostProfile, Structure, profiled, short_name, structure

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from twin.coupling import Catalog, CoSimulation
    from twin.scenario import Case


def component_names(case: Case) -> dict[str, str]:
    """Return the components of the members, without folders of files."""
    return {name: short_name(spec.component) for name, spec in case.members.items()}


def case_structure(case: Case, cosimulation: CoSimulation) -> Structure:
    """Return the structure of a case: members, connections, stepping order."""
    return structure(
        cosimulation, component_names(case), [(connection.source, connection.target) for connection in case.connections]
    )


def measure_profile(
    case: Case, catalog: Catalog, backend: Backend, build: Path, progress: Progress = noop
) -> CostProfile:
    """Run a case with its events and measure the computing time of each member; recorded signals are discarded."""
    member_components = [members.component_of(spec) for spec in case.members.values()]
    members.prebuild(member_components, backend, build, progress)
    cosimulation = build_simulation(case, catalog, backend, build)
    duration = max(1, case.stop_ns - case.start_ns)
    variables = {name: member.variables for name, member in cosimulation.members.items()}
    try:
        cosimulation.initialize(case.start_ns, case.stop_ns)
        stopwatch = Stopwatch(cosimulation)
        for event in (*case.events, None):
            until = case.stop_ns if event is None else event.time_ns
            cosimulation.advance(until, lambda now: progress(case.name, float((now - case.start_ns) / duration)))
            if event is None or cosimulation.finished:
                break
            apply_event(event, case, cosimulation, variables)
        return profiled(stopwatch, cosimulation, component_names(case), clock.seconds(case.step_ns))
    finally:
        cosimulation.terminate()


REFINEMENTS = (16, 8, 4, 2)  # divisors of the step, tried in order until all members can make that step
MAX_HALVINGS = 6  # of the step in the search for a stable one
GROWTH_LIMIT = 1e-4  # logarithm of the growth over a cycle; below it is rounding, unless it adds up:
RUN_LIMIT = math.log(2.0)  # logarithm of the growth over a run
TIGHT_TOLERANCE, MAX_ITERATIONS = 1e-13, 200
ALTERNATIVES = {  # keys: text in a scenario
    "gauss_seidel": Algorithm("gauss_seidel"),
    "{name: iterative, order: 1}": Algorithm("iterative", order=1),
    "{name: iterative, order: 2}": Algorithm("iterative", order=2),
}


@dataclass(frozen=True)
class StabilityVerdict:
    """Stability of a case's algorithm and step. `at` [ns]: time of linearization.

    `stable_settings`: alternatives that are stable.
    """

    growth: Growth
    model: Growth  # extrapolated to infinitely short steps
    at: clock.Time
    duration: float  # of the run [s]
    stable_settings: tuple[str, ...] = ()

    @property
    def is_stable(self) -> bool:
        """Whether nothing grows that does not grow in the model itself."""
        return not is_growing(self.growth, self.model, self.duration)


def is_growing(coupled: Growth, model: Growth, duration: float) -> bool:
    """Whether the coupling makes a deviation grow in a run of this length [s] that does not grow in the model itself.

    Rounding adds up, too, but its rate is larger with shorter cycles, and with it that of the model.
    """
    excess = coupled.rate - 2 * max(model.rate, 0.0)
    adds_up = model.cycle < coupled.cycle and excess * duration > RUN_LIMIT
    return excess * coupled.cycle > GROWTH_LIMIT or adds_up


def model_growth(case: Case, catalog: Catalog, build: Path, at: clock.Time, coupled: Growth) -> Growth:
    """Extrapolate the growth to infinitely short steps: the contribution of the coupling is proportional to the step.

    If a member cannot make finer steps, the model itself is assumed not to grow.
    """
    for divisor in REFINEMENTS:
        step = clock.to_time(Fraction(case.step_ns) / divisor)
        with suppress(CouplingError, SimulationError):
            refined = linearize_case(replace(case, step_ns=step), catalog, build, at)
            rate = (
                refined.rate - (coupled.rate - refined.rate) / (divisor - 1)
                if coupled.factor < np.inf
                else refined.rate
            )
            return replace(refined, factor=float(np.exp(rate * refined.cycle)))
    return replace(coupled, factor=1.0)


def check_stability(case: Case, catalog: Catalog, build: Path, progress: Progress = noop) -> StabilityVerdict:
    """Check the stability of a case's coupling at its start and in the middle of its run; return the worse result.

    CouplingError if the state of a member is not accessible.
    """
    middle = case.start_ns + (case.stop_ns - case.start_ns) // case.step_ns // 2 * case.step_ns
    duration, verdicts = clock.seconds(case.stop_ns - case.start_ns), []
    for number, at in enumerate(dict.fromkeys((case.start_ns, middle))):
        progress(f"{case.variant}: linearized at {clock.text(at)}", number / 2)
        with suppress(SimulationError):
            coupled = linearize_case(case, catalog, build, at)
            verdicts.append(StabilityVerdict(coupled, model_growth(case, catalog, build, at, coupled), at, duration))
    worst = max(verdicts, key=lambda verdict: verdict.growth.rate)
    if worst.is_stable:
        return worst
    return replace(worst, stable_settings=tuple(stable_settings(case, catalog, build, worst)))


def linearize_case(case: Case, catalog: Catalog, build: Path, at: clock.Time) -> Growth:
    """Return the fastest growth of a deviation at a time of a case.

    Iterations converge to the last digit: a deviation is smaller than the usual tolerance.
    """
    if case.algorithm.iterations:
        converged = replace(case.algorithm, agreement=TIGHT_TOLERANCE, iterations=MAX_ITERATIONS)  # type: ignore[call-arg]
        case = replace(case, algorithm=converged)
    cosimulation = build_simulation(case, catalog, Backend.compiled, build)
    try:
        cosimulation.initialize(case.start_ns, case.stop_ns)
        if at > case.start_ns:
            cosimulation.advance(at)
        return growth(cosimulation)
    finally:
        cosimulation.terminate()


def stable_settings(case: Case, catalog: Catalog, build: Path, unstable: StabilityVerdict) -> Iterator[str]:
    """Find steps and algorithms with which nothing grows."""

    def is_stable(other: Case) -> bool:
        try:
            return not is_growing(linearize_case(other, catalog, build, unstable.at), unstable.model, unstable.duration)
        except (CouplingError, SimulationError):  # a step that a member cannot make
            return False

    for power in range(1, MAX_HALVINGS + 1):
        step = clock.to_time(Fraction(case.step_ns) / 2**power)
        if is_stable(replace(case, step_ns=step)):
            yield f"step: {clock.text(step)}"
            break
    for name, algorithm in ALTERNATIVES.items():
        if algorithm != case.algorithm and is_stable(replace(case, algorithm=algorithm)):
            yield f"algorithm: {name}"
