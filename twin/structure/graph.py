"""How a co-simulation hangs together: who steps when, what flows with which delay, what depends on what at one instant."""

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


@dataclass(frozen=True)
class Part:
    """A member. `place`: when it steps within a communication step, counted from 1; equal ones step at the same time.

    `period`: of its steps [ns]. `feedthrough`: outputs and the connected inputs that they depend on at the same instant.
    """

    name: str
    component: str
    place: int
    period: clock.Time
    feedthrough: tuple[tuple[str, tuple[str, ...]], ...] = ()


@dataclass
class Wire:
    """What goes from one member to another. `texts`: connections as they are written, those of terminals as one.

    `delays` [ns]: how late the values are where they are used, beyond what the source's own step says; one of each.
    """

    source: str
    target: str
    texts: list[str] = field(default_factory=list)
    values: int = 0
    delays: list[clock.Time] = field(default_factory=list)

    @property
    def delay(self) -> str:
        """`0 s`, `1 ms`, or `0 s, 5 ms` where they differ."""
        return ", ".join(clock.text(one) for one in sorted(self.delays))


@dataclass(frozen=True)
class Structure:
    """A co-simulation, described. `loops`: variables that depend on each other at one instant."""

    parts: tuple[Part, ...]
    wires: tuple[Wire, ...]
    loops: tuple[tuple[str, ...], ...]
    step: clock.Time
    algorithm: str

    @property
    def usual(self) -> str:
        """The delay that most wires have."""
        counts = Counter(one.delay for one in self.wires)
        return counts.most_common(1)[0][0] if counts else ""

    @property
    def told(self) -> str:
        """One or two sentences on what the picture does not show."""
        sentences = [f"{self.algorithm}, communication step {clock.text(self.step)}."]
        if self.usual:
            others = any(one.delay != self.usual for one in self.wires)
            when = "in the step in which they are computed" if self.usual == "0 s" else f"{self.usual} late"
            sentences.append(f"Values are used {when}{', where nothing else is written' * others}.")
        if self.loops:
            names = "; ".join(", ".join(loop) for loop in self.loops)
            sentences.append(f"Depend on each other at one instant: {names}.")
        return " ".join(sentences)

    def svg(self, alone: bool = False) -> str:
        """The picture; `alone`: as a file of its own."""
        several = len({part.place for part in self.parts}) > 1
        notes = {
            part.name: " · ".join(
                [f"{part.place}."] * several + [f"every {clock.text(part.period)}"] * (part.period != self.step)
            )
            for part in self.parts
        }
        labels = {(one.source, one.target): one.delay for one in self.wires if one.delay != self.usual}
        drawn = picture.draw(
            {part.name: part.component for part in self.parts},
            {(one.source, one.target): [*one.texts, f"delay {one.delay}"] for one in self.wires},
            {name: note for name, note in notes.items() if note},
            labels,
        )
        return picture.standalone(drawn) if alone else drawn


def structure(
    simulated: CoSimulation, components: Mapping[str, str], connections: Iterable[tuple[str, str]]
) -> Structure:
    """What a co-simulation is like; `components`: what its members are made of, for people, by name.

    `connections`: as they are written, terminals whole; nothing is initialized or stepped.
    """
    place = {name: i for i, stage in enumerate(simulated.order(), 1) for name in stage}
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
            Part(name, components.get(name, ""), place[name], simulated.periods[name], feedthrough(simulated, name))
            for name in simulated.members
        ),
        tuple(wires.values()),
        tuple(tuple(f"{member}.{variable}" for member, variable in keys) for keys in loops),
        simulated.step,
        str(simulated.algorithm),
    )


def feedthrough(simulated: CoSimulation, name: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """The connected outputs of a member that depend on connected inputs at the same instant, with those inputs."""
    variables = simulated.members[name].variables
    taken = {link.target.variable.name for link in simulated.links if link.target.member == name}
    given = dict.fromkeys(link.source.variable.name for link in simulated.links if link.source.member == name)
    found = []
    for output in given:
        known = variables[output].dependencies
        on = (
            tuple(one for one in taken if known is None or one in known)
            if variables[output].causality == "output"
            else ()
        )
        if on:
            found.append((output, tuple(sorted(on))))
    return tuple(found)
