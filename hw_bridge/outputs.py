"""Digital outputs of drives: Boolean signals of the scenario on bits of 60FEh.1, such as valves of grippers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.component import Boolean, Variable
from twin.component import input as input_variable
from twin.coupling import READABLE, find
from twin.errors import CouplingError
from twin.scenario import members as forms
from twin.scenario import reference, short

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.component import Component
    from twin.scenario import MemberSpec

OUTPUTS, LEVELS, MASK = 0x60FE, 1, 2
WORD = 0x60FE0120  # of the mapping
BITS = 32


def output_bits(value: Any) -> dict[int, str]:
    """`{0: "sequencer.valve[1]"}`: a bit of 60FEh.1 and the signal that it follows."""
    if not isinstance(value, dict):
        raise ValueError(f"expected bits such as {{0: 'sequencer.valve[1]'}}, not {short(value)}")  # noqa: TRY004
    found = {}
    for key, signal in value.items():
        text = str(key)
        if not (text.isdecimal() and int(text) < BITS):
            raise ValueError(f"expected a bit from 0 to {BITS - 1}, not {short(key)}")
        found[int(text)] = reference(signal)
    return found


def connector(bit: int) -> str:
    """Name of the input that a bit gives the member."""
    return f"output_{bit}"


def inputs(bits: Mapping[int, str]) -> dict[str, Variable]:
    """What a member gets so that its drive can switch."""
    return {connector(bit): input_variable("", f"bit {bit} of 60FEh.1", start=False, type=Boolean) for bit in bits}


def levels(bits: Mapping[int, str], rest: int, member: Component) -> int:
    """60FEh.1 as the signals want it; bits that none of them has are those of `rest`."""
    word = rest
    for bit in bits:
        word = word & ~(1 << bit) | bool(member.views[connector(bit)]) << bit
    return word


def problems(where: str, bits: Mapping[int, str], members: Mapping[str, MemberSpec]) -> list[str]:
    """Signals that cannot switch an output. An FMU's are looked at with the other connections."""
    catalog = {
        name: forms.variables(spec.made or spec.component)
        for name, spec in members.items()
        if not spec.component.endswith(".fmu")
    }
    found = []
    for bit, signal in bits.items():
        member = signal.partition(".")[0]
        if member in members and member not in catalog:
            continue
        try:
            source = find(signal, catalog)
        except CouplingError as error:
            found.append(f"{where}.{bit}: {error}")
            continue
        kind, name = source.variable.type, source.variable.causality
        if name not in READABLE:
            found.append(f"{where}.{bit}: {signal} is an {name}. Name an output.")
        elif kind != Boolean or source.size != 1:
            what = kind if source.size == 1 else f"{source.size} values"
            found.append(f"{where}.{bit}: {signal} is {what}, an output needs one Boolean. Name another or an element.")
    return found
