"""Composition of coupled components into one: records nested in one record, connections compiled in.

A group is a sampled component whose period is the communication step of its members; they keep their own periods in it. Its
`step` is generated as Python source, one statement per connection, step and publication, in the order of the co-simulation
loop: the result equals the ungrouped system to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from twin.compiler import dependencies
from twin.component import (
    CONNECTABLE,
    Component,
    Int64,
    MemoryLayout,
    PythonComponent,
    Role,
    Terminal,
    Variable,
    define,
    inputs_of,
    layout,
    solver,
)
from twin.coupling.groups import group_equations
from twin.coupling.groups.group_writer import Copy, GroupMember, GroupWriter, Key, each
from twin.coupling.system import ResolvedConnection, by_source, followers_of
from twin.errors import CouplingError
from twin.graph import ordered_groups

SWEEPS = 100  # largest number of substitutions in an algebraic loop at initialization


class Group(Component):
    """Base class of the classes that `compose` creates."""

    parts: ClassVar[dict[str, GroupMember]] = {}
    flows: ClassVar[dict[str, frozenset[str]]] = {}
    reaches: ClassVar[dict[str, frozenset[str]]] = {}  # dependencies at one instant, for groups with equations
    starts: ClassVar[dict[str, Any]] = {}
    composition: ClassVar[tuple[Any, ...]] = ()  # arguments of `compose`
    text: ClassVar[str] = ""  # generated source
    fields: ClassVar[
        dict[str, str]
    ] = {}  # record fields of its own inputs, and of the published values of slow members

    def __init__(self, **values: Any) -> None:
        self.bind_record(np.zeros(1, self.layout.dtype))
        for name, value in values.items():
            self.views[name][...] = value

    def bind_record(self, record: np.ndarray[Any, Any]) -> None:
        """Bind the group to a record and write the start values; the record of a nested group lies in its parent's."""
        self.record = record
        raw = self.record.view(np.uint8)
        self.views = {}
        for variable in self.variables:
            at = self.layout.offset(variable.name)
            size = variable.size * variable.dtype.itemsize
            self.views[variable.name] = raw[at : at + size].view(variable.dtype).reshape(variable.shape)
        for name in self.layout.dtype.names or ():
            self.__dict__[name] = self.record[name][0] if name in self.parts else self.record[name][0, ...]
        for name, part in self.parts.items():
            self.__dict__[name] = nested(part.component, self.record[name])
            for field, value in part.component.start_values().items():
                self.__dict__[name].views[field][...] = value
        for name, value in self.start_values().items():
            self.views[name][...] = value

    @classmethod
    def start_values(cls) -> dict[str, Any]:
        """Return start values by `member.variable`."""
        return dict(cls.starts)


def nested(cls: type[Component], record: np.ndarray[Any, Any]) -> Component:
    """Create an instance of a component over memory in another record."""
    part = cls.__new__(cls)
    part.bind_record(record)
    return part


def initialization(writer: GroupWriter, border: list[Variable]) -> list[str]:
    """Generate `initialize(self, t)`: values propagate in the order of dependencies, as in `coupling.initialization`."""
    lines = ["def initialize(self, t):", "    self._count[0] = 0"]
    stale = dict.fromkeys(writer.parts, True)
    lines += [line for i, variable in enumerate(border) for line in take_border(writer, i, variable).lines]
    sources = by_source(writer.links)
    feedthrough = {name: dependencies(part.component) for name, part in writer.parts.items()}
    followers = followers_of(sources, lambda link, o: link.target.variable.name in feedthrough[o[0]].get(o[1], ()))
    for keys in ordered_groups(list(sources), followers):
        if len(keys) > 1 or keys[0] in followers[keys[0]]:
            lines += settle(writer, keys, sources)
            stale.update(dict.fromkeys((link.target.member for key in keys for link in sources[key]), True))
            continue
        (member, name), links = keys[0], sources[keys[0]]
        if stale[member]:
            lines.append(f"    initialize_{member}(self.{member}, t)")
            stale[member] = False
        writer.published(keys[0])
        lines += publish(writer, member, name)
        for link in links:
            lines += [line for copy in writer.copy(link) for line in copy.lines]
            stale[link.target.member] = True
    lines += [f"    initialize_{name}(self.{name}, t)" for name, is_stale in stale.items() if is_stale]
    lines += [line for member, name in list(writer.shadows) for line in publish(writer, member, name)]
    return [*lines, "    return 0", ""]


