"""What the face says and hears: options of the command line as arguments, values of any kind as plain ones."""

from __future__ import annotations

import importlib
import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import TwinError, nearest
from twin.scenario import duration

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: (?=[\d\"]))?")
ARGUMENTS = {  # option of the command line: argument here, where it is not only spelled otherwise
    "set": "set ",
    "as": "form=",
    "runs": "out=",
    "variant": "variants=",
    "seed": "seeds=",
    "platform": "platforms=",
    "output": "path=",
    "start-value": "start_values=",
    "log": "logging=",
}


def argument(option: re.Match[str]) -> str:
    """`--stop-time 1` as `stop_time=1`."""
    name, given = option[1], option[0].endswith(" ")
    text = ARGUMENTS.get(name, f"{name.replace('-', '_')}=")
    return text if given else text.rstrip(" =")


@contextmanager
def as_arguments() -> Iterator[None]:
    """Messages that were written for the command line name the arguments of Python instead."""
    try:
        yield
    except TwinError as error:
        error.problems = [OPTION.sub(argument, line) for line in error.problems]
        error.args = ("\n".join(error.problems),)
        raise


def needed(name: str) -> Any:
    """A package of the extra `python`; TwinError says how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        text = f"{name} is not installed. Install it with `pip install 'catheter-twin[python]'`."
        raise TwinError(text) from None


def plain(value: Any) -> Any:
    """Numbers and arrays of numpy, tuples and the like as Python's own numbers and lists."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if hasattr(value, "to_numpy"):  # a Series of pandas, a DataArray of xarray
        return value.to_numpy().tolist()
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value


def finite(value: Any, what: str) -> Any:
    """The same as `plain`, of numbers that a simulation can bear."""
    value = plain(value)
    numbers = np.asarray(value) if isinstance(value, float | list) else np.zeros(1)
    if numbers.dtype.kind == "f" and not np.all(np.isfinite(numbers)):
        raise TwinError(f"{what}: {value} is not finite. Give a finite number.")
    return value


def written(value: Any) -> str:
    """A value as `--set` takes it."""
    value = plain(value)
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return value if isinstance(value, str) else repr(value)


def seconds(value: float | str | None, what: str) -> float | None:
    """A time with a unit, or in seconds, as seconds."""
    return None if value is None else clock.seconds(nanoseconds(value, what))


def nanoseconds(value: float | str, what: str) -> clock.Time:
    """A time with a unit, or in seconds, in nanoseconds, exactly."""
    try:
        return duration(plain(value))
    except ValueError as error:
        raise TwinError(f"{what}: {error}.") from None


def choice(value: str, choices: Iterable[str], what: str) -> str:
    """One of a few words."""
    names = list(choices)
    if value not in names:
        raise TwinError(f"{what}: {value!r} is not known. {nearest(str(value), names)}")
    return value


def listed(value: Any) -> list[Any]:
    """One or several as a list."""
    if value is None:
        return []
    return [value] if isinstance(value, str | int | np.integer) else list(value)
