"""Changes of the rig, named: a bank of changed models beside the followed one, over the same measurements.

Each change, and each of its amounts, is a copy of the model that starts at the estimate, with changed parameters or with an
offset of a measured signal. It is corrected with the gain of the filter. The likelihoods of the innovations, forgotten with
a time constant, and the rates of the changes give probabilities (Bayes' rule) of: no change, each change, and none of these. The
latter is a model that would explain the measurements with a normalized innovation squared of `UNKNOWN_NIS` for each
measured value: a listed change is named only if it explains them better than that. The time of onset is that of the lowest
point of the cumulated log-likelihood ratio (Page, Biometrika 41, 1954; Willsky and Jones, IEEE Trans. Autom. Control 21, 1976).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from twin.follow.filters import Ensemble, SquareRootFilter, Update, substitute

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.arrays import Array
    from twin.follow.batch import Batch

NO_CHANGE, UNKNOWN = "no change", "none of these"
UNKNOWN_NIS = 1.5  # of an unknown model, for each measured value
MEMORY = 4.0  # time constant with which likelihoods are forgotten [s]
RESTART = 0.25  # interval at which changed models start again at the estimate, unless they explain best; longer, and they drift away [s]
RETRY = 3.0  # the same while a change is likely [s]
DEFICIT = 20.0  # largest log-likelihood that a model lacks to the best of no change and an unknown one, for what it missed before it fits
CEILING = 100.0  # largest log-likelihood ratio: what is sure need not become surer
HANDICAP = 6.0  # log-likelihood that models lack when they start again while the unknown one is likely
PLAUSIBLE = 3.0  # largest normalized innovation by which a changed model is corrected: it explains no larger one
SETTLE = 3.0  # time after the start in which no changes are named: the estimate is found first [s]
SURE = 0.95  # probability at which a change is named
CONFIRM, CONFIRM_UNKNOWN = 1.0, 7.0  # how long it must have it [s]


@dataclass(frozen=True)
class Amount:
    """How much a change changes: parameters become factor * value + difference; offsets of measured signals, by their number."""

    parameters: Mapping[str, tuple[float, float]]
    offsets: Mapping[int, float]


@dataclass(frozen=True)
class Change:
    """A change to look for. `rate`: how often it happens [1/s]; `amounts`: a model each."""

    name: str
    rate: float
    amounts: tuple[Amount, ...]


@dataclass(frozen=True)
class Alarm:
    """A change that was noticed at `time`, with its probability and its time of onset [s]. `name`: that of the change, or `UNKNOWN`."""

    name: str
    time: float
    onset: float
    probability: float


@dataclass
class ChangeBank:
    """Changed copies of a model, the last ones of a batch. `probabilities`: of `names`, which begin with no change and none of these."""

    changes: Sequence[Change]
    filter: SquareRootFilter | Ensemble
    measured: int  # signals
    alarms: list[Alarm] = field(default_factory=list)

    def __post_init__(self) -> None:
        amounts = [amount for change in self.changes for amount in change.amounts]
        self.owners = np.array([i for i, change in enumerate(self.changes) for _ in change.amounts])
        self.names = (NO_CHANGE, UNKNOWN, *(change.name for change in self.changes))
        self.parameters = list(dict.fromkeys(name for amount in amounts for name in amount.parameters))
        self.count, n = len(amounts), len(self.filter.mean)
        self._factors = np.ones((self.count, len(self.parameters)))
        self._differences = np.zeros_like(self._factors)
        self._offsets = np.zeros((self.count, self.measured))
        for k, amount in enumerate(amounts):
            for name, (factor, difference) in amount.parameters.items():
                i = self.parameters.index(name)
                self._factors[k, i], self._differences[k, i] = factor, difference
            for number, offset in amount.offsets.items():
                self._offsets[k, number] = offset
        rates = np.array([change.rate / len(change.amounts) for change in self.changes])[self.owners]
        mean_rate = float(np.mean([change.rate for change in self.changes]))
        # A change happens within the time that is remembered; the first one is the unknown change.
        self._prior = np.log(MEMORY * np.concatenate([[mean_rate], rates]))
        self.points = np.zeros((self.count, n))
        self.offset = np.zeros(self.measured)  # of measured signals, by changes that were named before
        self._ratios = np.zeros(self.count + 1)  # forgetting log-likelihood ratios; the first: of the unknown model
        self._cumulated, self._lowest = np.zeros(self.count + 1), np.zeros(self.count + 1)
        self._onsets = np.zeros(self.count + 1)
        self._restart = self._time = -np.inf
        self._begin: float | None = None
        self._best, self._since, self._reported, self._named = NO_CHANGE, -np.inf, "", -1
        self._starting = np.ones(self.count, bool)
        self.probabilities = self._posterior()

    def write(self, batch: Batch, points: Array, sharing: int) -> None:
        """Write the filter's `points` and those of the models; models that are due start at the estimate."""
        numbers, first = np.flatnonzero(self._starting), len(points)
        for number in numbers.tolist():
            batch.copy_memory(range(first + number, first + number + 1))
        self.points[numbers] = self.filter.mean
        batch.write(np.vstack([points, self.points]), sharing=sharing)
        if len(numbers):
            values = batch.get_parameters()
            values[first + numbers] = self._factors[numbers] * values[first + numbers] + self._differences[numbers]
            batch.set_parameters(values)
        self._starting[:] = False

    def adopt(self, batch: Batch) -> bool:
        """Continue with the changed model, if a change has been named since the last call; return whether one has."""
        if self._named < 0:
            return False
        number, first = self._named, batch.count - self.count
        if isinstance(self.filter, Ensemble):
            values = batch.get_parameters()
            values[:first] = self._factors[number] * values[:first] + self._differences[number]
            batch.set_parameters(values)
        else:
            batch.copy_memory(range(1), first + number)
            self.filter.mean = self.points[number].copy()
        self.offset += self._offsets[number]
        self._ratios[:] = self._cumulated[:] = self._lowest[:] = 0.0
        self._starting[:], self._named = True, -1
        return True

    def update(
        self, time: float, points: Array, outputs: Array, numbers: Sequence[int], measured: Array, update: Update
    ) -> Alarm | None:
        """Correct the models at `points` (H, n) with `outputs` (H, m), and renew the probabilities; return a change that is noticed now."""
        innovations = measured - outputs - self._offsets[:, numbers]
        normalized = substitute(update.root, innovations.T)
        plausible = np.clip(normalized, -PLAUSIBLE, PLAUSIBLE)
        self.points = np.clip(points + (update.gain @ plausible).T, self.filter.low, self.filter.high)
        nis = np.concatenate([[UNKNOWN_NIS * len(measured)], (normalized**2).sum(axis=0)])
        ratios = 0.5 * (update.nis - nis)
        interval = max(time - self._time, 0.0) if np.isfinite(self._time) else 0.0
        if self._begin is None:
            self._begin = time
        self._time = time
        self._ratios = np.exp(-interval / MEMORY) * self._ratios + ratios
        self._ratios -= max(self._ratios.max() - CEILING, 0.0)
        self._ratios = np.maximum(self._ratios, max(self._ratios[0], 0.0) - DEFICIT)
        if time < self._begin + SETTLE:
            self._ratios[:] = 0.0
        self._cumulated += ratios
        lower = self._cumulated < self._lowest
        self._lowest[lower], self._onsets[lower] = self._cumulated[lower], time
        self.probabilities = self._posterior()
        alarm = self._decide(time)
        if time >= self._restart + (RESTART if self.probabilities[0] > 0.5 else RETRY):
            self._plan_restart(time)
        return alarm

    def _posterior(self) -> Array:
        """Return the probabilities of `names`."""
        weights = np.concatenate([[0.0], self._prior + self._ratios])
        weights = np.exp(weights - weights.max())
        weights /= weights.sum()
        result = np.zeros(len(self.names))
        np.add.at(result, np.concatenate([[0, 1], 2 + self.owners]), weights)
        return result

    def _decide(self, time: float) -> Alarm | None:
        """Return an alarm if a change has been sure for long enough."""
        best = int(np.argmax(self.probabilities))
        name = self.names[best] if self.probabilities[best] > SURE else ""
        if name != self._best:
            self._best, self._since = name, time
        needed = CONFIRM_UNKNOWN if name == UNKNOWN else CONFIRM
        if name == NO_CHANGE:
            self._reported = ""
        if name in ("", NO_CHANGE, self._reported) or time - self._since < needed:
            return None
        models = np.flatnonzero(np.concatenate([[-1], self.owners]) == best - 2) if best > 1 else np.array([0])
        model = int(models[np.argmax(self._ratios[models])])
        onset = self._onsets[[0, model]].min()  # the model may have begun anew after the innovations ceased to fit
        self.alarms.append(Alarm(name, time, float(onset), float(self.probabilities[best])))
        self._reported, self._named = (UNKNOWN, -1) if name == UNKNOWN else ("", model - 1)
        return self.alarms[-1]

    def _plan_restart(self, time: float) -> None:
        """Start all models again at the estimate, except those that explain the measurements best."""
        self._restart = time
        unknown = self._ratios[0]
        leading = (self._ratios[1:] > 0.0) & (self._ratios[1:] >= unknown)
        self._starting = ~leading
        again = np.concatenate([[False], self._starting])
        # Models that start again are together somewhat less likely than the unknown one until they have explained something.
        equal = unknown + self._prior[0] - self._prior[again] - np.log(self.count) - HANDICAP
        self._ratios[again] = np.maximum(equal, 0.0)
        self._cumulated[again], self._lowest[again], self._onsets[again] = 0.0, 0.0, time
