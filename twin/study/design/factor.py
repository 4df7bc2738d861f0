"""What varies from case to case, and what that means for the members of a case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit as units
from twin.coupling import Catalog, find
from twin.errors import CouplingError
from twin.results import format_value, si_conversion
from twin.scenario import Case, EventSpec, number, resolve

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from twin import clock
    from twin.arrays import Array
    from twin.study.design.sampling import Distribution


@dataclass(frozen=True)
class Factor:
    """Something that varies: it sets variables, or multiplies what the scenario has. In the variables' `unit`.

    `display_unit`: unit in which the study file states its values, else the variables' display unit. `at_ns`: time [ns] at which it takes effect, as an event; None: from the start.
    """

    name: str
    sets: tuple[str, ...]
    scales: tuple[str, ...]
    distribution: Distribution
    unit: str = ""
    display_unit: str = ""
    source: str = ""
    where: str = ""
    at_ns: clock.Time | None = None

    @property
    def shown_unit(self) -> str:
        """Unit in which values are shown; `x` for a multiple of the scenario's value."""
        return "x" if self.scales else units.label(self.display_unit or self.unit)

    def in_shown_unit(self, values: Any) -> Any:
        """Convert values to the unit in which they are shown."""
        (factor, offset), (own, own_offset) = si_conversion(self.unit), si_conversion(self.display_unit or self.unit)
        return (np.asarray(values) * factor + offset - own_offset) / own

    def shown(self, value: float) -> str:
        """Format a value with its unit: `75 /min`, `x 1.2` for a multiple of the scenario's value."""
        if not np.isfinite(value):
            return "as in the scenario"
        if self.scales:
            return f"x {value:.4g}"
        factor, offset = si_conversion(self.unit)
        return format_value(value * factor + offset, self.display_unit or self.unit)


@dataclass(frozen=True)
class FactorTarget:
    """One variable of a member that factors change: elements from `first` on, `size` of them."""

    member: str
    variable: str
    first: int
    size: int


class Assignment:
    """From values of factors to values of a case's parameters, always whole variables."""

    def __init__(self, case: Case, catalog: Catalog, factors: Sequence[Factor]) -> None:
        self.catalog, self.factors = catalog, factors
        self._targets: dict[str, FactorTarget] = {}
        for path in (path for factor in factors for path in (*factor.sets, *factor.scales)):
            member = path.partition(".")[0]
            if member in case.members and has_variable(path, catalog):
                reference = find(path, catalog)
                self._targets[path] = FactorTarget(member, reference.variable.name, reference.first, reference.size)
        own = {target.member for target in self._targets.values()}
        given = {name: case.values(name, catalog[name]) for name in own}
        self._nominal: dict[tuple[str, str], Array] = {}
        for target in self._targets.values():
            variable = catalog[target.member][target.variable]
            start = given[target.member].get(target.variable, variable.start)
            self._nominal[target.member, target.variable] = np.array(
                np.broadcast_to(0.0 if start is None else start, variable.shape), np.float64
            )

    def values(self, values: Sequence[float]) -> dict[tuple[str, str], Any]:
        """(member, variable) -> start value in its type and shape, for factors' values; NaN: as the scenario has it.

        CouplingError if one leaves the declared bounds.
        """
        wanted: dict[tuple[str, str], Array] = {}
        self._apply(values, None, wanted)
        return {key: self._typed(key, array) for key, array in wanted.items()}

    def events(self, values: Sequence[float]) -> tuple[EventSpec, ...]:
        """Return what the factors with a time change, in order of time: an event for each element.

        A factor that scales multiplies the value that the factors before it have given. CouplingError as of `values`.
        """
        wanted: dict[tuple[str, str], Array] = {}
        self._apply(values, None, wanted)
        events = []
        for time_ns in sorted({factor.at_ns for factor in self.factors if factor.at_ns is not None}):
            for target, where in self._apply(values, time_ns, wanted).items():
                key = target.member, target.variable
                elements = list(elements_of(key, self._typed(key, wanted[key])))
                for path, item in elements[target.first : target.first + target.size]:
                    events.append(EventSpec(time_ns, "set", path, item, where))
        return tuple(events)

    def _apply(
        self, values: Sequence[float], at_ns: clock.Time | None, wanted: dict[tuple[str, str], Array]
    ) -> dict[FactorTarget, str]:
        """Change `wanted` by the factors of one time, first those that set; return what they change, with file:line."""
        changed: dict[FactorTarget, str] = {}
        for is_scale in (False, True):
            for factor, value in zip(self.factors, values, strict=True):
                for path in factor.scales if is_scale else factor.sets:
                    if path not in self._targets or not np.isfinite(value) or factor.at_ns != at_ns:
                        continue
                    target = self._targets[path]
                    key = target.member, target.variable
                    array = wanted.setdefault(key, self._nominal[key].copy())
                    part = array.reshape(-1)[target.first : target.first + target.size]
                    part[:] = part * value if is_scale else value
                    changed.setdefault(target, factor.where)
        return changed

    def _typed(self, key: tuple[str, str], array: Array) -> Any:
        variable = self.catalog[key[0]][key[1]]
        if variable.dtype.kind in "iu":
            array = np.rint(array)
        elif variable.type == "Boolean":
            return (array != 0).astype(np.bool_)[()]
        return resolve(array.tolist(), variable, f"{key[0]}.{key[1]}")

    def nominal(self, factor: Factor) -> float:
        """What the scenario has for the first variable that a factor sets; NaN if it is not there."""
        target = self._targets.get(factor.sets[0])
        if target is None:
            return float("nan")
        return float(self._nominal[target.member, target.variable].reshape(-1)[target.first])

    def options(self, values: Sequence[float]) -> list[str]:
        """The same as `--set` options, element by element; read again they are the same bits."""
        return [option(*entry) for key, value in self.values(values).items() for entry in elements_of(key, value)]


