"""`fit_and_freeze` fits a validation file to its training data; `validate` predicts files with what is frozen."""

from __future__ import annotations

import fnmatch
import os
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import ScenarioError, SimulationError, TwinError, nearest
from twin.installed import import_optional
from twin.run import noop
from twin.scenario import Node, read
from twin.scenario import validate as validate_keys
from twin.validation import figures
from twin.validation.baselines import LAGS, fit_baseline, predict_baseline
from twin.validation.data import Data, missing_columns
from twin.validation.fitting import first_third, fit, refit, rezeroed
from twin.validation.frozen import FrozenSet, frozen_path, read_frozen
from twin.validation.model import Quantity, ValidationSet
from twin.validation.schema import FoldKeys, ValidationKeys

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from twin.arrays import Array

    Progress = Callable[[str, float], object]

VARIABLE = "TWIN_VALIDATION_DATA"  # environment variable of the data folder
NOTICEABLE = 1e-3  # part of the bounds by which a corrected parameter differs from the frozen one


@dataclass
class ValidationFile:
    """A validation file: its keys, and the folder of its data."""

    path: Path
    keys: ValidationKeys
    root: Node
    folder: Path
    build: Path

    @property
    def title(self) -> str:
        """Title."""
        return self.keys.title or f"Validation of {self.path.stem}"

    def open_set(self, name: str) -> ValidationSet:
        """The set with its component."""
        return ValidationSet(name, self.keys.sets[name], self.root, self.build)

    def names(self, patterns: Sequence[str]) -> list[str]:
        """Files in the data folder that fit patterns, relative to it."""
        matching_files = {p for pattern in patterns for p in self.folder.glob(pattern) if p.is_file()}
        return sorted((str(p.relative_to(self.folder)) for p in matching_files), key=str)

    def assigned(self, patterns: Sequence[str]) -> tuple[dict[str, list[str]], list[str]]:
        """Return the files of each set, and the files that fit no set; TwinError if there is no file.

        A file belongs to the first set that it fits, of several to the one of whose columns it lacks the fewest.
        """
        files: dict[str, list[str]] = {name: [] for name in self.keys.sets}
        every = [pattern for keys in self.keys.sets.values() for pattern in keys.files]
        names, unassigned = self.names(patterns or every), list[str]()
        for name in names:
            sets = [key for key, keys in self.keys.sets.items() if any(fnmatch.fnmatch(name, p) for p in keys.files)]
            if len(sets) > 1:
                sets.sort(key=lambda key: missing_columns(self.keys.sets[key], self.folder, name))
            (files[sets[0]] if sets else unassigned).append(name)
        if not names:
            raise TwinError(
                f"no file in {self.folder} fits {', '.join(patterns or every)}. Name the folder with --data and files "
                f"relative to it with --files."
            )
        return {name: own for name, own in files.items() if own}, unassigned

    def unassigned_error(self, name: str) -> TwinError:
        """Error of a file that fits no set."""
        every = [pattern for keys in self.keys.sets.values() for pattern in keys.files]
        return TwinError(f"{name}: fits no set's `files` in {self.path}: {', '.join(every)}. Add a pattern there.")


def load(path: Path, folder: Path | None, build: Path) -> ValidationFile:
    """Read a validation file and find its data folder; ScenarioError lists all problems."""
    problems: list[str] = []
    keys, root, more = validate_keys(read(path, str(path), problems), ValidationKeys)
    if problems + more:
        raise ScenarioError(problems + more)
    if not keys.sets:
        raise ScenarioError(
            f"{path}: `sets` is missing. Add one, such as sets: {{sines: {{files: robot/*.csv, ...}}}}."
        )
    folder = folder or (Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None)
    if folder is None:
        raise TwinError(f"no data folder is named. Use --data FOLDER or set {VARIABLE}. {keys.source}".strip())
    if not folder.is_dir():
        raise TwinError(f"there is no data folder {folder}. Correct --data or {VARIABLE}. {keys.source}".strip())
    return ValidationFile(path, keys, root, folder, build)


@dataclass
class Prediction:
    """A file as predicted: what the report draws. `rows`: entries of the result, one per quantity."""

    file: str
    set: ValidationSet
    data: Data
    predicted: Array
    rezeroed: Array
    rows: list[dict[str, Any]] = field(default_factory=list)


