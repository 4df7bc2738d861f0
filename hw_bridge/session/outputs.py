"""Digital outputs of drives: Boolean signals of the scenario on bits of 60FEh.1, such as valves of grippers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.component import Boolean, Variable
from twin.component import input as input_variable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.component import Component


def connector(bit: int) -> str:
    """Name of the input that a bit gives the member."""
    return f"output_{bit}"


def inputs(bits: Mapping[int, str]) -> dict[str, Variable]:
    """Boolean inputs of a member, one for each output bit."""
    return {connector(bit): input_variable("", f"bit {bit} of 60FEh.1", start=False, type=Boolean) for bit in bits}


def levels(bits: Mapping[int, str], rest: int, member: Component) -> int:
    """60FEh.1 from the signals; bits without a signal are those of `rest`."""
    word = rest
    for bit in bits:
        word = word & ~(1 << bit) | bool(member.views[connector(bit)]) << bit
    return word
