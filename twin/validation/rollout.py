"""Roll-outs of a component over many windows of measured inputs, in one native call.

A window starts from its own initial state and sees measured inputs only. The input of a step is the one at its end, so
that a static component has no lag: row k of the outputs belongs to row k of the inputs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin import compiler
from twin.arrays import Array
from twin.compiler import call_step, read64, read_float, write_float
from twin.coupling import RecordMember, find
from twin.errors import CouplingError, SimulationError, TwinError
from twin.scenario import Backend, MemberSpec, make, members

MEMBER = "model"  # name of the only member

RECORD = np.dtype(
    [
        (name, np.int64)
        for name in (
            "function",
            "signature",
            "windows",  # table: address of the component's record, rows
            "window_count",
            "inputs",  # values, row by row
            "input_offsets",  # table: offset in the component's record [byte]
            "input_count",
            "outputs",
            "output_offsets",
            "output_count",
            "flags",  # 32 bytes that the step function may write
            "failed_row",  # -1: none
        )
    ]
    + [("h", np.float64)],
    align=True,
)


def run(self: Any) -> int:
    """Step through all windows; the records are initialized, row 0 of each window only writes its outputs."""
    source, target, row_number = self.inputs, self.outputs, 0
    for w in range(self.window_count):
        instance = read64(self.windows + 16 * w)
        for k in range(read64(self.windows + 16 * w + 8)):
            if k > 0:
                for i in range(self.input_count):
                    write_float(instance + read64(self.input_offsets + 8 * i), read_float(source + 8 * i))
                t = (k - 1) * self.h
                if call_step(self.function, self.signature, instance, t, self.h, self.flags) > 1:
                    self.failed_row = row_number
                    return 1
            for j in range(self.output_count):
                write_float(target + 8 * j, read_float(instance + read64(self.output_offsets + 8 * j)))
            source += 8 * self.input_count
            target += 8 * self.output_count
            row_number += 1
    return 0


class RollOut:
    """A component that is driven by measured inputs with communication step `step` [s].

    `inputs` and `outputs`: names of its variables or elements (`tendon[2]`). TwinError if a name is not known, or the
    component has a sample period other than the step.
    """

    def __init__(
        self,
        component: str,
        parameters: Mapping[str, Any],
        step: float,
        inputs: Sequence[str],
        outputs: Sequence[str],
        build: Path,
    ) -> None:
        spec = MemberSpec(component, dict(parameters), period_ns=round(step * 1e9))
        source = members.component_of(spec)
        self.variables = members.variables(source)
        values, problems = spec.values(MEMBER, self.variables)
        if problems:
            raise TwinError([text.removeprefix(": ") for text in problems])
        member = make(MEMBER, source, values, Backend.compiled, build)
        if not isinstance(member, RecordMember) or member.code is None:
            raise TwinError(f"{component}: only components with source in Python can be validated. Name one of those.")
        if member.period_ns and member.period_ns != round(step * 1e9):
            raise TwinError(f"{component}: its period is {member.period_ns / 1e9:g} s. Set step to it.")
        self.member, self.step = member, step
        self._start = member.save()
        self._inputs = [self.offset(name) for name in inputs]
        self._outputs = [self.offset(name) for name in outputs]
        head = "Roll-outs over windows of measured inputs."
        self._run = compiler.load_record_function(RECORD, "rollout", run, head, build)

    def variable(self, name: str) -> Any:
        """Variable of the component; TwinError with a suggestion if there is none, or it is no single real number."""
        reference = find(f"{MEMBER}.{name}", {MEMBER: self.variables})
        if reference.variable.type != "Float64" or reference.size != 1:
            raise CouplingError(f"{name} is no single real number. Name one, or an element such as {name}[1].")
        return reference.variable

    def offset(self, name: str) -> int:
        """Offset of a variable or element in the component's record [byte]."""
        variable = self.variable(name)
        first = find(f"{MEMBER}.{name}", {MEMBER: self.variables}).first
        return int(self.member.address(variable.name)) - self.member.instance + 8 * first

    def start(self, name: str) -> float:
        """Start value of a variable or element."""
        offset = self.offset(name)
        return float(self._start.reshape(-1).view(np.uint8)[offset : offset + 8].view(np.float64)[0])

    def initialized(self, count: int, values: Mapping[str, Array | float], first_inputs: Array) -> Array:
        """Records of `count` windows after initialization, one per row.

        `values`: start values by variable, one number or one per window. `first_inputs`: shape (windows, inputs).
        """
        size = self._start.nbytes
        raw = np.tile(self._start.reshape(-1).view(np.uint8)[:size], (count, 1))
        words = raw.view(np.float64)
        for name, value in values.items():
            words[:, self.offset(name) // 8] = value
        for column, offset in enumerate(self._inputs):
            words[:, offset // 8] = first_inputs[:, column]
        member = self.member
        for row in raw:
            member.restore(row.view(self._start.dtype).reshape(self._start.shape))
            member.enter_initialization(0.0, None)
            member.exit_initialization()
            row[:] = member.save().reshape(-1).view(np.uint8)
        return raw

    def __call__(self, inputs: Sequence[Array], values: Mapping[str, Array | float]) -> Array:
        """Outputs of all windows, one below the other, shape (rows, outputs).

        `inputs`: per window an array of shape (rows, inputs). SimulationError if a step fails or a value is not finite.
        """
        rows = np.ascontiguousarray(np.concatenate(inputs))
        records = self.initialized(len(inputs), values, np.stack([window[0] for window in inputs]))
        windows = np.array(
            [(records.ctypes.data + k * records.shape[1], len(window)) for k, window in enumerate(inputs)], np.int64
        )
        outputs = np.zeros((len(rows), len(self._outputs)))
        offsets = [np.array(own or [0], np.int64) for own in (self._inputs, self._outputs)]
        flags = np.zeros(32, np.uint8)
        record = np.zeros((), RECORD)
        for name, number in {
            "function": self.member.step_function,
            "signature": self.member.step_signature,
            "windows": windows.ctypes.data,
            "window_count": len(inputs),
            "inputs": rows.ctypes.data,
            "input_offsets": offsets[0].ctypes.data,
            "input_count": len(self._inputs),
            "outputs": outputs.ctypes.data,
            "output_offsets": offsets[1].ctypes.data,
            "output_count": len(self._outputs),
            "flags": flags.ctypes.data,
            "h": self.step,
        }.items():
            record[name] = number
        if self._run(record.ctypes.data):
            raise SimulationError(f"the component fails in row {int(record['failed_row']) + 1}")
        if not np.isfinite(outputs).all():
            raise SimulationError("an output is not finite")
        return outputs
