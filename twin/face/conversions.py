"""Conversions of the Python interface: names of options to arguments, values of any type to plain ones."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from twin import clock
from twin.component import unit
from twin.errors import CouplingError, TwinError, nearest
from twin.scenario import duration, scenario_paths

if TYPE_CHECKING:
    from collections.abc import Iterator

BackendName = Literal["fmu", "compiled", "interpreted"]
OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: (?=[\d\"]))?(\d+[a-z]+)?")
ARGUMENTS = {  # arguments of Python by option of the command line, where the names differ
    "set": "set ",
    "runs": "out=",
    "variant": "variants=",
    "seed": "seeds=",
    "platform": "platforms=",
    "output": "path=",
    "start-value": "start_values=",
    "log": "logging=",
}


def argument(option: re.Match[str]) -> str:
    """Return `--stop-time 1` as `stop_time=1`, and `--stop-time 1s` as `stop_time="1s"`."""
    name, given = option[1], " " in option[0]
    text = ARGUMENTS.get(name, f"{name.replace('-', '_')}=")
    return text + (f'"{option[2]}"' if option[2] else "") if given else text.rstrip(" =")


@contextmanager
def python_option_names() -> Iterator[None]:
    """Replace options of the command line by arguments of Python in the messages of errors."""
    try:
        yield
    except TwinError as error:
        error.problems = [OPTION.sub(argument, line) for line in error.problems]
        error.args = ("\n".join(error.problems),)
        raise


def convert(source: str, target: str, name: str) -> tuple[float, float]:
    """Return factor and offset from a unit to another; TwinError with the name of the signal if they do not convert."""
    try:
        return unit.conversion(source or "1", target, name)
    except CouplingError as error:
        raise TwinError(str(error).removesuffix(" Connect quantities of one kind.")) from None


def plain(value: Any) -> Any:
    """Convert NumPy numbers and arrays, tuples and the like to Python's own numbers and lists."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if hasattr(value, "to_numpy"):  # a Series of pandas, a DataArray of xarray
        return value.to_numpy().tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def finite(value: Any, what: str) -> Any:
    """Convert like `plain`; TwinError if a number is not finite."""
    value = plain(value)
    numbers = np.asarray(value) if isinstance(value, float | list) else np.zeros(1)
    if numbers.dtype.kind == "f" and not np.all(np.isfinite(numbers)):
        raise TwinError(f"{what}: {value} is not finite. Give a finite number.")
    return value


def override_text(value: Any) -> str:
    """Return a value as text for `--set`."""
    value = plain(value)
    if isinstance(value, list):
        return f"[{', '.join(map(override_text, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return value if isinstance(value, str) else repr(value)


def seconds(value: float | str | None, what: str) -> float | None:
    """Convert a time, with a unit or in seconds, to seconds."""
    return None if value is None else clock.seconds(nanoseconds(value, what))


def nanoseconds(value: float | str, what: str) -> clock.Time:
    """Convert a time, with a unit or in seconds, to exact nanoseconds."""
    try:
        return duration(plain(value))
    except ValueError as error:
        raise TwinError(f"{what}: {error}.") from None


def choice(value: str, choices: Iterable[str], what: str) -> str:
    """Return a value if it is one of the choices; TwinError otherwise."""
    names = list(choices)
    if value not in names:
        raise TwinError(f"{what}: {value!r} is not known. {nearest(str(value), names)}")
    return value


def as_list(value: Any) -> list[Any]:
    """Return one or several values as a list."""
    if value is None:
        return []
    value = plain(value)
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str) else [value]


def integers(value: Any, what: str) -> list[int]:
    """Return one or several whole numbers as a list; TwinError otherwise."""
    numbers = as_list(value)
    if wrong := [number for number in numbers if not isinstance(number, int) or isinstance(number, bool)]:
        raise TwinError(f"{what}: {wrong[0]!r} is not a whole number. Give one, such as 1, or a list of them.")
    return numbers


def mapping(value: Any, what: str, example: str) -> dict[str, Any]:
    """Return values by name as a dict; TwinError if they are none."""
    if value is None or isinstance(value, Mapping):
        return dict(value or {})
    raise TwinError(f"{what}: {value!r} is not a mapping from names to values. Give {example}.")


def check_file(path: Any, what: str, kinds: tuple[str, ...], error: type[TwinError] = TwinError) -> None:
    """Raise an error with similar files if a path is none, or ends like these kinds of files but does not exist."""
    if not isinstance(path, str | os.PathLike):
        raise error(f"{what}: {path!r} is not a path. Give that of a file, or a name.")
    file = Path(path)
    if file.suffix.lower() in kinds and not file.exists():
        if what in ("scenario", "study"):
            scenario_paths.refuse_elsewhere(file, what)
        if not file.parent.is_dir():
            raise error(f"{path}: cannot be read: there is no folder {file.parent.resolve()}.")
        names = [other.name for other in file.parent.iterdir() if other.suffix.lower() in kinds]
        raise error(
            f"{path}: cannot be read: is not there. Looked in {file.parent.resolve()}. "
            + (nearest(file.name, names) if names else f"That folder has no {kinds[0]} file.")
        )
