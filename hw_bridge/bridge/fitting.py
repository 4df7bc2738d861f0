"""Check a hardware file against the cases of a scenario."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from hw_bridge.device import uneven
from hw_bridge.dictionary import Mode
from hw_bridge.hardware import ContactKeys, overloaded, plausible
from hw_bridge.session import targets
from twin.component import Boolean, Role, catalog
from twin.coupling import READABLE, find
from twin.errors import CouplingError, TwinError, nearest
from twin.scenario import members as forms
from twin.scenario import number, read

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys
    from twin.component import Component
    from twin.coupling import MemberVariable
    from twin.scenario import Case, MemberSpec

NEEDED = ("target_velocity", "position_actual_value")
ADOPTED = {
    "position",
    "load_force",
    "position_gain",
    "current_maximum",
}  # parameters of a motor that a drive can take over
MEASURED = "measured_force"
SAMPLING = "drive_period"


class Fitting:
    """Mismatches of a hardware file and a scenario, and monitored contact forces. `retracts`: whether drives can retract."""

    def __init__(self, path: Path, keys: HardwareKeys, retracts: bool = True) -> None:
        self.path, self.keys, self.retracts = path, keys, retracts
        self.root = read(path, str(path)) if path.is_file() else None  # for locations of errors
        own = {name: node.contact for name, node in keys.nodes.items() if node.contact is not None}
        self.contacts: dict[str, ContactKeys] = own if retracts else {}

    def problems(self, case: Case) -> list[str]:
        """Return the mismatches of a case; finds the contact forces that it measures."""
        problems = []
        for name, node in self.keys.nodes.items():
            if name not in case.members:
                problems.append(f"{self.path}: nodes.{name}: no such member. {nearest(name, list(case.members))}")
                continue
            cls = replaced(case.members[name])
            names = {v.name for v in cls.variables}
            if missing := [name for name in NEEDED if name not in names]:
                problems.append(
                    f"{self.path}: nodes.{name}: {cls.__name__} has no {', '.join(missing)}. A drive needs them."
                )
            if problem := plausible.gearing(node, "angle" in names):
                problems.append(f"{self.path}: nodes.{name}: {problem}")
            if self.root is not None:
                problems += plausible.units(self.root, name, "angle" in names)
            if node.contact is not None and node.contact.signal.partition(".")[0] not in case.members:
                problems.append(f"{self.path}: nodes.{name}.contact: no member for {node.contact.signal}. Correct it.")
            elif node.contact is None and node.watch_contact and self.retracts:
                problems += self._find_contact(name, case)
            initial_mode = case.members[name].parameters.get("mode_of_operation")
            if isinstance(initial_mode, int) and (problem := targets.unknown_mode(initial_mode, node.drive, names)):
                where = case.members[name].locations.get("mode_of_operation", case.members[name].where)
                problems.append(f"{where}: {name} is a drive: {problem}")
            problems += self._sampling(name, case.members[name])
            if node.motor == "member" and not names >= ADOPTED:
                problems.append(
                    f"{self.path}: nodes.{name}.motor: {cls.__name__} is no linear motor that a drive could take over. "
                    f"Leave it out."
                )
            if problem := targets.tracking_problem(node, cls, initial_mode, self.keys.cycle):
                problems.append(f"{self.path}: nodes.{name}.follow: {problem}")
            if node.outputs:
                problems += unswitchable(f"{self.path}: nodes.{name}.outputs", node.outputs, case.members)
        for name, module in self.keys.modules.items():
            where = f"{self.path}: modules.{name}"
            if name in case.members:
                problems.append(f"{where}: the scenario has a member of this name. Use another one.")
            problems += unswitchable(f"{where}.outputs", module.outputs, case.members)
        if self.keys.cycle % case.step_ns:
            problems.append(
                f"{self.path}: cycle: {self.keys.cycle / 1e6:g} ms is not a multiple of the scenario's step, "
                f"{case.step_ns / 1e6:g} ms. Change one of them."
            )
        if (forces := len(self.forced(case))) and (problem := overloaded(self.keys, forces)):
            problems.append(f"{self.path}: {problem}")
        return problems

    def _sampling(self, name: str, member: MemberSpec) -> list[str]:
        """Problem of the member's loop sampling in a simulated drive, whose motor has its parameters."""
        given = member.parameters.get(SAMPLING)
        if given is None or not self.keys.simulated:
            return []
        where = f"{member.locations.get(SAMPLING, member.where)}: {name}"
        try:
            problem = uneven(number(given, "s", f"{where}.{SAMPLING}"))
        except CouplingError:  # a wrong value is reported with the others
            return []
        return [f"{where} is a drive: {problem}"] if problem else []

    def forced(self, case: Case) -> set[str]:
        """Members with target forces, on drives with cst."""
        follow = [
            name for name, node in self.keys.nodes.items() if Mode.CST in node.drive.modes and name in case.members
        ]
        connected = connected_inputs(case) if follow else set()
        return {name for name in follow if targets.receives_target_force(name, case, connected)}

    def _find_contact(self, name: str, case: Case) -> list[str]:
        """Monitor the contact force that the scenario measures, if there is one."""
        signals = [
            f"{member}.{MEASURED}"
            for member, spec in case.members.items()
            if member not in self.keys.nodes
            and not spec.component.endswith(".fmu")
            and any(v.name == MEASURED and v.role is Role.output for v in replaced(spec).variables)
        ]
        if len(signals) == 1:
            self.contacts[name] = ContactKeys(signal=signals[0])
        if len(signals) < 2:
            return []
        return [
            (
                f"{self.path}: nodes.{name}: which contact force is to be watched, {' or '.join(signals)}? "
                f"Add `contact: {{signal: {signals[0]}}}`, or `watch_contact: false`."
            )
        ]


def connected_inputs(case: Case) -> set[str]:
    """`member.variable` of all inputs that are connected, also by their terminals."""
    variables: dict[str, Mapping[str, MemberVariable]] = {}
    for name, spec in case.members.items():
        with suppress(TwinError):  # a wrong member is reported with the others
            variables[name] = forms.variables(spec.made or spec.component)
    return {connection.target for connection in case.system(variables).single()[0]}


def replaced(spec: MemberSpec) -> type[Component]:
    """The component of a member that a drive replaces."""
    if spec.component.endswith(".fmu"):
        raise CouplingError(f"{spec.where}: an FMU cannot be replaced by a drive. Name the component.")
    return spec.made or catalog.component(spec.component)


def unswitchable(where: str, bits: Mapping[int, str], members: Mapping[str, MemberSpec]) -> list[str]:
    """Signals that cannot switch an output. An FMU's are checked with the other connections."""
    variables = {
        name: forms.variables(spec.made or spec.component)
        for name, spec in members.items()
        if not spec.component.endswith(".fmu")
    }
    problems = []
    for bit, signal in bits.items():
        member = signal.partition(".")[0]
        if member in members and member not in variables:
            continue
        try:
            source = find(signal, variables)
        except CouplingError as error:
            problems.append(f"{where}.{bit}: {error}")
            continue
        kind, name = source.variable.type, source.variable.causality
        if name not in READABLE:
            problems.append(f"{where}.{bit}: {signal} is an {name}. Name an output.")
        elif kind != Boolean or source.size != 1:
            what = kind if source.size == 1 else f"{source.size} values"
            problems.append(
                f"{where}.{bit}: {signal} is {what}, an output needs one Boolean. Name another or an element."
            )
    return problems
