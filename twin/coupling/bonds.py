"""Power bonds: connections in both directions whose product is a power or an energy: force and velocity, pressure and flow.

Connections with the same name in `bond:` form one bond; so do those of two terminals, if their product is a power or energy.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from twin.component import unit
from twin.coupling.system import is_real
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.coupling.system import ResolvedConnection

POWER, ENERGY = "W", "J"
PRODUCT_UNITS = (POWER, ENERGY)  # energy: a bond with a displacement instead of a velocity


def find_bonds(links: Iterable[ResolvedConnection]) -> dict[str, list[ResolvedConnection]]:
    """Return the connections of each bond by name; CouplingError for declared bonds that are none."""
    named: dict[tuple[str, bool], list[ResolvedConnection]] = {}
    for link in links:
        if name := link.bond or link.terminals:
            named.setdefault((name, bool(link.bond)), []).append(link)
    problems = [
        f"bond {name}: {problem}"
        for (name, declared), own in named.items()
        if declared and (problem := bond_problem(own))
    ]
    if problems:
        raise CouplingError(problems)
    return {name: own for (name, _), own in named.items() if not bond_problem(own)}


def bond_problem(links: list[ResolvedConnection]) -> str:
    """Return why connections are no power bond; empty if they are one."""
    ends = {frozenset((link.source.member, link.target.member)) for link in links}
    if len(ends) > 1:
        names = ", ".join(sorted({name for pair in ends for name in pair}))
        return f"is between more than two members: {names}. Give every pair a name of its own."
    sides = list(dict.fromkeys(link.source.member for link in links))
    if len(sides) != 2:
        return f"goes one way only, from {sides[0]}. Declare it at a connection back, too."
    forward, backward = (
        [link for link in links if link.source.member == side and is_real(link.target.variable)] for side in sides
    )
    if not any(is_power(a, b) for a, b in product(forward, backward)):
        units = " and ".join(link_label(link) for link in links[:2])
        return f"{units} give no power. Declare it at a force and a velocity, a torque and an angle, a pressure and a flow."
    return ""


def is_power(a: ResolvedConnection, b: ResolvedConnection, units: tuple[str, ...] = PRODUCT_UNITS) -> bool:
    """Whether the product of two connected quantities has one of the units (power or energy); angles are dimensionless."""
    factors = [unit.describe(link.target.variable.unit).exponents for link in (a, b)]
    exponents = [x + y for x, y in zip(*factors, strict=True)][:-1]
    return any(exponents == list(unit.describe(symbol).exponents)[:-1] for symbol in units)


def find_power_pairs(
    links: Iterable[ResolvedConnection],
) -> list[list[tuple[ResolvedConnection, ResolvedConnection, float]]]:
    """Return for each bond the pairs of connections (there, back) whose product is a power, with its unit [W].

    CouplingError for a declared bond without one: with a position instead of a velocity the product is an energy.
    """
    result = []
    for name, bond_links in find_bonds(links).items():
        first = bond_links[0].source.member
        sides = product(
            *([link for link in bond_links if (link.source.member == first) is there] for there in (True, False))
        )
        pairs = [
            (a, b, si_factor(a) * si_factor(b))
            for a, b in sides
            if a.target.size == b.target.size and is_power(a, b, (POWER,))
        ]
        if not pairs and bond_links[0].bond:
            raise CouplingError(
                f"bond {name}: has a force and a place, but no velocity, so it tells an energy and no power. "
                "Declare it at the velocity, too, or use predictive or step_doubling."
            )
        result += [pairs] if pairs else []
    return result


def si_factor(link: ResolvedConnection) -> float:
    """Return the factor from the unit of an input to SI."""
    return unit.describe(link.target.variable.unit).factor


def link_label(link: ResolvedConnection) -> str:
    """Return the source of a connection with its unit: `servo.position [m]`."""
    return f"{link.source.member}.{link.source.variable.name} [{link.target.variable.unit or '1'}]"
