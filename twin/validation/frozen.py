"""Frozen parameters of a validation file: `NAME.parameters.yaml`, written by a fit and only read afterwards."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import yaml

from twin.errors import ScenarioError, TwinError
from twin.scenario import read
from twin.validation.figures import Limits


@dataclass
class FrozenSet:
    """What a fit found for a set; `parameters`: name -> value, unit, interval (95 %), in the variables' units.

    `band`: quantity -> half width and coverages; `limits`: quantity -> column -> limits of the consistency test by
    length of the run; `cross_validation`: one entry per fold and quantity; `false_alarms`: quantity ->
    parts of left-out folds beyond limits from the others, by rows of a part; `files`: name -> SHA-256;
    `changes`: column -> largest change between rows of a training window, in the variable's unit.
    """

    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    baselines: dict[str, dict[str, Any]] = field(default_factory=dict)
    band: dict[str, dict[str, Any]] = field(default_factory=dict)
    limits: dict[str, dict[str, list[dict[str, Any]]]] = field(default_factory=dict)
    cross_validation: list[dict[str, Any]] = field(default_factory=list)
    false_alarms: dict[str, list[dict[str, int]]] = field(default_factory=dict)
    changes: dict[str, float] = field(default_factory=dict)
    training: list[dict[str, Any]] = field(default_factory=list)
    source_sha256: str = ""
    files: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""
        return {name: float(entry["value"]) for name, entry in self.parameters.items()}


def frozen_path(path: Path) -> Path:
    """Path of the frozen parameters of a validation file."""
    return path.with_suffix(".parameters.yaml")


def read_frozen(path: Path) -> dict[str, FrozenSet]:
    """Read the frozen sets of a validation file by name; TwinError if there are none."""
    target = frozen_path(path)
    if not target.is_file():
        raise TwinError(f"{target}: is missing. Fit first: twin validate {path} --data FOLDER --fit.")
    sets: dict[str, Any] = read(target, str(target)).plain()
    try:
        frozen = {name: FrozenSet(**entry) for name, entry in sets.items()}
        for current in frozen.values():
            _ = [Limits(**entry) for columns in current.limits.values() for each in columns.values() for entry in each]
    except TypeError as error:
        raise ScenarioError(f"{target}: is damaged ({error}). Fit again: twin validate {path} --fit.") from None
    return frozen


def frozen_text(title: str, sets: dict[str, FrozenSet]) -> str:
    """Text of the file: first what a person reads."""
    lines = [f"# {title}: frozen by `twin validate --fit`; do not edit."]
    for name, frozen in sets.items():
        for parameter, entry in frozen.parameters.items():
            low, high = entry["interval"]
            lines.append(
                f"# {name}: {parameter} = {entry['value']:.6g} {entry['unit']}, 95 % interval {low:.4g} to {high:.4g}"
            )
        lines += [
            f"# {name}: cross-validated {row['quantity']}, {row['fold']}: {row['rmse']:.4g} {row['unit']}"
            for row in frozen.cross_validation
        ]
    body = yaml.safe_dump(
        {name: asdict(frozen) for name, frozen in sets.items()}, sort_keys=False, width=110, default_flow_style=None
    )
    return "\n".join(lines) + "\n" + body
