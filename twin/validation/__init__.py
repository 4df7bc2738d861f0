"""Validation: predictions of measured data with frozen parameters, fits and cross-validation, bands, baselines."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.validation.frozen import FrozenSet, frozen_path, frozen_text, read_frozen
    from twin.validation.page import html
    from twin.validation.runner import Prediction, ValidationFile, fit_and_freeze, load, validate

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "frozen": ["FrozenSet", "frozen_path", "frozen_text", "read_frozen"],
        "page": ["html"],
        "runner": ["Prediction", "ValidationFile", "fit_and_freeze", "load", "validate"],
    },
)

__all__ = [
    "FrozenSet",
    "Prediction",
    "ValidationFile",
    "fit_and_freeze",
    "frozen_path",
    "frozen_text",
    "html",
    "load",
    "read_frozen",
    "validate",
]
