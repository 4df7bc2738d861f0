"""What was found, as a parameter set that scenarios take: values, and below `identified` how well they are known and why.

`identified` holds lists in one order: `unknowns`, their `units`, `values`, `bounds`, and the `covariance` matrix in those
units, from which `twin.identify.read_estimate` gives a study what it draws from.
"""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from twin import installed
from twin.errors import ScenarioError, nearest
from twin.identify.intervals import SHARE, TOGETHER, WIDEST, ParameterUncertainty
from twin.results import run_folder
from twin.scenario import read

if TYPE_CHECKING:
    from datetime import datetime

    from twin.arrays import Array
    from twin.identify.problem import Problem
    from twin.identify.search import Fit

NARROW = 0.1  # interval as part of the range between the bounds, below which correlation does no harm
KEY = "identified"


def verdicts(problem: Problem, fit: Fit, knowledge: ParameterUncertainty) -> list[list[str]]:
    """For each unknown why its value is not to be relied on; nothing if it is."""
    names = [unknown.name for unknown in problem.unknowns]
    texts: list[list[str]] = [[] for _ in names]
    for i, unknown in enumerate(problem.unknowns):
        if not knowledge.effect[i]:
            texts[i].append("not identifiable: it changes nothing of what is compared")
            continue
        if bound := unknown.at_bound(float(fit.positions[i])):
            texts[i].append(f"at its {bound} bound: move the bound if the value makes no sense there")
        texts[i] += wide(knowledge, i)
        for k, name in enumerate(names):
            r = float(knowledge.correlation[i, k])
            if k != i and abs(r) > TOGETHER and not is_narrow(knowledge, i):
                texts[i].append(f"cannot be separated from {name}: correlation {r:.4f}")
    for i, text in combinations(names, knowledge):
        if not any("correlation" in text for text in texts[i]):
            texts[i].append(text)
    return texts


def is_narrow(knowledge: ParameterUncertainty, i: int) -> bool:
    """Whether an interval is small relative to the bounds, so that the value is determined."""
    return bool(knowledge.high[i] - knowledge.low[i] < NARROW)


def pairs(problem: Problem, knowledge: ParameterUncertainty) -> list[str]:
    """Unknowns that are known, but only together."""
    names = [unknown.name for unknown in problem.unknowns]
    return [
        f"{names[i]} and {names[k]} cannot be separated, correlation {knowledge.correlation[i, k]:.4f}. Take both from one file."
        for i in range(len(names))
        for k in range(i)
        if abs(knowledge.correlation[i, k]) > TOGETHER and is_narrow(knowledge, i) and is_narrow(knowledge, k)
    ]


def wide(knowledge: ParameterUncertainty, i: int) -> list[str]:
    """What is wrong with the interval of an unknown."""
    low, high = float(knowledge.low[i]), float(knowledge.high[i])
    if knowledge.method == "profile":
        open_ends = [side for side, end in (("lower", low), ("upper", high)) if np.isnan(end)]
        if open_ends:
            return [f"not identifiable: flat profile, open up to its {' and its '.join(open_ends)} bound"]
        return []
    if high - low > 1.0:
        return ["not identifiable: its interval is wider than its bounds"]
    return []


def combinations(names: list[str], knowledge: ParameterUncertainty) -> list[tuple[int, str]]:
    """Unknowns of which the data tell only other combinations than one of three or more."""
    rows = []
    for deviation, direction in zip(knowledge.singular, knowledge.directions, strict=True):
        own = [i for i in range(len(names)) if abs(direction[i]) > SHARE]
        if deviation > WIDEST and len(own) > 1:
            for i in own:
                others = " and ".join(names[k] for k in own if k != i)
                rows.append((i, f"not identifiable beside {others}: the data do not tell one combination of them"))
    return rows


