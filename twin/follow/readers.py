"""Reader of the changes of a follow file, in the variables' units."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from twin.coupling import find
from twin.follow.changes import NO_CHANGE, UNKNOWN, Amount, Change

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.follow.problem import FollowLoader
    from twin.follow.schema import ChangeKeys

FACTOR = re.compile(r"[x*]\s*(\d.*)")
HOUR = 3600.0  # [s]


def read_changes(loader: FollowLoader) -> tuple[Change, ...]:
    """Return the changes to look for; problems are added to those of the loader."""
    return tuple(change for name, keys in loader.keys.changes.items() for change in read_change(loader, name, keys))


def read_change(loader: FollowLoader, name: str, keys: ChangeKeys) -> Iterator[Change]:
    """Yield a change, unless it has problems."""
    path, before = ("changes", name), len(loader.problems)
    lists = {key: raw if isinstance(raw, list) else [raw] for key, raw in keys.set.items()}
    if not lists:
        loader.add_problem("`set` is missing. Add what changes, such as set: {sheath.friction: x1.5}.", *path)
    elif len({len(values) for values in lists.values()}) > 1 or not all(lists.values()):
        loader.add_problem("lists in `set` differ in length. Give each variable as many amounts.", *path, "set")
    elif name in (NO_CHANGE, UNKNOWN):
        loader.add_problem(f"`{name}` is what no listed change is called. Choose another name.", *path)
    amounts = [
        amount(loader, {key: values[i] for key, values in lists.items()}, *path, "set")
        for i in range(max(map(len, lists.values()), default=0) if len(loader.problems) == before else 0)
    ]
    if len(loader.problems) == before:
        yield Change(name, keys.rate / HOUR, tuple(amounts))


def amount(loader: FollowLoader, values: dict[str, Any], *path: str) -> Amount:
    """Return one amount of a change: of parameters, or as offsets of measured signals."""
    parameters: dict[str, tuple[float, float]] = {}
    offsets: dict[int, float] = {}
    signals = [output.signal for output in loader.compared]
    for name, raw in values.items():
        variable = loader.looked_up(name, loader.catalog, *path, name)
        if variable is None:
            continue
        factor, difference = terms(loader, raw, variable.unit, *path, name)
        if name in signals:
            if factor != 1.0:
                loader.add_problem("a measured signal gets an offset, such as +5 mN.", *path, name)
            offsets[signals.index(name)] = difference
        elif variable.causality != "parameter" or variable.variability == "fixed":
            loader.add_problem(
                f"{name} is no tunable parameter and no measured signal. Name one of these.", *path, name
            )
        elif name.partition(".")[0] not in {signal.partition(".")[0] for signal in loader.full_case.members}:
            loader.add_problem(f"{name} has no influence on the measured signals.", *path, name)
        else:
            parameters.update(dict.fromkeys(elements(name, loader), (factor, difference)))
    return Amount(parameters, offsets)


def elements(name: str, loader: FollowLoader) -> list[str]:
    """Return the elements of a variable, such as `sheath.friction[1]`."""
    reference = find(name, loader.catalog)
    return [name] if reference.size == 1 else [f"{name}[{i + 1}]" for i in range(reference.size)]


def terms(loader: FollowLoader, raw: Any, unit: str, *path: str) -> tuple[float, float]:
    """Return factor and difference: `x1.5` multiplies, a sign adds, and all else is the new value."""
    text = str(raw).strip()
    if match := FACTOR.fullmatch(text):
        return loader.quantity(match[1], "", *path), 0.0
    if text[:1] in "+-":
        return 1.0, (-1.0 if text[0] == "-" else 1.0) * loader.quantity(
            text[1:].strip(), unit, *path, is_difference=True
        )
    return 0.0, loader.quantity(raw, unit, *path)
