"""Packages that only studies need: the extra `study`, and `cluster` for a scheduler."""

from __future__ import annotations

import importlib
from typing import Any

from twin.errors import TwinError

EXTRAS = {"distributed": "cluster"}  # where it is not `study`


def wanted(module: str, what: str) -> Any:
    """A module of the extra. TwinError where it is not installed."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or module.partition(".")[0] != error.name.partition(".")[0]:
            raise
        raise TwinError(
            f"{what} needs {error.name}, which is not installed. Run: pip install 'catheter-twin[{EXTRAS.get(module, 'study')}]'"
        ) from None