@dataclass
class Result:
    """An identification that is done. `intervals` in the unknowns' units, NaN at open ends."""

    problem: Problem
    fit: Fit
    knowledge: ParameterUncertainty
    predicted: list[Array]
    command: str
    started: datetime
    verdicts: list[list[str]] = field(init=False)

    def __post_init__(self) -> None:
        self.verdicts = verdicts(self.problem, self.fit, self.knowledge)

    @property
    def values(self) -> list[float]:
        """Values of the unknowns in their units."""
        return [unknown.value(float(x)) for unknown, x in zip(self.problem.unknowns, self.fit.positions, strict=True)]

    @property
    def intervals(self) -> list[tuple[float, float]]:
        """Ends of the intervals in the unknowns' units."""
        ends = zip(self.problem.unknowns, self.knowledge.low, self.knowledge.high, strict=True)
        return [(unknown.value(float(low)), unknown.value(float(high))) for unknown, low, high in ends]

    @property
    def slopes(self) -> Array:
        """Derivatives of the values by the places."""
        return np.array(
            [unknown.slope(float(x)) for unknown, x in zip(self.problem.unknowns, self.fit.positions, strict=True)]
        )

    @property
    def covariance(self) -> Array:
        """Covariance of the values in their units; that of the place of a logarithm is linearized."""
        matrix: Array = self.knowledge.covariance * np.outer(self.slopes, self.slopes)
        return matrix

    @property
    def passed(self) -> bool:
        """Whether every unknown is identified."""
        return not any(self.verdicts) and not self.fit.interrupted

    def interval_text(self, i: int) -> str:
        """`3.1 mm to 3.3 mm`."""
        unknown, (low, high) = self.problem.unknowns[i], self.intervals[i]
        if self.knowledge.low[i] < 0 and self.knowledge.high[i] > 1:
            return "wider than its bounds"
        if np.isnan(low) and np.isnan(high):
            return "not known"
        return f"{unknown.shown(low)} to {unknown.shown(high)}".replace("unbounded to", "open to")

    def notes(self) -> list[str]:
        """What the person has to know."""
        own = zip(self.problem.unknowns, self.verdicts, strict=True)
        return [*(f"{unknown.name}: {text}." for unknown, texts in own for text in texts), *self.remarks()]

    def remarks(self) -> list[str]:
        """Remarks in addition to the verdicts."""
        fit, knowledge = self.fit, self.knowledge
        texts = [*self.problem.notes, *pairs(self.problem, knowledge)]
        if fit.interrupted:
            texts.append("interrupted: the best so far, which need not be the best there is.")
        if len(fit.starts) > 1 and fit.agreeing == 1:
            texts.append(
                f"only one of {len(fit.starts)} starts came to this. Try more: --starts {4 * len(fit.starts)}."
            )
        if "since" in fit.derivatives:
            texts.append(f"the Jacobian is made of {fit.derivatives}.")
        if fit.failures:
            texts.append(f"the model failed in {fit.failures} of {fit.simulations} simulations. Narrow the bounds.")
        if rough := [
            unknown.name for unknown, is_rough in zip(self.problem.unknowns, knowledge.rough, strict=True) if is_rough
        ]:
            texts.append(
                f"{' and '.join(rough)}: small changes change the model at random, as increments of a sensor and friction in a "
                f"closed loop do. Compare what the sensor senses, replay what the loop did as an input, and mind the starts."
            )
        if knowledge.inflation > 2:
            texts.append(
                f"residuals follow each other: the model does not explain all that was measured. The intervals are "
                f"{np.sqrt(knowledge.inflation):.2g} times as wide for it, which is a guess."
            )
        if all(output.noise for output in self.problem.outputs) and knowledge.residual > 1.2:
            texts.append(
                f"residuals are {knowledge.residual:.2g} times the stated noise: the model or the noise is wrong."
            )
        return texts

    def parameter_set(self, folder: Path = Path()) -> dict[str, dict[str, float]]:
        """Component -> parameter -> value, paths as from `folder`; what changes nothing is left out."""
        parameters: dict[str, dict[str, float]] = {}
        for i, unknown in enumerate(self.problem.unknowns):
            if unknown.member and not unknown.recording and self.knowledge.effect[i]:
                component = self.problem.components[unknown.member]
                name = os.path.relpath(component, folder) if Path(component).is_absolute() else component
                parameters.setdefault(name, {})[unknown.variable] = self.values[i]
        return parameters

    def identified(self) -> dict[str, Any]:
        """How it was found, as plain data."""
        problem, fit, knowledge = self.problem, self.fit, self.knowledge
        return {
            "unknowns": [unknown.name for unknown in problem.unknowns],
            "units": [unknown.unit for unknown in problem.unknowns],
            "values": self.values,
            "bounds": [[unknown.low, unknown.high] for unknown in problem.unknowns],
            "covariance": [[float(value) for value in row] for row in self.covariance],
            "confidence": problem.keys.confidence,
            "method": knowledge.method,
            "intervals": [[None if np.isnan(end) else float(end) for end in pair] for pair in self.intervals],
            "remarks": [
                f"{unknown.name}: {text}"
                for unknown, own in zip(problem.unknowns, self.verdicts, strict=True)
                for text in own
            ],
            "model": problem.model,
            "residuals": [
                {
                    "column": output.label,
                    "rms": float(np.sqrt(np.mean((y - output.values) ** 2))),
                    "unit": output.unit,
                    "noise": float(s),
                }
                for output, y, s in zip(problem.outputs, self.predicted, fit.sigmas, strict=True)
            ],
            "files": [{"file": file.shown, "sha256": file.sha256} for file in problem.files],
            "command": self.command,
            "started": self.started.isoformat(timespec="seconds"),
            "interrupted": fit.interrupted,
            "versions": {**run_folder.software_versions(), "scipy": installed.version("scipy")},
        }

    def text(self, folder: Path = Path()) -> str:
        """The file as it lies in `folder`: first what a person reads."""
        lines = [f"# {self.problem.title}: {self.command}, {self.started:%Y-%m-%d}"]
        for i, unknown in enumerate(self.problem.unknowns):
            remark = f"; {'; '.join(self.verdicts[i])}" if self.verdicts[i] else ""
            lines.append(
                f"# {unknown.name}: {unknown.shown(self.values[i])}, {self.problem.keys.confidence:.4g} confidence: "
                f"{self.interval_text(i)} ({self.knowledge.method}){remark}"
            )
        own = self.parameter_set(folder)
        body = yaml.safe_dump(own, sort_keys=False, default_flow_style=None, width=110)
        about = yaml.safe_dump({KEY: self.identified()}, sort_keys=False, default_flow_style=None, width=110)
        return "\n".join(lines) + "\n" + (body if own else "") + about


