"""Analyses: functions of recorded signals whose results are signals too, under the analysis's name.

    analyses:
      bouc_wen: {function: "fmus.bouc_wen_compensator.identify:analysis", inputs: {x_in: tracker.x, x_out: tracker.y}}

The function takes the inputs as arrays in SI by keyword, and gives a dict: a number, or an array as long as its
inputs, for each name of its attribute `outputs` (name -> unit). Metrics, plots and signals.parquet then know
`bouc_wen.alpha_x` like a member's variable.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import MemberVariable
from twin.errors import ScenarioError, TwinError
from twin.results.signals import WHOLE, Signals, Window

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.results.expression import Expression


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
        module, colon, name = self.function.partition(":")
        try:
            function: Callable[..., dict[str, Any]] = getattr(importlib.import_module(module), name)
            outputs = function.outputs  # type: ignore[attr-defined]
        except (ImportError, AttributeError, ValueError) as error:
            hint = "It needs an attribute `outputs` (name -> unit)." if colon else "Write `module:function`."
            raise ScenarioError(f"{self.where}: {self.function} cannot be used ({error}). {hint}") from None
        if not isinstance(outputs, dict):
            raise ScenarioError(f"{self.where}: {self.function}.outputs is no dict of name -> unit.")
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
        found = {name: signals.evaluate(expression, self.window) for name, expression in self.inputs.items()}
        arrays = {name: pair[1] for name, pair in found.items() if pair is not None}
        if len(arrays) < len(self.inputs):
            return signals
        try:
            results = self.load()(**arrays)
        except TwinError:
            raise
        except Exception as error:  # a person's own function may raise anything
            raise TwinError(f"{self.where}: {self.function} failed: {type(error).__name__}: {error}") from error
        time = np.rint(signals.time * clock.NANOSECONDS)
        start, stop = self.window.start_ns, self.window.stop_ns
        inside = np.ones(len(time), bool)
        inside &= True if start is None else time >= start
        inside &= True if stop is None else time <= stop
        values, units = dict(signals.values), dict(signals.units)
        for name, variable in self.variables().items():
            whole = np.full(len(time), np.nan)
            whole[inside] = results[name]
            values[f"{self.name}.{name}"] = whole
            units[f"{self.name}.{name}"] = variable.unit
        return Signals(signals.time, values, units, signals.complete)
