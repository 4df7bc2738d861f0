"""Conversion of values from users and files, as text or numbers, to the types of FMU variables."""

from __future__ import annotations

import json
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import FMUError, nearest
from twin.files import parse_float

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.coupling import MemberVariable

TRUTH = {"true": True, "1": True, "false": False, "0": False}
ELEMENT = re.compile(r"(.+)\[\s*(\d+(?:\s*,\s*\d+)*)\s*\]")  # A[1,2], counted from 1

Items = dict[str, int]  # enumeration item -> number


def find(name: str, variables: dict[str, MemberVariable], what: str) -> tuple[MemberVariable, int | None]:
    """A variable by name, or one element of an array as `A[1,2]` with its index in row-major order."""
    if name in variables:
        return variables[name], None
    matched = ELEMENT.fullmatch(name)
    if not matched or matched[1] not in variables or not variables[matched[1]].shape:
        raise FMUError(f"{what}: has no variable {name!r}. {nearest(name, list(variables))}")
    variable = variables[matched[1]]
    index = variable.index_of(matched[2])
    if index is None:
        shape = ",".join(map(str, variable.shape))
        raise FMUError(f"{what}: {name!r} is outside of {variable.name}[{shape}]. Elements are counted from 1.")
    return variable, index


def elements(variable: MemberVariable) -> list[str]:
    """Names of a variable's scalars in row-major order: `A[1,1]`, `A[1,2]`."""
    if not variable.shape:
        return [variable.name]
    return [f"{variable.name}[{','.join(str(i + 1) for i in index)}]" for index in np.ndindex(variable.shape)]


def array(variable: MemberVariable, value: Any, items: Items, what: str) -> np.ndarray[Any, Any]:
    """A value as an array of the variable's shape and memory type.

    Text may be `[[1, 2], [3, 4]]` or `1 2 3 4`; a flat list fills the array row by row.
    """
    if isinstance(value, np.ndarray) and value.shape == variable.shape and value.dtype == variable.dtype == np.float64:
        return value.copy()
    parse = scalar_of(variable, items, what)
    if not variable.shape:
        if isinstance(value, np.ndarray):
            value = value.item() if value.ndim == 0 else value.tolist()
        return np.array(parse(value), dtype=variable.dtype)
    given = split(variable, value, what)
    flat, shape = flatten(given)
    if shape != variable.shape and not (len(shape) == 1 and shape[0] == variable.size):
        wanted = " x ".join(map(str, variable.shape))
        raise FMUError(
            f"{what}: {variable.name} has {len(flat)} values, expected {wanted}. Give {variable.size} values."
        )
    result = np.empty(variable.size, dtype=variable.dtype)
    for index, item in enumerate(flat):
        result[index] = parse(item)
    return result.reshape(variable.shape)


def split(variable: MemberVariable, value: Any, what: str) -> Any:
    """Text of an array as lists; everything else as it is."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if not isinstance(value, str):
        return value
    if value.lstrip().startswith("["):
        try:
            return json.loads(value)
        except json.JSONDecodeError as error:
            raise FMUError(
                f"{what}: {variable.name}={value} is not a list ({error}). Write [[1, 2], [3, 4]]."
            ) from None
    return [part for part in re.split(r"[\s,;]+", value) if part]


def flatten(value: Any) -> tuple[list[Any], tuple[int, ...]]:
    """Scalars and shape of nested lists; the shape is () if they are ragged or no lists."""
    if not isinstance(value, list | tuple):
        return [value], ()
    if not value:
        return [], (0,)
    parts = [flatten(part) for part in value]
    flat = [item for part, _ in parts for item in part]
    shapes = {shape for _, shape in parts}
    if len(shapes) != 1:
        return flat, ()
    return flat, (len(value), *shapes.pop())


def scalar_of(variable: MemberVariable, items: Items, what: str) -> Callable[[Any], Any]:
    """Return the function that parses one scalar of a variable."""
    name = f"{what}: {variable.name}"
    kind = variable.type
    if kind in ("Float64", "Float32"):
        return lambda value: real(value, name, variable.dtype)
    if kind == "Boolean" or (kind == "Clock" and variable.connectable):
        return lambda value: boolean(value, name)
    if kind == "Enumeration":
        return lambda value: enumeration(value, name, items)
    if kind == "String":
        return lambda value: string(value, name)
    if kind == "Binary":
        return lambda value: binary(value, name)
    if kind == "Clock":
        raise FMUError(f"{name} is a clock of an FMU without Event Mode, where it never ticks. Leave it out.")
    return lambda value: integer(value, name, variable.dtype)


def real(value: Any, name: str, dtype: np.dtype[Any]) -> float:
    """A float; one too large for Float32 is an error, not infinity."""
    try:
        number = parse_float("true" if isinstance(value, bool | np.bool_) else value)
    except (TypeError, ValueError):
        raise FMUError(f"{name} is a number, not {value!r}. Write it like 1.5e-3.") from None
    largest = float(np.finfo(dtype).max)  # compared as Float64: NumPy would warn of an overflow
    if math.isfinite(number) and abs(number) > largest:
        raise FMUError(f"{name} is a {dtype.name}, too small for {value}. Give at most {largest:.3g}.")
    return number


def integer(value: Any, name: str, dtype: np.dtype[Any]) -> int:
    """A whole number in the range of its type."""
    limits = np.iinfo(dtype)
    try:
        number = None if isinstance(value, str) and "_" in value else int(value)
    except (TypeError, ValueError, OverflowError):
        number = None
    if number is None or isinstance(value, bool | np.bool_) or (not isinstance(value, str) and number != value):
        raise FMUError(f"{name} is a whole number ({dtype.name}), not {value!r}. Write it like 3.")
    if not limits.min <= number <= limits.max:
        raise FMUError(f"{name} is a {dtype.name}: {number} is out of range. Give {limits.min} to {limits.max}.")
    return number


def boolean(value: Any, name: str) -> bool:
    """true, false, 1 or 0."""
    if isinstance(value, str) and value.strip().lower() in TRUTH:
        return TRUTH[value.strip().lower()]
    if isinstance(value, bool | np.bool_ | int | float | np.number) and value in (0, 1):
        return bool(value)
    raise FMUError(f"{name} is Boolean, not {value!r}. Write true or false.")


def enumeration(value: Any, name: str, items: Items) -> int:
    """An item by its name or its number."""
    if isinstance(value, str) and value in items:
        return items[value]
    try:
        number = integer(value, name, np.dtype(np.int64))
    except FMUError:
        number = None
    if number is None or (items and number not in items.values()):
        choices = ", ".join(f"{word} ({number})" for word, number in items.items()) or "a whole number"
        raise FMUError(f"{name} is an enumeration without {value!r}. Choose from {choices}.")
    return number


def string(value: Any, name: str) -> str:
    """Text, without the NUL that would end it early."""
    if not isinstance(value, str):
        raise FMUError(f"{name} is a String, not {value!r}. Write it in quotes.")
    if "\0" in value:
        raise FMUError(f"{name}: a String cannot hold the character NUL. Remove it.")
    return value


def binary(value: Any, name: str) -> bytes:
    """Bytes, or their hexadecimal digits."""
    if isinstance(value, bytes | bytearray):
        return bytes(value)
    try:
        return bytes.fromhex(value)
    except (TypeError, ValueError):
        raise FMUError(f"{name} is Binary, not {value!r}. Write hexadecimal digits such as 00ff.") from None