def command_line(words: list[str]) -> str:
    """What was called."""
    return shlex.join(["twin", "identify", *words])


@dataclass(frozen=True)
class Estimate:
    """Identified values with their covariance, all in `units`: what a study draws from, within `bounds`."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    bounds: Array  # rows: lower and upper


def read_estimate(path: str | Path) -> Estimate:
    """Values and covariance of a file that `twin identify` wrote. ScenarioError if it is none."""
    tree: dict[str, Any] = read(Path(path), str(path)).plain()
    if KEY not in tree:
        raise ScenarioError(f"{path}: has no `{KEY}`. {nearest(KEY, tree)} Name a file that `twin identify` wrote.")
    own = tree[KEY]
    try:
        values, bounds = (np.array(own[key], np.float64) for key in ("values", "bounds"))
        matrix = np.array(own["covariance"], np.float64)
        estimate = Estimate(tuple(own["unknowns"]), tuple(own["units"]), values, matrix, bounds)
        count = len(estimate.names)
        sound = (len(estimate.units), values.shape, matrix.shape, bounds.shape) == (
            count,
            (count,),
            (count, count),
            (count, 2),
        )
    except (KeyError, TypeError, ValueError):
        sound = False
    if not sound:
        raise ScenarioError(f"{path}: `{KEY}` is damaged. Run `twin identify` again.")
    return estimate
