"""A set of a validation file, checked: its component, its quantities, and predictions at given parameter values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from twin import clock, compiler
from twin.component import catalog, unit
from twin.errors import CouplingError, TwinError, nearest
from twin.identify import Unknown, ValueReader
from twin.validation.data import Data, SetReader
from twin.validation.rollout import MEMBER, RollOut

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from twin.arrays import Array
    from twin.scenario import Node
    from twin.validation.schema import SetKeys


@dataclass(frozen=True)
class Quantity:
    """What a row of the result is about: one output, or the distance of several.

    `indices`: of outputs; `factor`, `offset`: from their units to `unit`, of each or the same for all.
    """

    name: str
    unit: str
    indices: tuple[int, ...]
    factor: float | tuple[float, ...]
    offset: float | tuple[float, ...] = 0.0

    @property
    def is_distance(self) -> bool:
        """Whether errors are lengths of vectors."""
        return len(self.indices) > 1

    def shown(self, values: Array) -> Array:
        """Its outputs in `unit`, shape (N, indices)."""
        return np.asarray(self.factor * values[:, self.indices] + np.asarray(self.offset))

    def difference(self, predicted: Array, measured: Array) -> Array:
        """Predicted minus measured of its outputs in `unit`, shape (N, indices)."""
        return np.asarray(self.factor * (predicted - measured)[:, self.indices])

    def error(self, predicted: Array, measured: Array) -> Array:
        """Predicted minus measured, or the length of this vector, in `unit`, shape (N,)."""
        difference = self.difference(predicted, measured)
        return np.asarray(np.linalg.norm(difference, axis=1) if self.is_distance else difference[:, 0])


class ValidationSet(ValueReader):
    """A set of a validation file with its component, ready to predict. ScenarioError lists all problems."""

    def __init__(self, name: str, keys: SetKeys, root: Node, build: Path) -> None:
        super().__init__(root, [])
        self.name, self.keys = name, keys
        self.require_keys()
        self.stop_if_wrong()
        try:
            self.rollout = RollOut(
                keys.component,
                keys.set,
                clock.seconds(keys.step or 0),
                list(keys.inputs.values()),
                [output.signal for output in keys.outputs.values()],
                build,
            )
        except (TwinError, CouplingError) as error:
            self.add_problem(error, "component")
        self.stop_if_wrong()
        self.check_columns()
        self.stop_if_wrong()

    def add_problem(self, error: TwinError | str, *path: str | int) -> None:
        """Add the problems of a key of the set."""
        super().add_problem(error, "sets", self.name, *path)

    def require_keys(self) -> None:
        """Keys without which nothing can be predicted."""
        for key, example in (
            ("files", "files: robot/*.csv"),
            ("component", "component: tendon_robot"),
            ("step", "step: 2 ms"),
            ("inputs", "inputs: {tendon: displacement}"),
            ("outputs", "outputs: {angle: {signal: tip_angle, unit: deg}}"),
        ):
            if not getattr(self.keys, key):
                self.add_problem(f"`{key}` is missing. Add it, such as `{example}`.")

    def check_columns(self) -> None:
        """Check names of variables, units and columns against each other."""
        keys = self.keys
        for group in ("initial", "fit", "rezero"):
            for name in getattr(keys, group):
                try:
                    self.rollout.variable(name)
                except CouplingError as error:
                    self.add_problem(error, group, name)
        for column in keys.turned:
            if column not in keys.outputs:
                self.add_problem(f"there is no output {column}. {nearest(column, keys.outputs)}", "turned")
        for name, columns in keys.distance.items():
            for column in columns:
                if column not in keys.outputs:
                    self.add_problem(f"there is no output {column}. {nearest(column, keys.outputs)}", "distance", name)
                elif columns[0] in keys.outputs:
                    first, other = (self.units[keys.outputs[c].signal] for c in (columns[0], column))
                    try:
                        unit.conversion(other, first, column)
                    except CouplingError as error:
                        self.add_problem(error, "distance", name)
        for column, output in keys.outputs.items():
            try:
                unit.conversion(self.units[output.signal], output.unit, column)
            except CouplingError as error:
                self.add_problem(error, "outputs", column)

    @property
    def outputs(self) -> list[str]:
        """Columns that are compared, in the order of data and predictions."""
        return list(self.keys.outputs)

    @cached_property
    def units(self) -> dict[str, str]:
        """Units of the component's variables by name, as the file uses them."""
        keys = self.keys
        signals = [output.signal for output in keys.outputs.values()]
        names = [*keys.inputs.values(), *signals, *keys.initial, *keys.fit, *keys.rezero]
        return {name: self.rollout.variable(name).unit for name in names}

    @cached_property
    def quantities(self) -> list[Quantity]:
        """Quantities of the result: outputs that are in no distance, then distances."""
        in_distance = {column for columns in self.keys.distance.values() for column in columns}
        rows = [(o.quantity or c, [c]) for c, o in self.keys.outputs.items() if c not in in_distance]
        rows += [(name, columns) for name, columns in self.keys.distance.items()]
        quantities = []
        for name, columns in rows:
            first = self.keys.outputs[columns[0]]
            shown = first.unit or self.units[first.signal]
            signals = [self.keys.outputs[column].signal for column in columns]
            factors, offsets = zip(*(unit.conversion(self.units[s], shown, name) for s in signals), strict=True)
            quantities.append(Quantity(name, shown, tuple(map(self.outputs.index, columns)), factors, offsets))
        return quantities

    @property
    def source_hash(self) -> str:
        """Hash of the source of the component, and of the user's modules that it imports."""
        return compiler.source_hash(catalog.component(self.keys.component))

    def reader(
        self, window: int | None = None, *, training: bool = False, changes: Mapping[str, float] | None = None
    ) -> SetReader:
        """Reader of the set's files. `window`: rows of a roll-out instead of the file's own; `changes`: see there."""
        own = self.keys.train_window if training and self.keys.train_window is not None else self.keys.window
        return SetReader(self.keys, self.units, own if window is None else window, changes or {})

    def start(self, name: str) -> float:
        """Value of a parameter that nothing fitted, in the variable's unit."""
        return self.rollout.start(name)

    def predict(self, data: Data, values: Mapping[str, float], corrections: Mapping[str, float] | None = None) -> Array:
        """Predict the measurements, shape (N, outputs), in the variables' units; SimulationError if this fails.

        `corrections` take precedence over measured initial values, these over `values`.
        """
        grid = self.rollout(data.inputs, {**values, **data.initial, **(corrections or {})})
        return data.at_samples(grid)

    def unknowns(self, group: Literal["fit", "rezero"]) -> list[Unknown]:
        """What a fit looks for, with bounds in the variables' units."""
        unknowns = []
        for name, keys in getattr(self.keys, group).items():
            variable = self.rollout.variable(name)
            start = self.start(name)
            if keys.start is not None:
                start = self.quantity(keys.start, variable.unit, group, name, "start")
            bounds = self.bounds(keys, variable.unit, group, name)
            self.stop_if_wrong()
            assert bounds is not None, "else there are problems"
            low, high = bounds
            unknowns.append(
                Unknown(
                    name,
                    variable.unit,
                    low,
                    high,
                    min(max(start, low), high),
                    keys.scale == "log",
                    MEMBER,
                    name,
                    variable.display_unit,
                )
            )
        return unknowns