def validate(
    own: ValidationFile,
    patterns: Sequence[str] = (),
    window: int | None = None,
    progress: Progress = noop,
    refused: dict[str, str] | None = None,
) -> list[Prediction]:
    """Predict files with frozen parameters; nothing is fitted, except `rezero` with the first third of each run.

    `refused` receives the error of each file that cannot be predicted, by its name; without it, the first one is raised.
    """
    frozen = read_frozen(own.path)
    files, unassigned = own.assigned(patterns)
    errors: dict[str, TwinError | OSError] = {name: own.unassigned_error(name) for name in unassigned}
    missing = [name for name in files if name not in frozen]
    if missing:
        raise TwinError(
            f"{frozen_path(own.path)}: has no set {missing[0]}. {nearest(missing[0], frozen)} Fit it: twin validate "
            f"{own.path} --fit."
        )
    predictions: list[Prediction] = []
    count = sum(len(names) for names in files.values())
    for name, names in files.items():
        current = own.open_set(name)
        reader = current.reader(window, changes=frozen[name].changes)
        for file in names:
            progress(file, len(predictions) / count)
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # a baseline may diverge
                    predictions.append(predict_file(current, frozen[name], reader.read(own.folder, [file])))
            except SimulationError as error:
                errors[file] = SimulationError(f"{file}: {error}. Check the measured inputs.")
            except (TwinError, OSError) as error:
                errors[file] = error
    for file, refusal in errors.items():
        if refused is None:
            raise refusal
        refused[file] = str(refusal)
    return predictions


def predict_file(own: ValidationSet, frozen: FrozenSet, data: Data) -> Prediction:
    """Predict one file with the frozen parameters, and compare."""
    values = frozen.values
    predicted = own.predict(data, values)
    corrected, corrections = rezeroed(own, data, values)
    baselines = {name: predict_baseline(name, entry, data) for name, entry in frozen.baselines.items()}
    result = Prediction(data.files[0], own, data, predicted, corrected)
    last = ~first_third(data)
    for quantity in own.quantities:
        error = quantity.error(predicted, data.measured)
        failures = disagreements(own, frozen, quantity, data, predicted)
        row: dict[str, Any] = {"file": data.files[0], "quantity": quantity.name, "unit": quantity.unit}
        row |= figures.summary(error)
        half = frozen.band.get(quantity.name, {}).get("half_width")
        row["coverage"] = None if half is None else float(np.mean(np.abs(error) <= half))
        row["consistent"] = None if quantity.name not in frozen.limits else not failures
        row["rezeroed_rmse"] = figures.summary(quantity.error(corrected, data.measured)[last])["rmse"]
        if not np.isfinite([row["rmse"], row["rezeroed_rmse"]]).all():
            raise SimulationError("an error is not finite")
        row["baselines"] = {
            name: finite(figures.summary(quantity.error(y, data.measured))["rmse"]) for name, y in baselines.items()
        }
        areas = [
            figures.area(y, measured)
            for y, measured in zip(quantity.shown(predicted).T, quantity.shown(data.measured).T, strict=True)
        ]
        row["area"] = float(np.linalg.norm(areas))
        row["set"] = own.name
        row["band"] = half
        row["disagreements"] = [asdict(failure) for failure in failures]
        row["rezeroed"] = {
            key: {"frozen": values.get(key, own.start(key)), "corrected": number, "unit": own.units[key]}
            for key, number in corrections.items()
        }
        row["remarks"] = remarks(row, own, frozen, data)
        result.rows.append(row)
    return result


def finite(number: float) -> float | None:
    """The number, or None if a baseline has diverged, for JSON."""
    return number if np.isfinite(number) else None


