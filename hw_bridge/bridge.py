"""The bridge: drives on a bus instead of members of a scenario, in simulated time or on the wall clock.

`Hardware.apply` puts a Python-side component with the same variables in the place of
each member that the file names. All of them share one `Session` per case, which runs when the last of them is stepped.
"""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hw_bridge import outputs, plausible, targets
from hw_bridge.cia402 import Mode
from hw_bridge.events import planned
from hw_bridge.hardware import overloaded
from hw_bridge.keys import ContactKeys
from hw_bridge.profiles import profile
from hw_bridge.session import Session, beginning
from twin.component import Component, Float64, PythonComponent, Role, catalog
from twin.component import input as input_variable
from twin.coupling import nearest
from twin.errors import CouplingError, ScenarioError
from twin.results import Ending
from twin.scenario import ConnectionSpec, MemberSpec, read

if TYPE_CHECKING:
    from hw_bridge.keys import FaultKeys, HardwareKeys
    from twin.scenario import Case, Scenario

KEPT = (Role.input, Role.output, Role.parameter)
NEEDED = ("target_velocity", "position_actual_value")
CONTACT = "contact_force"
MEASURED = "measured_force"
PLACES = {"position", "position_actual_value", "angle"}
START = dict.fromkeys(("velocity", "velocity_actual_value", "angular_velocity", "current", "force", "torque"), 0.0)


class DriveAxis(PythonComponent):
    """A drive on a bus with the variables of the member that it stands for; what it cannot tell is NaN."""

    hardware: Hardware
    member: str
    variant: str
    forced = False  # whether it is told a force

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self._session = self.hardware.join(self)

    def initialize(self) -> None:
        """At rest where it begins: the drives are brought up in the first step."""
        for variable in type(self).variables:
            if variable.role is Role.output:
                self.views[variable.name][...] = START.get(variable.name, nan) if variable.type is Float64 else 0
        for name in PLACES & set(self.views):
            self.views[name][...] = beginning(self)

    def step(self, t: float, h: float) -> None:
        """Hand the targets over; the last member of a session lets the bus go on."""
        self._session.step(self.member, t, h)

    def close(self) -> None:
        """Stop all drives."""
        self._session.close()


class OutputModule(PythonComponent):
    """An I/O module on a bus: its inputs are the signals that its outputs follow."""

    hardware: Hardware
    member: str
    variant: str

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self._session = self.hardware.join(self)

    def step(self, t: float, h: float) -> None:
        """Hand the levels over; the last member of a session lets the bus go on."""
        self._session.step(self.member, t, h)

    def close(self) -> None:
        """Stop everything."""
        self._session.close()


