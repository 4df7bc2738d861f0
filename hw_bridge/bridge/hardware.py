"""The bridge: drives on a bus instead of members of a scenario, in simulated time or on the wall clock.

`Hardware.apply` replaces each member that the file names by a Python-side component with the same variables.
All of them share one `Session` per case, which advances when the last of them is stepped.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hw_bridge.bridge import status, summary
from hw_bridge.bridge.announcement import announce
from hw_bridge.bridge.axis import COPIED_ROLES, DriveAxis, OutputModule, SessionMember
from hw_bridge.bridge.fitting import Fitting, replaced
from hw_bridge.hardware import planned, stall_bounds
from hw_bridge.session import AGE, Observers, Session, outputs
from hw_bridge.shadow import shadows
from hw_bridge.trace import BusListener, Watch
from twin.component import input as input_variable
from twin.component import output as output_variable
from twin.errors import ScenarioError
from twin.results import HardwareTermination
from twin.scenario import ConnectionSpec, MemberSpec

if TYPE_CHECKING:
    from hw_bridge.hardware import FaultKeys, HardwareKeys
    from twin.component import Component
    from twin.scenario import Case, FaultSpec, ScenarioSpec

CONTACT = "contact_force"
ROOM = "hw_bridge.bridge"  # module name of the components
OBSERVERS = Observers(Watch, shadows, announce)


class Hardware:
    """A checked hardware file, and the sessions of its drives in the cases of a run."""

    observer_factories = OBSERVERS  # bus listener and observers

    def __init__(
        self, path: Path, keys: HardwareKeys, arm: bool = False, build: Path = Path("build"), trace: Path | None = None
    ) -> None:
        self.path, self.keys, self.arm, self.build, self.trace = path, keys, arm, build, trace
        self.fitting = Fitting(path, keys)
        self.faults: dict[str, list[FaultKeys]] = {}  # of a scenario's variants
        self.rotary: dict[str, bool] = {}  # of the members that drives stand for
        self.sessions: list[Session] = []
        self.present: Session | None = None
        self.load: status.Load | None = None  # of the present bus, once its status is read

    @property
    def wall_clock(self) -> bool:
        """Whether the run is paced by the wall clock."""
        return not self.keys.simulated

    @property
    def cycle(self) -> int:
        """Period of the targets [ns]."""
        return self.keys.cycle

    @property
    def takes_faults(self) -> bool:
        """Whether faults can be injected: only into simulated drives."""
        return self.keys.simulated

    def apply(self, scenario: ScenarioSpec) -> ScenarioSpec:
        """Return the scenario with drives instead of the named members; ScenarioError lists the mismatches."""
        if not self.keys.is_software() and not self.arm:
            raise ScenarioError(
                f"{self.path}: {self.keys.interface} {self.keys.channel} may move real drives. "
                f"Add --arm if nobody is in their way, or `simulated: true`."
            )
        problems = [problem for case in scenario.variants for problem in self.fitting.problems(case)]
        for case in scenario.variants:
            self.faults[case.variant], fault_problems = planned(case.faults, self.keys)
            problems += fault_problems
        if problems:
            raise ScenarioError(list(dict.fromkeys(problems)))
        return replace(scenario, variants=tuple(self._applied(case) for case in scenario.variants))

    def _applied(self, case: Case) -> Case:
        members, connections, forced = dict(case.members), list(case.connections), self.fitting.forced(case)
        for name, node in self.keys.nodes.items():
            spec = members[name]
            cls = replaced(spec)
            self.rotary[name] = "angle" in {variable.name for variable in cls.variables}
            made = self._component(name, cls, case.variant)
            made.forced = name in forced
            own = f"{ROOM}:{name}"
            # finite: what a drive cannot tell is NaN
            members[name] = replace(
                spec, component=own, made=made, period_ns=None, communication_ns=None, finite=False, isolate=False
            )
            if name in self.fitting.contacts:
                source = self.fitting.contacts[name].signal
                connections.append(ConnectionSpec(source, f"{name}.{CONTACT}", f"{self.path}: nodes.{name}"))
            for bit, signal in node.outputs.items():
                where = f"{self.path}: nodes.{name}.outputs.{bit}"
                connections.append(ConnectionSpec(signal, f"{name}.{outputs.connector(bit)}", where))
        for name, module in self.keys.modules.items():
            where = f"{self.path}: modules.{name}"
            members[name] = MemberSpec(f"{ROOM}:{name}", where=where, made=self._module(name, case.variant))
            connections += [
                ConnectionSpec(signal, f"{name}.{outputs.connector(bit)}", f"{where}.outputs.{bit}")
                for bit, signal in module.outputs.items()
            ]
        # threads that start or wait in the middle of a cycle would delay its frames
        return replace(case, members=members, connections=tuple(connections), threads=1)

    def _module(self, name: str, variant: str) -> type[Component]:
        """Create a component class with an input for each output that follows a signal."""
        fields: dict[str, Any] = {**outputs.inputs(self.keys.modules[name].outputs)}
        fields |= {"hardware": self, "member": name, "variant": variant, "__module__": ROOM}
        fields["__doc__"] = "An I/O module of CiA 401."
        return type(f"Module_{name}", (OutputModule,), fields)

    def _component(self, name: str, replaced: type[Component], variant: str = "") -> type[DriveAxis]:
        """Create a component class with the connectors of the replaced one."""
        fields: dict[str, Any] = {
            **{v.name: v for v in replaced.variables if v.role in COPIED_ROLES},
            **replaced.terminals,
        }
        if name in self.fitting.contacts:
            fields[CONTACT] = input_variable("N", "force that is watched")
        fields |= outputs.inputs(self.keys.nodes[name].outputs)
        fields[AGE] = output_variable("s", "age of the actual values that the targets of this cycle follow from")
        fields |= {"hardware": self, "member": name, "replaced": replaced, "variant": variant, "__module__": ROOM}
        fields["__doc__"] = f"A drive instead of {replaced.__name__}."
        return type(f"Drive_{name}", (DriveAxis,), fields)

    def join(self, part: SessionMember) -> Session:
        """Return the session of a drive or module: a new one where a case begins."""
        now = self.present
        if now is None or now.is_started or now.closed or part.member in now.members:
            faults = [*self.keys.faults, *self.faults.get(part.variant, [])]
            now = self.present = Session(
                self.keys,
                self.fitting.contacts,
                self.build,
                self.observer_factories,
                self._trace(),
                faults,
                part.variant,
            )
            self.sessions.append(now)
        if isinstance(part, DriveAxis):
            now.join(part.member, part, part.forced)
        else:
            now.join_module(part.member, part)
        return now

    def listen(self) -> BusListener:
        """Open the bus to receive its process data; no frame is sent."""
        return BusListener(self.path, self.keys)

    def _trace(self) -> Path | None:
        """The trace of the next case: x.blf, then x-2.blf, x-3.blf, ..."""
        number = len(self.sessions) + 1
        if self.trace is None or number == 1:
            return self.trace
        return self.trace.with_stem(f"{self.trace.stem}-{number}")

    def report(self) -> dict[str, Any]:
        """Data of a run for its summary; `shown` is printed on the terminal."""
        return summary.report(self.path, self.keys, self.sessions, self.jitter())

    def termination(self) -> HardwareTermination:
        """Summarize how the last case ended."""
        return (
            self.sessions[-1].outcome.termination()
            if self.sessions and self.sessions[-1].is_started
            else HardwareTermination()
        )

    def pictures(self) -> list[dict[str, str]]:
        """Histogram of the jitter, for runs on the wall clock."""
        return summary.pictures(self.keys, self.jitter())

    def notes(self) -> list[str]:
        """Notes for the operator."""
        return summary.notes(self.sessions)

    def status(self) -> dict[str, Any]:
        """Live status of the drives for the operator, in SI."""
        master = self.present.master if self.present is not None else None
        if master is not None and (self.load is None or self.load.master is not master):
            self.load = status.Load(master)
        return status.status(self, self.load)

    def strike(self, fault: FaultSpec) -> None:
        """Inject a fault into simulated drives, at a future time of the scenario."""
        planned_faults, problems = planned([fault], self.keys)
        session = self.present
        if problems or session is None or session.bench is None or not session.running:
            raise ScenarioError(problems or [f"{fault.where}: the drives are not up yet. Let it go first."])
        session.faults = [*session.faults, *planned_faults]
        session.bench.plan(planned_faults, session.origin)

    def bounds(self) -> list[str]:
        """Bounds on the effect of a late cycle, once the members are known."""
        return stall_bounds.bounds(self.keys, self.rotary) if self.rotary else []

    def jitter(self) -> np.ndarray[Any, Any]:
        """Periods between SYNCs minus the cycle, of all cases on the wall clock [s]."""
        jitters = [session.master.timing.jitter for session in self.sessions if session.master and session.wall_clock]
        return np.concatenate(jitters) if jitters else np.zeros(0)
