"""Analyses: functions of recorded signals whose results are signals too, under the analysis's name.

    analyses:
      bouc_wen: {function: "fmus.bouc_wen_compensator.identify:analysis", inputs: {x_in: tracker.x, x_out: tracker.y}}

The function takes the inputs as arrays in SI by keyword, and gives a dict: a number, or an array as long as its
inputs, for each name of its attribute `outputs` (name -> unit). Metrics, plots and signals.parquet then know
`bouc_wen.alpha_x` like a member's variable.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import catalog
from twin.coupling import MemberVariable
from twin.errors import ScenarioError, TwinError, nearest
from twin.results.signals import WHOLE, Window, within

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from twin.results.expression import Expression
    from twin.results.signals import Signals


def callables(module: ModuleType) -> list[str]:
    """What of a module can be called and is not its own affair."""
    return [name for name, value in vars(module).items() if callable(value) and not name.startswith("_")]


@dataclass(frozen=True)
class Analysis:
    """An analysis of a scenario file. No `variants`: all that have its inputs."""

    name: str
    function: str
    inputs: dict[str, Expression]
    window: Window = WHOLE
    variants: tuple[str, ...] = ()
    where: str = field(default="", compare=False)

    def load(self) -> Callable[..., dict[str, Any]]:
        """Import the function."""
        path, _, name = self.function.partition(":")
        if not path or not name:
            raise ScenarioError(f"{self.where}: analysis {self.function!r}: write `module:function`.")
        try:
            module = catalog.module(path, self.function)
        except TwinError as error:
            raise ScenarioError(f"{self.where}: {error}") from None
        function: Callable[..., dict[str, Any]] | None = getattr(module, name, None)
        if function is None:
            raise ScenarioError(f"{self.where}: {path} has no function {name!r}. {nearest(name, callables(module))}")
        if not isinstance(getattr(function, "outputs", None), dict):
            raise ScenarioError(f"{self.where}: {self.function} needs an attribute `outputs`, a dict of name -> unit.")
        return function

    def variables(self) -> dict[str, MemberVariable]:
        """What the analysis gives, as if it were a member."""
        outputs: dict[str, str] = self.load().outputs  # type: ignore[attr-defined]
        return {
            name: MemberVariable(name, "output", "discrete", "Float64", np.dtype(np.float64), (), unit)
            for name, unit in outputs.items()
        }

    def apply(self, signals: Signals) -> Signals:
        """The signals with those of the analysis; before and after its window they are not a number."""
        found = {name: given(signals, expression, self.window) for name, expression in self.inputs.items()}
        arrays = {name: values for name, values in found.items() if values is not None}
        if len(arrays) < len(self.inputs):
            return signals
        try:
            results = self.load()(**arrays)
        except TwinError:
            raise
        except Exception as error:  # a person's own function may raise anything
            raise TwinError(f"{self.where}: {self.function} failed: {type(error).__name__}: {error}") from error
        inside = within(np.asarray(signals.time), self.window)
        values, units = dict(signals.values), dict(signals.units)
        for name, variable in self.variables().items():
            whole = np.full(len(inside), np.nan)
            whole[inside] = results[name]
            values[f"{self.name}.{name}"] = whole
            units[f"{self.name}.{name}"] = variable.unit
        return replace(signals, values=values, units=units)


def given(signals: Signals, expression: Expression, window: Window) -> Any:
    """An input of an analysis: a value for each sample, or of an array's bare name all of it, (n, ...); None: not recorded."""
    if (pair := signals.evaluate(expression, window)) is not None:
        return pair[1]
    whole = signals.si({expression.single.name}) if expression.single and not expression.single.index else {}
    return next((values[within(np.asarray(signals.time), window)] for values in whole.values()), None)