def remarks(row: dict[str, Any], own: ValidationSet, frozen: FrozenSet, data: Data) -> list[str]:
    """Sentences on a run that does not agree with the model, joined windows, longer roll-outs, and a changed model."""
    longest = int(np.bincount(data.window_index).max())
    texts = [
        f"this run does not agree with the model from t = {failure['time']:.4g} s on: {failure['column']} is off by about "
        f"{failure['offset']:.3g} {row['unit']} (limit {failure['limit']:.3g} {row['unit']})."
        for failure in row["disagreements"]
    ]
    third = data.time[first_third(data)][-1]
    if any(failure["time"] <= third for failure in row["disagreements"]):
        for name, entry in row["rezeroed"].items():
            unknown = next(unknown for unknown in own.unknowns("rezero") if unknown.name == name)
            if abs(entry["corrected"] - entry["frozen"]) > NOTICEABLE * (unknown.high - unknown.low):
                texts.append(
                    f"the first third of the run suggests {name} = {unknown.shown(entry['corrected'])} instead of "
                    f"{unknown.shown(entry['frozen'])}."
                )
    if data.jumps:
        texts.append(
            f"the measurements jump in {data.jumps} places, where windows of the file join: roll-outs begin anew there."
        )
    if own.keys.train_window and longest > own.keys.train_window:
        texts.append(
            f"roll-outs of {longest} rows are longer than the {own.keys.train_window} of the fit: band and limit of the "
            "consistency test come from shorter ones and may be too narrow."
        )
    if frozen.source_sha256 != own.source_hash:
        texts.append(f"the source of {own.keys.component} has changed since the fit; fit again or restore it.")
    return texts


def disagreements(
    own: ValidationSet, frozen: FrozenSet, quantity: Quantity, data: Data, predicted: Array
) -> list[figures.Disagreement]:
    """Where the outputs of a quantity leave the limits of the consistency test."""
    failures, limits = [], frozen.limits.get(quantity.name, {})
    for i, error in zip(quantity.indices, quantity.difference(predicted, data.measured).T, strict=True):
        if (column := own.outputs[i]) in limits:
            levels = [figures.Limits(**entry) for entry in limits[column]]
            failure = figures.disagreement(column, error, data.time, levels)
            failures += [failure] if failure else []
    return failures


def fold_labels(own: ValidationSet, data: Data) -> tuple[list[str], Array]:
    """Names of the folds and the fold of each sample; TwinError if nothing can be left out, or a fold has no sample."""
    labels, index = divide_samples(own.keys.folds, data)
    if len(labels) < 2:
        raise TwinError(
            f"set {own.name}: cross-validation needs two folds, and there is only {labels[0]}. Add training files, or "
            "divide them: folds: {by: block}."
        )
    counts = np.bincount(index, minlength=len(labels))
    if not counts.all():
        raise TwinError(f"set {own.name}: {labels[int(np.argmin(counts))]} has no samples. Reduce folds.count.")
    return labels, index