def elements_of(key: tuple[str, str], value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the elements of a member's variable as `member.variable[1,2]` and a Python scalar."""
    for element_index in np.ndindex(np.shape(value)):
        index = f"[{','.join(str(i + 1) for i in element_index)}]" if element_index else ""
        yield f"{'.'.join(key)}{index}", np.asarray(value)[element_index].item()


def option(path: str, item: Any) -> str:
    """Return a value as a `--set` option that is read as the same bits."""
    return f"{path}={str(item).lower() if isinstance(item, bool) else repr(item)}"


def has_variable(path: str, catalog: Catalog) -> bool:
    """Whether a variant's member has the variable of `path`: a controller of one variant may have more than the others'."""
    member, _, name = path.partition(".")
    return name in catalog[member] or name.partition("[")[0] in catalog[member]


def unit_of(paths: Sequence[str], catalog: Mapping[str, Any]) -> tuple[str, str]:
    """Unit and display unit that some variables have in common. CouplingError if there is no such variable, or no such unit."""
    variables = [find(path, catalog).variable for path in paths]
    for path, variable in zip(paths, variables, strict=True):
        if variable.dtype.kind == "O":
            raise CouplingError(f"{path} is {variable.type}. Only numbers and Booleans can vary.")
        if variable.causality not in ("parameter", "structuralParameter", "input"):
            raise CouplingError(f"{path} is no parameter ({variable.causality}). Vary what it is computed from.")
    if len({variable.unit for variable in variables}) > 1:
        units = ", ".join(f"{path} in {v.unit or '1'}" for path, v in zip(paths, variables, strict=True))
        raise CouplingError(f"{units}: one factor cannot set all of them. Make a factor for each unit.")
    return variables[0].unit, variables[0].display_unit


def limit_in_si(raw: Any, symbol: str) -> float:
    """A limit of a tuning in SI; a bare number is in SI already, `95 %` is a share."""
    if not isinstance(raw, str):
        return float(raw)
    if raw.rstrip().endswith("%"):
        return float(raw.rstrip().removesuffix("%")) / 100
    factor, offset = si_conversion(symbol)
    return number(raw, symbol, "limit") * factor + offset
