"""Structure of a co-simulation: stepping order, delays of connections, direct feedthrough and algebraic loops."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from twin import clock
from twin.coupling import direct_followers
from twin.graph import ordered_groups
from twin.structure import picture

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.coupling import CoSimulation

    Edge = tuple[str, str]


def short_name(component: str) -> str:
    """Return a component without the folders of its file: `rig.yaml#rig@fast`."""
    path, mark, part = component.partition("#")
    return f"{path.rpartition('/')[2]}{mark}{part}"


@dataclass(frozen=True)
class GraphMember:
    """Member of the structure. `rank`: position in the stepping order, counted from 1; members of equal rank step together.

    `period`: of its steps [ns]. `feedthrough`: outputs with the connected inputs that they depend on at the same instant.
    """

    name: str
    component: str
    rank: int
    period: clock.Time
    feedthrough: tuple[tuple[str, tuple[str, ...]], ...] = ()


@dataclass
class Wire:
    """All connections from one member to another. `texts`: connections as written, those of terminals as one.

    `delays` [ns]: age of the values when they are used, beyond the source's own step; each different one once.
    """

    source: str
    target: str
    texts: list[str] = field(default_factory=list)
    values: int = 0
    delays: list[clock.Time] = field(default_factory=list)

    @property
    def delay(self) -> str:
        """Delays as text: `0 s`, `1 ms`, or `0 s, 5 ms` where they differ."""
        return ", ".join(clock.text(delay) for delay in sorted(self.delays))


@dataclass(frozen=True)
class Structure:
    """Structure of a co-simulation. `loops`: algebraic loops, as the variables in them."""

    parts: tuple[GraphMember, ...]
    wires: tuple[Wire, ...]
    loops: tuple[tuple[str, ...], ...]
    step: clock.Time
    algorithm: str

    @property
    def usual(self) -> str:
        """Most frequent delay of the wires."""
        counts = Counter(wire.delay for wire in self.wires)
        return counts.most_common(1)[0][0] if counts else ""

    @property
    def summary(self) -> str:
        """Summary of what the picture does not show: algorithm, step, usual delay, algebraic loops."""
        sentences = [f"{self.algorithm}, communication step {clock.text(self.step)}."]
        if self.usual:
            differ = any(wire.delay != self.usual for wire in self.wires)
            delay = "none" if self.usual == "0 s" else self.usual.replace(", ", " or ")
            sentences.append(f"Delay of each connection: {delay}{' unless labeled' * differ}.")
        if self.loops:
            names = "; ".join(", ".join(loop) for loop in self.loops)
            sentences.append(f"Solved together at each instant (algebraic loop): {names}.")
        return " ".join(sentences)

    def svg(self, alone: bool = False) -> str:
        """Draw the structure as SVG; `alone`: as a standalone file."""
        several = len({part.rank for part in self.parts}) > 1
        notes = {
            part.name: " · ".join(
                [f"{part.rank}."] * several + [f"every {clock.text(part.period)}"] * (part.period != self.step)
            )
            for part in self.parts
        }
        labels = {(wire.source, wire.target): wire.delay for wire in self.wires if wire.delay != self.usual}
        svg = picture.draw(
            {part.name: part.component for part in self.parts},
            {(wire.source, wire.target): [*wire.texts, f"delay {wire.delay}"] for wire in self.wires},
            {name: note for name, note in notes.items() if note},
            labels,
        )
        return picture.standalone(svg) if alone else svg


def structure(
    simulated: CoSimulation, components: Mapping[str, str], connections: Iterable[tuple[str, str]]
) -> Structure:
    """Describe the structure of a co-simulation; `components`: what to display as each member's component, by name.

    `connections`: as written, those of terminals as one. Nothing is initialized or stepped.
    """
    stage_number = {name: i for i, stage in enumerate(simulated.order(), 1) for name in stage}
    catalog = {name: member.variables for name, member in simulated.members.items()}
    wires: dict[Edge, Wire] = {}
    for link, delay in simulated.delays():
        edge = link.source.member, link.target.member
        wire = wires.setdefault(edge, Wire(*edge))
        wire.values += link.source.size
        if delay not in wire.delays:
            wire.delays.append(delay)
    for source, target in connections:
        edge = source.partition(".")[0], target.partition(".")[0]
        if edge in wires:
            wires[edge].texts.append(f"{source} → {target}")
    followers = direct_followers(simulated.links, catalog)
    loops = [
        keys for keys in ordered_groups(list(followers), followers) if len(keys) > 1 or keys[0] in followers[keys[0]]
    ]
    return Structure(
        tuple(
            GraphMember(
                name,
                components.get(name, ""),
                stage_number[name],
                simulated.periods[name],
                feedthrough(simulated, name),
            )
            for name in simulated.members
        ),
        tuple(wires.values()),
        tuple(tuple(f"{member}.{variable}" for member, variable in keys) for keys in loops),
        simulated.step,
        str(simulated.algorithm),
    )


def feedthrough(simulated: CoSimulation, name: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the connected outputs of a member that depend on connected inputs at the same instant, with those inputs."""
    variables = simulated.members[name].variables
    inputs = {link.target.variable.name for link in simulated.links if link.target.member == name}
    outputs = dict.fromkeys(link.source.variable.name for link in simulated.links if link.source.member == name)
    result = []
    for output in outputs:
        dependencies = variables[output].dependencies
        connected_inputs = (
            tuple(input_name for input_name in inputs if dependencies is None or input_name in dependencies)
            if variables[output].causality == "output"
            else ()
        )
        if connected_inputs:
            result.append((output, tuple(sorted(connected_inputs))))
    return tuple(result)
