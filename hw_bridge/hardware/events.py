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
    """Convert the faults of a variant for this bench; return them, and the problems of the others."""
    planned_faults, problems = [], []
    for fault in faults:
        try:
            fault_keys = FaultKeys.model_validate(fault.tree.plain())
        except ValidationError as error:
            problems += [line(fault.tree, error_item, FaultKeys) for error_item in error.errors(include_url=False)]
            continue
        if text := fault_problem(fault_keys, keys):
            problems.append(f"{fault.where}: {text}")
        planned_faults.append(fault_keys)
    return planned_faults, problems