def settle(writer: GroupWriter, keys: list[Key], sources: dict[Key, list[ResolvedConnection]]) -> list[str]:
    """Generate statements that solve an algebraic loop by substitution; most apparent loops converge at once."""
    lines = [f"    for sweep in range({SWEEPS}):", "        moved = 0"]
    for member in dict.fromkeys(member for member, _ in keys):
        lines.append(f"        initialize_{member}(self.{member}, t)")
        for name in [name for owner, name in keys if owner == member]:
            writer.published((member, name))
            lines += [f"    {line}" for line in publish(writer, member, name)]
            for link in sources[member, name]:
                for copy in writer.copy(link):
                    body = (
                        f"new = {copy.value}",
                        f"if abs(new - {copy.target}) > 1e-12 * (abs(new) + abs({copy.target})):",
                        "    moved = 1",
                        f"{copy.target} = new",
                    )
                    lines += [f"    {line}" for line in copy.loops(*body)]
    return [
        *lines,
        "        if moved == 0:",
        "            break",
        "    if moved != 0:",
        f"        return {solver.ERROR}",
    ]


def take_border(writer: GroupWriter, number: int, variable: Variable) -> Copy:
    """Generate the copy of a group's own input to its member."""
    member, _, name = variable.name.partition(".")
    location, shape = writer.location((member, name)), variable.shape
    return Copy(
        each(location, shape), each(f"self._border{number}", shape) if shape else f"self._border{number}[0]", shape
    )


def publish(writer: GroupWriter, member: str, name: str) -> list[str]:
    """Generate the copy that publishes a slow member's variable; none if it steps at every communication point."""
    if writer.divider(member) == 1:
        return []
    shape, location = writer.variable((member, name)).shape, writer.location((member, name))
    return Copy(each(writer.published((member, name)), shape), each(location, shape), shape).lines


def stepping(writer: GroupWriter, border: list[Variable], stages: list[list[str]]) -> list[str]:
    """Generate `step(self, t, h)`: one communication step, stage by stage: take inputs, step, publish."""
    lines = ["def step(self, t, h):", "    tick = self._count[0]", "    status = 0"]
    by_member = {name: [v for v in border if v.name.split(".")[0] == name] for name in writer.parts}
    for stage in stages:
        for name in stage:
            copies = [take_border(writer, border.index(v), v) for v in by_member[name]]
            copies += [copy for link in writer.links if link.target.member == name for copy in writer.copy(link)]
            body = [line for copy in copies for line in copy.lines]
            lines += when(body, writer.divider(name), "tick")
        for name in stage:
            h = writer.parts[name].period / 1e9
            body = [f"    status = max(status, advance_{name}(self.{name}, t, {h!r}))"]
            lines += when(body, writer.divider(name), "tick")
        for name in stage:
            body = [line for m, n in list(writer.shadows) if m == name for line in publish(writer, m, n)]
            lines += when(body, writer.divider(name), "(tick + 1)")
    return [*lines, "    self._count[0] = tick + 1", "    return status", ""]


def when(body: list[str], divider: int, tick: str) -> list[str]:
    """Guard statements that are due only at every n-th communication point."""
    if divider == 1 or not body:
        return body
    return [f"    if {tick} % {divider} == 0:", *(f"    {line}" for line in body)]


def compose(
    name: str,
    parts: dict[str, GroupMember],
    links: list[ResolvedConnection],
    step: int,
    stages: list[list[str]],
    outputs: list[Key],
) -> type[Component]:
    """Compose members into one component class called `name`.

    `links`: inner connections; inputs without one become the group's inputs. `step` [ns]: communication step of the
    original system, the group's period. `outputs`: variables that become outputs, as (member, variable). CouplingError
    for Python-side members, or without outputs.
    """
    for member, part in parts.items():
        if issubclass(part.component, PythonComponent):
            raise CouplingError(f"{name}: member {member!r} is Python-side and cannot be compiled in. Leave it out.")
    if not outputs:
        raise CouplingError(f"{name}: nothing leaves the group. Add a member whose outputs others read.")
    writer = GroupWriter(parts, links, step)
    driven = {link.target.key for link in links}
    has_equations = group_equations.offered(parts, links, step)
    variables, border = exposed(parts, driven, outputs, has_equations)
    for member, part in parts.items():
        for variable in part.component.variables:
            if variable.role is Role.output:  # unread outputs too, which would show the end of a step at its beginning
                writer.published((member, variable.name))
    source = initialization(writer, border) + stepping(writer, border, stages)
    if has_equations:
        inputs = [(variable, take_border(writer, i, variable)) for i, variable in enumerate(border)]
        source += group_equations.source(writer, inputs)
    struct_layout = group_layout(writer, variables, border)
    text = "\n".join(source)
    code: dict[str, Any] = dict(writer.scope)
    define("step", text, code, f"group {name}")
    body: dict[str, Any] = {
        "__doc__": f"{', '.join(parts)} as one component.\n\nMade from components coupled at {step / 1e6:g} ms.",
        "__module__": __name__,
        "parts": parts,
        "composition": (name, parts, links, step, stages, outputs),
        "text": text,
        "fields": {v.name: f"_border{i}" for i, v in enumerate(border)}
        | {".".join(k): s for k, s in writer.shadows.items()},
        "flows": group_equations.follows(parts, links, variables),
    }
    if has_equations:
        ends = (Role.input, Role.state)
        body["reaches"] = group_equations.follows(parts, links, variables, ("derivatives",), ends)
        body["_evaluation"] = staticmethod(code["evaluate"])
        body["_tangents"] = group_equations.slopes(writer, inputs)
    cls: type[Group] = type(name, (Group,), body)
    cls.variables, cls.layout, cls.period_ns = tuple(variables), struct_layout, step
    if has_equations:
        cls.switches = tuple(
            f"{member}.{switch}" for member, part in parts.items() for switch in part.component.switches
        )
    cls.starts, cls.terminals = starts(parts, variables), carried_over(parts, variables)
    advance = solver.sampled_advance(code["step"], step, inputs_of(at_border(border)))
    cls._functions = (group_start(code["initialize"]), advance)  # type: ignore[attr-defined]
    return cls