def divide_samples(keys: FoldKeys, data: Data) -> tuple[list[str], Array]:
    """Names of the folds and the fold of each sample, as the keys say; a fold may have no samples."""
    if keys.by == "file":
        return list(data.files), data.file_index
    if keys.by == "column":
        if len(data.labels) != len(data.time):
            raise TwinError(f"{', '.join(data.files)}: have no complete column {keys.column!r}, which `folds` names.")
        values, index = np.unique(data.labels, return_inverse=True)
        if not keys.count:
            return [str(value) for value in values], index
        return [f"fold {i + 1}" for i in range(min(keys.count, len(values)))], index % keys.count
    count = keys.count or 5
    index = np.concatenate([np.arange(n) * count // n for n in np.bincount(data.file_index)])
    return [f"block {i + 1}" for i in range(count)], index


def fit_and_freeze(
    own: ValidationFile, only: Sequence[str] = (), *, starts: int = 8, seed: int = 0, progress: Progress = noop
) -> dict[str, FrozenSet]:
    """Fit the sets (`only` some of them) to their training files, cross-validate, and return all frozen sets."""
    unknown = [name for name in only if name not in own.keys.sets]
    if unknown:
        raise TwinError(f"{own.path}: there is no set {unknown[0]}. {nearest(unknown[0], own.keys.sets)}")
    frozen = read_frozen(own.path) if only and frozen_path(own.path).is_file() else {}
    for name in only or own.keys.sets:
        frozen[name] = fit_set(own, name, starts, seed, progress)
    return {name: frozen[name] for name in own.keys.sets if name in frozen}


def fit_set(own: ValidationFile, name: str, starts: int, seed: int, progress: Progress) -> FrozenSet:
    """Fit one set to all of its training data, and to all but each fold for its cross-validated figures."""
    begin = time.perf_counter()
    current = own.open_set(name)
    for baseline in LAGS.keys() & current.keys.baselines:  # before the fit, which takes long
        import_optional("sklearn", "learn", f"baseline {baseline}")
    patterns = current.keys.train or current.keys.files
    names = own.names(patterns)
    if not names:
        raise TwinError(f"set {name}: no training file in {own.folder} fits {', '.join(patterns)}. Correct --data.")
    data = current.reader(training=True).read(own.folder, names)
    fold_labels(current, data)  # refuses data that cannot be divided before the fit, which takes long
    every = np.ones(len(data.time), bool)
    frozen = FrozenSet(source_sha256=current.source_hash, files=dict(zip(data.files, data.hashes, strict=True)))
    frozen.parameters = fit(
        current,
        data,
        every,
        starts=starts,
        seed=seed,
        progress=lambda what, part, best: progress(f"{name}: {what} {best}", 0.5 * part),
    )
    for number, baseline in enumerate(current.keys.baselines):
        progress(f"{name}: baseline {baseline}", 0.5 + 0.1 * number / len(current.keys.baselines))
        frozen.baselines[baseline] = fit_baseline(baseline, data, every)
    frozen.changes = dict(data.changes) if current.keys.train_window else {}
    predicted = current.predict(data, frozen.values)
    frozen.training = rows_by(current, data, predicted, data.files, data.file_index)
    cross_validate(current, data, frozen.values, frozen, own.keys, progress)
    frozen.seconds = round(time.perf_counter() - begin, 1)
    return frozen


def rows_by(
    own: ValidationSet, data: Data, predicted: Array, labels: Sequence[str], index: Array
) -> list[dict[str, Any]]:
    """Errors of each quantity in each part of the data."""
    return [
        {"fold": label, "quantity": q.name, "unit": q.unit}
        | figures.summary(q.error(predicted, data.measured)[index == number])
        for q in own.quantities
        for number, label in enumerate(labels)
    ]


def predict_folds(
    own: ValidationSet, data: Data, values: dict[str, float], baselines: Sequence[str] = (), progress: Progress = noop
) -> tuple[Array, dict[str, Array]]:
    """Predict each fold with a fit to all others, which begins at `values`; also with baselines, shape (N, outputs)."""
    labels, index = fold_labels(own, data)
    predicted = np.zeros_like(data.measured)
    by_baseline = {name: np.zeros_like(data.measured) for name in baselines}
    for number, label in enumerate(labels):
        progress(f"{own.name}: cross-validation without {label}", 0.6 + 0.4 * number / len(labels))
        left_out = index == number
        predicted[left_out] = own.predict(data, refit(own, data, ~left_out, values))[left_out]
        for name, y in by_baseline.items():
            y[left_out] = predict_baseline(name, fit_baseline(name, data, ~left_out), data)[left_out]
    return predicted, by_baseline


def cross_validate(
    own: ValidationSet,
    data: Data,
    values: dict[str, float],
    frozen: FrozenSet,
    keys: ValidationKeys,
    progress: Progress,
) -> None:
    """Predict each fold with a fit to all others; add figures, bands and limits of the consistency test to `frozen`."""
    labels, index = fold_labels(own, data)
    predicted, baselines = predict_folds(own, data, values, list(frozen.baselines), progress)
    frozen.cross_validation = rows_by(own, data, predicted, labels, index)
    for name, y in baselines.items():
        for row, baseline_row in zip(frozen.cross_validation, rows_by(own, data, y, labels, index), strict=True):
            row.setdefault("baselines", {})[name] = baseline_row["rmse"]
    folds = [index == number for number in range(len(labels))]
    for q in own.quantities:
        error = np.abs(q.error(predicted, data.measured))
        own_band = figures.band([error[fold] for fold in folds], keys.band)
        frozen.band[q.name] = asdict(own_band)
        for row in frozen.cross_validation:
            if row["quantity"] == q.name and own_band.coverages:
                row["coverage"] = own_band.coverages[labels.index(row["fold"])]
        signed = q.difference(predicted, data.measured)
        frozen.false_alarms[q.name] = figures.false_alarms([signed[fold] for fold in folds], keys.false_alarms)
        own_limits = figures.limits([signed[fold] for fold in folds], keys.false_alarms)
        for i, levels in zip(q.indices, own_limits, strict=True):
            if levels:
                frozen.limits.setdefault(q.name, {})[own.outputs[i]] = [asdict(level) for level in levels]
