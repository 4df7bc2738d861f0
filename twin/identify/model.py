"""The model at other values of the unknowns, again and again: built once, and in this process.

Members whose memory lies here go back to how they were made, and take the next values; nothing is compiled, loaded or read
again. Somebody else's FMU has to be instantiated anew, from the archive that stays unpacked.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from twin.coupling import CoSimulation, MemoryRecorder, RecordMember, find
from twin.errors import SimulationError
from twin.fmi import watched
from twin.run import build_simulation, noop, run_case
from twin.scenario import Backend, members

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from twin.arrays import Array
    from twin.identify.problem import Output, Problem, RecordedExperiment, Unknown

BUFFER_BYTES = 1 << 20  # for rows: many short simulations
CACHE_SIZE = 24  # simulations: delays and offsets need none of their own


class Model:
    """Computes what the outputs would have measured. Use it with `with`: at its end all members are freed."""

    def __init__(self, problem: Problem, build: Path) -> None:
        self.problem = problem
        self.refused = ""  # why directional derivatives are not used, where members have them
        self.compared = self.used = False  # directional derivatives, with differences and at all
        self._recorded: list[Simulated] = []
        try:
            for recording in problem.recordings:
                self._recorded.append(Simulated(recording, problem.of(recording), build))
        except BaseException:
            self.close()
            raise

    @property
    def count(self) -> int:
        """Simulations so far."""
        return sum(simulated.count for simulated in self._recorded)

    @property
    def derivatives(self) -> str:
        """What the Jacobian of a search is made of, in words."""
        if self.used and not self.refused:
            return "directional derivatives"
        return f"differences, since {self.refused}" if self.refused else "differences"

    def predicted(self, positions: Array) -> list[Array]:
        """Predict the measurements of each output; SimulationError if a simulation fails or is not finite."""
        values = self.problem.values(positions)
        outputs = []
        for simulated in self._recorded:
            time, signals = simulated.signals(values)
            outputs += [sampled(output, time, signals, values) for output in simulated.recording.outputs]
        if not all(np.isfinite(output).all() for output in outputs):
            raise SimulationError("what is compared is not finite")
        return outputs

    def slopes(self, positions: Array) -> dict[int, list[Array]] | None:
        """What each output would change with each parameter that is looked for, by its number; by directional derivatives.

        None where the members do not tell them along a simulation; `refused` says why, if they might have.
        """
        values = self.problem.values(positions)
        derivatives: dict[int, list[Array]] = {}
        for simulated in self._recorded:
            member_slopes = None if self.refused else simulated.slopes(values)
            self.refused = self.refused or simulated.refused
            if member_slopes is None:
                return None
            for number, unknown in enumerate(self.problem.unknowns):
                if unknown.member:
                    nothing = [np.zeros(len(output.time)) for output in simulated.recording.outputs]
                    derivatives.setdefault(number, []).extend(member_slopes.get(unknown.name, nothing))
        return derivatives

    def close(self) -> None:
        """Free all members."""
        for simulated in self._recorded:
            simulated.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Simulated:
    """Simulates one recording at given values of `unknowns`."""

    def __init__(self, recording: RecordedExperiment, unknowns: Sequence[Unknown], build: Path) -> None:
        self.recording, self._unknowns, self._build = recording, unknowns, build
        self.count = 0  # of simulations
        self.refused = ""  # why directional derivatives are of no use along a simulation
        self._cache: dict[tuple[float, ...], tuple[Array, dict[str, Array]]] = {}
        self._references = {
            unknown.name: (unknown.member, find(unknown.path, recording.catalog)) for unknown in unknowns
        }
        used = [members.component_of(member) for member in recording.case.members.values()]
        members.prebuild(used, Backend.compiled, build, noop)
        self._first = self._made()
        self._saved = self._snapshot()

    def _made(self, values: Mapping[str, float] | None = None) -> CoSimulation:
        """New members, with these values among those they begin with."""
        case = self.recording.case
        parts = dict(case.members)
        for unknown in self._unknowns:
            if values:
                own = {**parts[unknown.member].parameters, unknown.variable: values[unknown.name]}
                parts[unknown.member] = replace(parts[unknown.member], parameters=own)
        case = replace(case, members=parts, threads=1)  # simulations of renewed members share them and end none
        return build_simulation(
            case, self.recording.catalog, Backend.compiled, self._build, MemoryRecorder(BUFFER_BYTES)
        )

    def _snapshot(self) -> dict[str, Any]:
        """How the members were made; nothing if one of them cannot go back there."""
        own = self._first.members
        if (
            all(isinstance(member, RecordMember) and member.has_cheap_fmu_state for member in own.values())
            and not self.recording.case.actions
        ):
            return {name: member.save() for name, member in own.items()}
        return {}

    def _prepare(self, values: Mapping[str, float]) -> CoSimulation:
        """Return a co-simulation that is ready to initialize, with these values."""
        first = self._first
        if not self._saved:
            return self._made(values)
        for name, saved in self._saved.items():
            first.members[name].restore(saved)
        for name, (member, reference) in self._references.items():
            part, variable = first.members[member], reference.variable
            elements = np.array(part.get(variable.name))
            elements.reshape(-1)[reference.first : reference.first + reference.size] = values[name]
            part.set(variable.name, elements)
        return first.renewed(recorder=MemoryRecorder(BUFFER_BYTES), exempt=list(first.members))

    def signals(self, values: Mapping[str, float]) -> tuple[Array, dict[str, Array]]:
        """Times [s] and what the outputs' signals are; SimulationError if the simulation fails."""
        key = tuple(values[name] for name in self._references)
        result = self._cache.pop(key, None) or self._simulated(values)
        self._cache[key] = result  # the last one
        if len(self._cache) > CACHE_SIZE:
            del self._cache[next(iter(self._cache))]
        return result

    def slopes(self, values: Mapping[str, float]) -> dict[str, list[Array]] | None:
        """Derivatives of each output by each unknown's value, at the times of measurement; None if they cannot be had."""
        if self._saved:
            return None  # compiled members tell no derivatives, and are quick
        simulated = self._made(values)
        try:
            elements = [(name, member, reference) for name, (member, reference) in self._references.items()]
            parameters = [
                (m, reference.variable.name, reference.first + i)
                for _, m, reference in elements
                for i in range(reference.size)
            ]
            sources = [find(output.signal, self.recording.catalog) for output in self.recording.outputs]
            outputs = [
                (output.signal.partition(".")[0], source.variable.name, source.first + output.element)
                for output, source in zip(self.recording.outputs, sources, strict=True)
            ]
            recorder = watched(simulated.members, simulated.links, parameters, outputs)
            if recorder is None or self.recording.case.actions:
                return None
            self.count += 1
            run_case(self.recording.case, simulated, noop)
            self.refused = simulated.failure or recorder.failure
        finally:
            simulated.terminate()
        if self.refused:
            return None
        slopes, derivatives_by_name, column = np.array(recorder.slopes), {}, 0
        for name, _, reference in elements:
            of_all = slopes[:, :, column : column + reference.size].sum(2)
            derivatives_by_name[name] = [
                moved(o, recorder.times, of_all[:, i], values) for i, o in enumerate(self.recording.outputs)
            ]
            column += reference.size
        return derivatives_by_name

    def _simulated(self, values: Mapping[str, float]) -> tuple[Array, dict[str, Array]]:
        self.count += 1
        simulated = self._prepare(values)
        try:
            run_case(self.recording.case, simulated, noop)
            if simulated.finished:
                raise SimulationError(simulated.failure)
            recording = simulated.recording()
        finally:
            if not self._saved:
                simulated.terminate()
        return recording.time, recording.signals

    def close(self) -> None:
        """Free all members."""
        self._first.terminate()


def sampled(output: Output, time: Array, signals: Mapping[str, Array], values: Mapping[str, float]) -> Array:
    """A signal at the times at which it was measured, on straight lines between communication points."""
    name = output.signal if output.signal in signals else output.signal.rpartition("[")[0]
    signal = signals[name].reshape(len(time), -1)[:, output.element]
    offset = values[output.offset] if isinstance(output.offset, str) else output.offset
    return moved(output, time, signal, values) + offset


def moved(output: Output, time: Array | Sequence[float], signal: Array, values: Mapping[str, float]) -> Array:
    """Values over time at the times of an output's measurements, less its delay."""
    delay = values[output.delay] if isinstance(output.delay, str) else output.delay
    interpolated: Array = np.interp(output.time - delay, time, signal)
    return interpolated
