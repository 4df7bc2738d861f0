"""Faults among the events of a scenario: the same keys and checks as those of a hardware file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import ValidationError

from hw_bridge.hardware.file import fault_problem, line
from hw_bridge.hardware.keys import FaultKeys

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hw_bridge.hardware.keys import HardwareKeys
    from twin.scenario import FaultSpec


def planned(faults: Sequence[FaultSpec], keys: HardwareKeys) -> tuple[list[FaultKeys], list[str]]:
    """The faults of a variant as this bench can do them, and what is wrong with the others."""
    found, problems = [], []
    for fault in faults:
        try:
            one = FaultKeys.model_validate(fault.tree.plain())
        except ValidationError as error:
            problems += [line(fault.tree, each, FaultKeys) for each in error.errors(include_url=False)]
            continue
        if text := fault_problem(one, keys):
            problems.append(f"{fault.where}: {text}")
        found.append(one)
    return found, problems
