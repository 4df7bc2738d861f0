"""numba's side of `compiled`: imported only when something has to be compiled."""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import ir
from numba import carray, cfunc, types
from numba.core import errors
from numba.extending import intrinsic

from twin import machine
from twin.errors import BuildError

I64, I32, I16, I8 = (ir.IntType(bits) for bits in (64, 32, 16, 8))
F64, F32 = ir.DoubleType(), ir.FloatType()

NUMBA_TYPES = {"f8": types.float64, "i8": types.int64}


def jit(function: Any) -> Any:
    """A function that compiled code may call. error_model numpy: 1/0.0 is inf as it is in a record's scalars.

    Without the wrappers by which Python and C would call it: nobody does, and they cost a quarter of the time.
    """
    return numba.njit(function, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


def _reader(storage: ir.Type, result: Any) -> Any:
    @intrinsic
    def read(typing_context, address):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            value = builder.load(builder.inttoptr(arguments[0], storage.as_pointer()))
            if storage == F32:
                return builder.fpext(value, F64)
            return value if storage in (I64, F64) else builder.sext(value, I64)

        return result(types.int64), generate

    return read


def _writer(storage: ir.Type, kind: Any) -> Any:
    @intrinsic
    def write(typing_context, address, value):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            word = arguments[1]
            if storage == F32:
                word = builder.fptrunc(word, storage)
            elif storage not in (I64, F64):
                word = builder.trunc(word, storage)
            builder.store(word, builder.inttoptr(arguments[0], storage.as_pointer()))
            return context.get_dummy_value()

        return types.void(types.int64, kind), generate

    return write


@intrinsic
def _call_access(typing_context, function, instance, references, count, values, size):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        kind = ir.FunctionType(I32, [I64] * 5)
        status = builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return builder.sext(status, I64)

    return types.int64(*[types.int64] * 6), generate


@intrinsic
def _call_step(typing_context, function, instance, t, h, flags):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        function_, instance_, t_, h_, flags_ = arguments
        kind = ir.FunctionType(I32, [I64, F64, F64, I64, I64, I64, I64, I64])
        places = [builder.add(flags_, I64(8 * i)) for i in range(4)]
        pointer = builder.inttoptr(function_, kind.as_pointer())
        return builder.sext(builder.call(pointer, [instance_, t_, h_, I64(1), *places]), I64)

    return types.int64(types.int64, types.int64, types.float64, types.float64, types.int64), generate


WORDS = {
    machine.read64:        _reader(I64, types.int64),
    machine.read32:        _reader(I32, types.int64),
    machine.read16:        _reader(I16, types.int64),
    machine.read8:         _reader(I8, types.int64),
    machine.read_float:    _reader(F64, types.float64),
    machine.read_float32:  _reader(F32, types.float64),
    machine.write64:       _writer(I64, types.int64),
    machine.write32:       _writer(I32, types.int64),
    machine.write16:       _writer(I16, types.int64),
    machine.write8:        _writer(I8, types.int64),
    machine.write_float:   _writer(F64, types.float64),
    machine.write_float32: _writer(F32, types.float64),
    machine.call_access:   _call_access,
    machine.call_step:     _call_step,
}  # fmt: skip


def llvm_text(function: Any, dtype: Any, arguments: tuple[str, ...], where: str) -> tuple[str, str]:
    """Native name and LLVM text of `int32 function(record *, arguments...)`; argument `record`: one more of its kind."""
    record = types.CPointer(numba.from_dtype(dtype))
    signature = types.int32(record, *(NUMBA_TYPES.get(argument, record) for argument in arguments))

    def entry0(pointer):  # type: ignore[no-untyped-def]
        return function(carray(pointer, 1)[0])

    def entry1(pointer, t):  # type: ignore[no-untyped-def]
        return function(carray(pointer, 1)[0], t)

    def entry2(pointer, t, h):  # type: ignore[no-untyped-def]
        return function(carray(pointer, 1)[0], t, h)

    def entry3(pointer, other, t, h):  # type: ignore[no-untyped-def]
        return function(carray(pointer, 1)[0], carray(other, 1)[0], t, h)

    try:
        compiled = cfunc(signature, error_model="numpy")((entry0, entry1, entry2, entry3)[len(arguments)])
    except errors.NumbaError as error:
        raise BuildError(_message(error, where)) from None
    return compiled.native_name, compiled.inspect_llvm()


def _message(error: Any, where: str) -> str:
    """Numba's pages in one line: component, place, construct."""
    text = str(error)
    places = [line.strip() for line in text.splitlines() if line.strip().startswith("File ")]
    reasons = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith((" ", "\t"))]
    noise = ("Failed in", "During:", "File", "This error", "- ", "[1", "Traceback", "No implementation")
    useful = [line for line in reasons if not line.startswith(noise)]
    place = next((p for p in reversed(places) if "solver.py" not in p and "intrinsics.py" not in p), "")
    code = ""
    lines = text.splitlines()
    for i, line in enumerate(lines):
        if place and place in line:
            arrow = next((k for k in range(i, min(i + 12, len(lines))) if lines[k].lstrip().startswith("^")), 0)
            code = lines[arrow - 1].strip() if arrow else ""
    construct = f": `{code}`" if code else ""
    reason = useful[-1] if useful else text.splitlines()[0]
    return f"{where}: {place or 'source'}{construct} cannot be compiled: {reason}"
