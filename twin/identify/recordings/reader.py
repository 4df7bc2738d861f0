"""An identify file as its keys, and their values in the units of what they are meant for; problems are collected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from twin.component import unit
from twin.coupling import Catalog, MemberVariable, find
from twin.errors import CouplingError
from twin.identify.recordings.schema import IdentifyKeys, InputKeys, RangeKeys
from twin.scenario import KeyFile, Node, number, short, validate

if TYPE_CHECKING:
    from twin.identify.recordings.recorded_files import Column


class ValueReader(KeyFile):
    """Keys whose values are numbers in the units of variables."""

    def quantity(self, raw: Any, symbol: str, *path: str | int, is_difference: bool = False) -> float:
        """Return a number in a unit; 0 and a problem if it is none. `is_difference`: such as a standard deviation or an offset."""
        try:
            return number(raw, symbol, "", is_difference)
        except CouplingError as error:
            self.add_problem(str(error).removeprefix(": "), *path)
            return 0.0

    def bounds(self, keys: Any, symbol: str, *path: str | int) -> tuple[float, float] | None:
        """Return the bounds `from` and `to` of keys with a scale; None and the problems if they are no range."""
        before = len(self.problems)
        ends = []
        for name, bound in (("from", keys.low), ("to", keys.high)):
            if bound is None:
                self.add_problem(f"`{name}` is missing. Give both bounds: {{from: ..., to: ...}}.", *path)
                return None
            ends.append(self.quantity(bound, symbol, *path, name))
        low, high = ends
        if len(self.problems) > before:
            return None
        if not low < high:
            self.add_problem(f"from {short(keys.low)} is not below to {short(keys.high)}. Swap them.", *path)
        elif keys.scale == "log" and low <= 0:
            text = "is not above zero, as scale: log needs it. Raise it, or leave the scale out."
            self.add_problem(f"from {short(keys.low)} {text}", *path)
        return (low, high) if len(self.problems) == before else None

    def range(self, keys: RangeKeys, symbol: str, now: float, *path: str | int) -> tuple[float, float, float]:
        """Return the bounds, and the first guess: `start`, else `now` if it lies between them, else their middle."""
        before = len(self.problems)
        start = now if keys.start is None else self.quantity(keys.start, symbol, *path, "start")
        bounds = self.bounds(keys, symbol, *path)
        if bounds is None or len(self.problems) > before:
            return 0.0, 1.0, 0.5
        low, high = bounds
        if not low <= start <= high:
            if keys.start is not None:
                self.add_problem(f"start {keys.start} is outside of {keys.low} to {keys.high}. Move it.", *path)
            start = float(np.sqrt(low * high)) if keys.scale == "log" else (low + high) / 2
        return low, high, start


class KeyReader(ValueReader):
    """The keys of one recording; `problems`, which all recordings share, and `notes` grow on the way.

    `schema`: the keys of the file; `required`: those that nothing can be done without, with an example.
    """

    schema: ClassVar[type[IdentifyKeys]] = IdentifyKeys
    required: ClassVar[tuple[tuple[str, str], ...]] = (
        ("data", "data: em.csv"),
        ("outputs", 'outputs: {"tip [mm]": sheath.tip_position}'),
        ("fit", "fit: {sheath.play: {from: 0 mm, to: 1 mm}}"),
    )
    noise_advice: ClassVar[str] = "Leave it out to have it estimated."  # for a noise that is not above zero

    def __init__(self, path: Path, root: Node, problems: list[str]) -> None:
        self.path, self.folder = path, path.parent
        self.notes: list[str] = []
        keys, valid_root, key_problems = validate(root, self.schema)
        super().__init__(valid_root, problems)
        self.keys: IdentifyKeys = keys
        self.problems += key_problems

    def refuse_missing(self) -> None:
        """Keys that nothing can be done without."""
        keys, location = self.keys, str(self.root.location)
        if bool(keys.scenario) == bool(keys.component) and not {"scenario", "component"} & self.wrong():
            what = (
                "both are given. Keep one"
                if keys.scenario
                else "is missing. Write `scenario: FILE` or `component: NAME`"
            )
            self.problems.append(f"{location}: `scenario` or `component`: {what}.")
        for key, example in self.required:
            if not getattr(keys, key) and key not in self.wrong():
                self.problems.append(f"{location}: `{key}` is missing. Add it, such as `{example}`.")

    def wrong(self) -> set[str]:
        """Top-level keys with problems: what is missing in them has been told."""
        texts = [text.split(": ", 2)[1] for text in self.problems if text.count(": ") > 1]
        return {text.partition(".")[0].partition("[")[0] for text in texts}

    def looked_up(self, name: str, catalog: Catalog, *path: str | int) -> MemberVariable | None:
        """A single number of the model."""
        try:
            reference = find(name, catalog)
        except CouplingError as error:
            self.add_problem(error, *path)
            return None
        variable = reference.variable
        if variable.dtype.kind != "f":
            self.add_problem(
                f"{name} is {variable.type}. Only real numbers can be compared, driven or looked for.", *path
            )
            return None
        return variable if reference.size == 1 else replace(variable, shape=(reference.size,))

    def converted(self, column: Column, variable: MemberVariable, keys: InputKeys, *path: str | int) -> Any:
        """Values of a column in the unit of a variable."""
        factor, offset = 1.0, 0.0
        if column.unit:
            try:
                factor, offset = unit.conversion(column.unit, variable.unit or "1", column.name)
            except CouplingError:
                self.add_problem(
                    f"is in {column.unit}, {keys.signal} in {variable.unit or 'no unit'}. Correct one.", *path
                )
        return keys.factor * (column.values * factor + offset)


def member_of(component: str) -> str:
    """What the only member is called: the component's own name."""
    name = component.rpartition("#")[2].partition("@")[0].rpartition(":")[2]
    return "".join(letter if letter.isalnum() else "_" for letter in Path(name).stem) or "part"