class Hardware:
    """A checked hardware file, and what its drives did in the cases of a run."""

    def __init__(
        self, path: Path, keys: HardwareKeys, arm: bool = False, build: Path = Path("build"), trace: Path | None = None
    ) -> None:
        self.path, self.keys, self.arm, self.build, self.trace = path, keys, arm, build, trace
        self.contacts = {name: node.contact for name, node in keys.nodes.items() if node.contact is not None}
        self.root = read(path, str(path)) if path.is_file() else None  # for the places of mistakes
        self.faults: dict[str, list[FaultKeys]] = {}  # of a scenario's variants
        self.sessions: list[Session] = []
        self.present: Session | None = None

    @property
    def takes_faults(self) -> bool:
        """Real drives have their own."""
        return self.keys.simulated

    def apply(self, scenario: Scenario) -> Scenario:
        """The scenario with drives instead of the members that the file names; ScenarioError lists what does not fit."""
        if not self.keys.is_software() and not self.arm:
            raise ScenarioError(
                f"{self.path}: {self.keys.interface} {self.keys.channel} may move real drives. "
                f"Add --arm if nobody is in their way, or `simulated: true`."
            )
        problems = [problem for case in scenario.variants for problem in self._problems(case)]
        for case in scenario.variants:
            self.faults[case.variant], found = planned(case.faults, self.keys)
            problems += found
        if problems:
            raise ScenarioError(list(dict.fromkeys(problems)))
        return replace(scenario, variants=tuple(self._applied(case) for case in scenario.variants))

    def _problems(self, case: Case) -> list[str]:
        found = []
        for name, node in self.keys.nodes.items():
            if name not in case.members:
                found.append(f"{self.path}: nodes.{name}: no such member. {nearest(name, list(case.members))}")
                continue
            cls = self._replaced(case.members[name])
            known = {v.name for v in cls.variables}
            if missing := [one for one in NEEDED if one not in known]:
                found.append(
                    f"{self.path}: nodes.{name}: {cls.__name__} has no {', '.join(missing)}. A drive needs them."
                )
            if problem := plausible.gearing(node, "angle" in known):
                found.append(f"{self.path}: nodes.{name}: {problem}")
            if self.root is not None:
                found += plausible.units(self.root, name, "angle" in known)
            if node.contact is not None and node.contact.signal.partition(".")[0] not in case.members:
                found.append(f"{self.path}: nodes.{name}.contact: no member for {node.contact.signal}. Correct it.")
            elif node.contact is None and node.watch_contact:
                found += self._find_contact(name, case)
            told = case.members[name].parameters.get("mode_of_operation")
            if isinstance(told, int) and (problem := targets.unknown_mode(told, profile(node.profile), known)):
                where = case.members[name].places.get("mode_of_operation", case.members[name].where)
                found.append(f"{where}: {name} is a drive: {problem}")
            if node.outputs:
                found += outputs.problems(f"{self.path}: nodes.{name}.outputs", node.outputs, case.members)
        for name, module in self.keys.modules.items():
            where = f"{self.path}: modules.{name}"
            if name in case.members:
                found.append(f"{where}: the scenario has a member of this name. Use another one.")
            found += outputs.problems(f"{where}.outputs", module.outputs, case.members)
        if self.keys.cycle % case.step_ns:
            found.append(
                f"{self.path}: cycle: {self.keys.cycle / 1e6:g} ms is not a multiple of the scenario's step, "
                f"{case.step_ns / 1e6:g} ms. Change one of them."
            )
        if (forces := len(self._forced(case))) and (problem := overloaded(self.keys, forces)):
            found.append(f"{self.path}: {problem}")
        return found

    def _forced(self, case: Case) -> set[str]:
        """Members that are told a force, on drives that follow one."""
        return {
            name
            for name, node in self.keys.nodes.items()
            if Mode.CST in profile(node.profile).modes and name in case.members and targets.told_force(name, case)
        }

    def _find_contact(self, name: str, case: Case) -> list[str]:
        """Watch the contact force that the scenario measures, if it measures one."""
        found = [
            f"{member}.{MEASURED}"
            for member, spec in case.members.items()
            if member not in self.keys.nodes and not spec.component.endswith(".fmu")
            and any(v.name == MEASURED and v.role is Role.output for v in self._replaced(spec).variables)
        ]  # fmt: skip
        if len(found) == 1:
            self.contacts[name] = ContactKeys(signal=found[0])
        if len(found) < 2:
            return []
        return [
            (
                f"{self.path}: nodes.{name}: which contact force is to be watched, {' or '.join(found)}? "
                f"Add `contact: {{signal: {found[0]}}}`, or `watch_contact: false`."
            )
        ]

    @staticmethod
    def _replaced(spec: MemberSpec) -> type[Component]:
        if spec.component.endswith(".fmu"):
            raise CouplingError(f"{spec.where}: an FMU cannot be replaced by a drive. Name the component.")
        return spec.made or catalog.component(spec.component)

    def _applied(self, case: Case) -> Case:
        members, connections, forced = dict(case.members), list(case.connections), self._forced(case)
        for name, node in self.keys.nodes.items():
            spec = members[name]
            made = self._component(name, self._replaced(spec), case.variant)
            made.forced = name in forced
            members[name] = replace(spec, component=f"hw_bridge.bridge:{name}", made=made, period_ns=None)
            if name in self.contacts:
                source = self.contacts[name].signal
                connections.append(ConnectionSpec(source, f"{name}.{CONTACT}", f"{self.path}: nodes.{name}"))
            for bit, signal in node.outputs.items():
                where = f"{self.path}: nodes.{name}.outputs.{bit}"
                connections.append(ConnectionSpec(signal, f"{name}.{outputs.connector(bit)}", where))
        for name, module in self.keys.modules.items():
            where = f"{self.path}: modules.{name}"
            members[name] = MemberSpec(f"hw_bridge.bridge:{name}", where=where, made=self._module(name, case.variant))
            connections += [
                ConnectionSpec(signal, f"{name}.{outputs.connector(bit)}", f"{where}.outputs.{bit}")
                for bit, signal in module.outputs.items()
            ]
        return replace(case, members=members, connections=tuple(connections))

    def _module(self, name: str, variant: str) -> type[Component]:
        """A component class with an input for each output that follows a signal."""
        fields: dict[str, Any] = {**outputs.inputs(self.keys.modules[name].outputs)}
        fields |= {"hardware": self, "member": name, "variant": variant, "__module__": __name__}
        fields["__doc__"] = "An I/O module of CiA 401."
        return type(f"Module_{name}", (OutputModule,), fields)

    def _component(self, name: str, replaced: type[Component], variant: str = "") -> type[DriveAxis]:
        """A component class with the connectors of the one that it replaces."""
        fields: dict[str, Any] = {v.name: v for v in replaced.variables if v.role in KEPT}
        if name in self.contacts:
            fields[CONTACT] = input_variable("N", "force that is watched")
        fields |= outputs.inputs(self.keys.nodes[name].outputs)
        fields |= {"hardware": self, "member": name, "replaced": replaced, "variant": variant, "__module__": __name__}
        fields["__doc__"] = f"A drive instead of {replaced.__name__}."
        return type(f"Drive_{name}", (DriveAxis,), fields)

    def join(self, part: DriveAxis | OutputModule) -> Session:
        """The session that a drive or module belongs to: a new one where a case begins."""
        now = self.present
        if now is None or now.begun or now.closed or part.member in (*now.axes, *now.switches):
            faults = [*self.keys.faults, *self.faults.get(part.variant, [])]
            now = self.present = Session(self.keys, self.contacts, self.build, self._trace(), faults, part.variant)
            self.sessions.append(now)
        (now.axes if isinstance(part, DriveAxis) else now.switches)[part.member] = part
        now.forced |= {part.member} if isinstance(part, DriveAxis) and part.forced else set()
        return now

    def _trace(self) -> Path | None:
        """The trace of the next case: x.blf, then x-2.blf, x-3.blf, ..."""
        number = len(self.sessions) + 1
        if self.trace is None or number == 1:
            return self.trace
        return self.trace.with_stem(f"{self.trace.stem}-{number}")

    def report(self) -> dict[str, Any]:
        """What is worth keeping of a run, for its summary; `shown` is what the terminal tells."""
        reports = [session.report() for session in self.sessions if session.begun]
        lost = sum(node["lost_pdos"] for one in reports for node in one["nodes"].values())
        late = sum(node["late_pdos"] for one in reports for node in one["nodes"].values())
        overruns = sum(one["overruns"] for one in reports)
        keys = self.keys
        bus = "simulated bus" if keys.simulated else f"{keys.interface} {keys.channel}"
        shown = f"{bus}, cycle {keys.cycle / 1e6:g} ms: {lost} PDOs lost, {late} late, {overruns} overruns"
        if len(jitter := np.abs(self.jitter())):
            shown += (
                f", jitter 99 % below {1e3 * np.quantile(jitter, 0.99):.3f} ms, at most {1e3 * jitter.max():.3f} ms"
            )
        told = [shown]
        for session, one in zip([one for one in self.sessions if one.begun], reports, strict=True):
            if session.trace is not None:
                told.append(f"{session.trace}: {one['frames']} frames")
        return {
            "file": str(self.path), "simulated": keys.simulated, "interface": keys.interface,
            "cycle": keys.cycle / 1e9, "shown": told, "cases": reports,
            "nodes": keys.model_dump()["nodes"], "modules": keys.model_dump()["modules"],
        }  # fmt: skip

    def ending(self) -> Ending:
        """How the last case ended."""
        return self.sessions[-1].ending() if self.sessions and self.sessions[-1].begun else Ending()

    def pictures(self) -> list[dict[str, str]]:
        """The histogram of the jitter, where time was the wall clock's."""
        jitter = self.jitter()
        if not len(jitter):
            return []
        from twin.results import histogram

        note = f"periods between SYNCs minus {self.keys.cycle / 1e6:g} ms, {len(jitter)} of them"
        return [{"title": "Jitter of the cycle", "svg": histogram(1e3 * jitter, "period - cycle [ms]"), "note": note}]

    def notes(self) -> list[str]:
        """What the person who runs this has to know."""
        several = len(self.sessions) > 1
        return [f"{s.variant}: {note}" if several and s.variant else note for s in self.sessions for note in s.notes]

    def jitter(self) -> np.ndarray[Any, Any]:
        """Periods between SYNCs minus the cycle, of all cases on the wall clock [s]."""
        found = [session.master.timing.jitter for session in self.sessions if session.master and session.wall_clock]
        return np.concatenate(found) if found else np.zeros(0)