def group_start(initialize: Callable[..., Any]) -> Callable[..., Any]:
    """Return the start function: reset the group's ticks, then initialize its members."""
    begin = solver.initialization(None, None, sampled=True)

    def start(self: Any, t: float) -> int:
        begin(self, t)
        return int(initialize(self, t))

    return start


def exposed(
    parts: dict[str, GroupMember], driven: set[Key], outputs: list[Key], has_equations: bool
) -> tuple[list[Variable], list[Variable]]:
    """Return all variables as `member.variable` with their outer roles, and those that are the group's inputs."""
    variables, border = [], []
    for member, part in parts.items():
        for variable in part.component.variables:
            role = variable.role
            if (
                (role is Role.input and (member, variable.name) in driven)
                or (role in (Role.state, Role.derivative) and not has_equations)
                or (role is Role.output and (member, variable.name) not in outputs)
            ):
                role = Role.local
            outside = replace(variable, name=f"{member}.{variable.name}", role=role)
            variables.append(outside)
            if role is Role.input:
                border.append(outside)
    return variables, border


def at_border(border: list[Variable]) -> list[Variable]:
    """Return the group's own inputs as fields of its record: all are arrays, which are written in place."""
    return [replace(v, name=f"_border{i}", shape=v.shape or (1,)) for i, v in enumerate(border)]


def group_layout(
    writer: GroupWriter, variables: list[Variable], border: list[Variable], further: solver.Hidden | None = None
) -> MemoryLayout:
    """Return the layout of the group's struct: its inputs, the members' structs, then the engine's fields and `further` ones."""
    inputs = at_border(border)
    hidden = {**solver.hidden(None, 1, 0, inputs_of(inputs)), "_count": (Int64, (1,)), **(further or {})}
    for key, shadow in writer.shadows.items():
        hidden[shadow] = (writer.variable(key).type, writer.variable(key).shape or (1,))
    base = layout(inputs, hidden)
    fields = {n: (base.dtype.fields[n][0], base.dtype.fields[n][1]) for n in base.dtype.names or ()}  # type: ignore[index]
    at = base.dtype.itemsize
    offsets: dict[str, int] = {}
    for member, part in writer.parts.items():
        inner = part.component.layout
        fields[member] = (inner.dtype, at)
        offsets.update({f"{member}.{v.name}": at + inner.offset(v.name) for v in part.component.variables})
        at += -(-inner.dtype.itemsize // 8) * 8
    offsets.update({v.name: base.offset(f"_border{i}") for i, v in enumerate(border)})
    offsets.update({f"{m}.{n}": base.offset(shadow) for (m, n), shadow in writer.shadows.items()})
    specification = {
        "names": list(fields),
        "formats": [f for f, _ in fields.values()],
        "offsets": [o for _, o in fields.values()],
        "itemsize": at,
    }
    dtype: np.dtype[Any] = np.dtype(specification, align=True)  # type: ignore[call-overload]
    return MemoryLayout(tuple(variables), dtype, 0, offsets)


def carried_over(parts: dict[str, GroupMember], variables: list[Variable]) -> dict[str, Terminal]:
    """Return the terminals of members whose variables can all be connected outside, as `member.terminal`."""
    outside = {v.name: v for v in variables if v.role in CONNECTABLE}
    result = {}
    for member, part in parts.items():
        for name, terminal in part.component.terminals.items():
            members = {key: f"{member}.{v.name}" for key, v in terminal.members.items()}
            if all(path in outside for path in members.values()):
                outer_members = {key: outside[path] for key, path in members.items()}
                result[f"{member}.{name}"] = replace(terminal, members=outer_members)
    return result


def starts(parts: dict[str, GroupMember], variables: list[Variable]) -> dict[str, Any]:
    """Return the start values of all variables: from the scenario, else from the declarations."""
    declared = {member: part.component.start_values() for member, part in parts.items()}
    result = {}
    for variable in variables:
        member, _, name = variable.name.partition(".")
        value = parts[member].values.get(name, declared[member][name])
        result[variable.name] = np.broadcast_to(np.asarray(value, variable.dtype), variable.shape)
    return result
