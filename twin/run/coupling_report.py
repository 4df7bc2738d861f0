"""What a case couples, what its members cost, whether it is stable: `twin graph`, `twin profile`, `twin check --stability`."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from twin import clock
from twin.coupling import Algorithm, Growth, Stopwatch, growth
from twin.errors import CouplingError, SimulationError
from twin.run.cases import Progress, happen, silent, simulation
from twin.scenario import Form, members
from twin.structure import Profile, Structure, profiled, structure

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from twin.coupling import Catalog, CoSimulation
    from twin.scenario import Case


def components(case: Case) -> dict[str, str]:
    """What members are made of, without folders of files: `rig.yaml#rig@fast`."""
    found = {}
    for name, spec in case.members.items():
        path, mark, part = spec.component.partition("#")
        found[name] = f"{path.rpartition('/')[2]}{mark}{part}"
    return found


def structure_of(case: Case, simulated: CoSimulation) -> Structure:
    """How the members of a case hang together."""
    return structure(simulated, components(case), [(one.source, one.target) for one in case.connections])


def profile(case: Case, catalog: Catalog, form: Form, build: Path, progress: Progress = silent) -> Profile:
    """Run a case, its events too, and measure what each member costs; nothing is kept of what it records."""
    used = [members.component_of(spec) for spec in case.members.values()]
    members.prebuild(used, form, build, progress)
    simulated = simulation(case, catalog, form, build)
    whole = max(1, case.stop_ns - case.start_ns)
    found = {name: member.variables for name, member in simulated.members.items()}
    try:
        simulated.initialize(case.start_ns, case.stop_ns)
        watch = Stopwatch(simulated)
        for event in (*case.events, None):
            until = case.stop_ns if event is None else event.time_ns
            simulated.advance(until, lambda now: progress(case.name, float((now - case.start_ns) / whole)))
            if event is None or simulated.finished:
                break
            happen(event, case, simulated, found)
        return profiled(watch, simulated, components(case), clock.seconds(case.step_ns))
    finally:
        simulated.terminate()


FINER = (16, 8, 4, 2)  # how much finer the steps of the comparison are: the first that all members can make
HALVINGS = 6  # steps that are proposed
GROWS = 1e-4  # growth over a cycle above which it is not rounding
AGREEMENT, ITERATIONS = 1e-13, 200
OTHERS = {  # as a scenario names them
    "gauss_seidel": Algorithm("gauss_seidel"),
    "{name: iterative, order: 1}": Algorithm("iterative", order=1),
    "{name: iterative, order: 2}": Algorithm("iterative", order=2),
}


@dataclass(frozen=True)
class Verdict:
    """Whether a case's algorithm and step are stable. `at` [ns]: the time of linearization; `cures`: what would be."""

    growth: Growth
    model: Growth  # in steps that are infinitely short
    at: clock.Time
    cures: tuple[str, ...] = ()

    @property
    def is_stable(self) -> bool:
        """Whether nothing grows that does not grow in the model itself."""
        return not grows(self.growth, self.model)


def grows(found: Growth, model: Growth) -> bool:
    """Whether the coupling makes something grow that does not grow in the model itself."""
    return found.rate * found.cycle > 2 * max(model.rate, 0.0) * found.cycle + GROWS


def limit(case: Case, catalog: Catalog, build: Path, at: clock.Time, own: Growth) -> Growth:
    """Growth in steps that are infinitely short: what the coupling adds is taken to be proportional to the step.

    Where no member can make finer steps, nothing is thought to grow in the model itself.
    """
    for finer in FINER:
        step = clock.whole(Fraction(case.step_ns) / finer)
        with suppress(CouplingError, SimulationError):
            fine = linearized(replace(case, step_ns=step), catalog, build, at)
            rate = fine.rate - (own.rate - fine.rate) / (finer - 1) if own.factor < np.inf else fine.rate
            return replace(fine, factor=float(np.exp(rate * fine.cycle)))
    return replace(own, factor=1.0)


def stability(case: Case, catalog: Catalog, build: Path, progress: Progress = silent) -> Verdict:
    """Whether the coupling of a case is stable at its start and in the middle of its run; the worse of both.

    CouplingError where a member keeps its state to itself.
    """
    middle = case.start_ns + (case.stop_ns - case.start_ns) // case.step_ns // 2 * case.step_ns
    found = []
    for number, at in enumerate(dict.fromkeys((case.start_ns, middle))):
        progress(f"{case.variant}: linearized at {clock.text(at)}", number / 2)
        with suppress(SimulationError):
            own = linearized(case, catalog, build, at)
            found.append(Verdict(own, limit(case, catalog, build, at, own), at))
    worst = max(found, key=lambda one: one.growth.rate)
    if worst.is_stable:
        return worst
    return replace(worst, cures=tuple(cures(case, catalog, build, worst)))


def linearized(case: Case, catalog: Catalog, build: Path, at: clock.Time) -> Growth:
    """The fastest growth of a deviation at a time of a case.

    What iterates does so to the last digit: a deviation is smaller than what is otherwise good enough.
    """
    if case.algorithm.iterations:
        exact = replace(case.algorithm, agreement=AGREEMENT, iterations=ITERATIONS)  # type: ignore[call-arg]
        case = replace(case, algorithm=exact)
    simulated = simulation(case, catalog, Form.compiled, build)
    try:
        simulated.initialize(case.start_ns, case.stop_ns)
        if at > case.start_ns:
            simulated.advance(at)
        return growth(simulated)
    finally:
        simulated.terminate()


def cures(case: Case, catalog: Catalog, build: Path, bad: Verdict) -> Iterator[str]:
    """Steps and algorithms with which nothing grows."""

    def is_cure(other: Case) -> bool:
        try:
            return not grows(linearized(other, catalog, build, bad.at), bad.model)
        except (CouplingError, SimulationError):  # a step that a member cannot make
            return False

    for power in range(1, HALVINGS + 1):
        step = clock.whole(Fraction(case.step_ns) / 2**power)
        if is_cure(replace(case, step_ns=step)):
            yield f"step: {clock.text(step)}"
            break
    for name, algorithm in OTHERS.items():
        if algorithm != case.algorithm and is_cure(replace(case, algorithm=algorithm)):
            yield f"algorithm: {name}"
