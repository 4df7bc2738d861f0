"""Types of the keys of a scenario file: how a written value is parsed and checked."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator

from twin import clock
from twin.coupling import Algorithm
from twin.errors import CouplingError, ScenarioError
from twin.results import expression
from twin.scenario.keys import conditions
from twin.scenario.keys.quantities import duration, nanoseconds, number, raw, short, split
from twin.scenario.resolution.variable_names import nearest

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
REFERENCE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\.[^\s>*]+")
RATIOS = ("smoothing", "agreement", "tolerance", "correction")  # options of algorithms
THREAD_WORDS = {"auto": None, "off": 1}
MAX_THREADS = 256
PATTERN = re.compile(r"[A-Za-z_*][A-Za-z0-9_*]*\.[^\s>]+|\*")


def positive(value: Any) -> clock.Time:
    """Parse a time above zero [ns]."""
    if (time := duration(value)) <= 0:
        raise ValueError(f"expected a time above zero, not {short(value)}")
    return time


def period(value: Any) -> int:
    """Parse a time above zero in whole nanoseconds."""
    positive(value)
    return nanoseconds(value)


def text(value: Any) -> Any:
    """Convert a number to text, because YAML reads a title such as `8` as a number."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return str(value)
    return value


def reference(value: Any) -> str:
    """Check `member.variable`; the variable may contain any characters except spaces, > and *."""
    if not isinstance(value, str) or not REFERENCE.fullmatch(value):
        raise ValueError(f"expected member.variable, not `{short(value)}`")
    return value


def pattern(value: Any) -> str:
    """Check `member.variable` with optional `*` wildcards."""
    if not isinstance(value, str) or not PATTERN.fullmatch(value):
        raise ValueError(f"expected member.variable or member.*, not `{short(value)}`")
    return value


def parsed_by(parse: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a parser whose errors pydantic reports."""

    def parsed(value: Any) -> Any:
        try:
            return parse(value)
        except ScenarioError as error:
            raise ValueError(str(error)) from None

    return parsed


def fraction(value: Any) -> float:
    """Parse a ratio between 0 and 10, from `20 %` or 0.2."""
    try:
        ratio = number(value, "", "tolerance") if not str(value).rstrip().endswith("%") else percent(value)
    except (ValueError, CouplingError):
        raise ValueError(f"expected a ratio such as 20 % or 0.2, not {short(value)}") from None
    if not 0 <= ratio <= 10:
        raise ValueError(f"expected a ratio between 0 and 10, such as 20 % or 0.2, not {short(value)}")
    return ratio


def offset(value: Any) -> tuple[float, str]:
    """Split the offset of a connection into number and unit; without a unit it is in that of the target."""
    parts = split(value) if isinstance(value, str) else None
    symbol = parts[1] if parts else ""
    try:
        return number(raw(value), symbol, "offset"), symbol
    except CouplingError as error:
        raise ValueError(str(error).removeprefix("offset: ").rstrip(".")) from None


def percent(value: str) -> float:
    """Parse a percentage as a ratio."""
    return float(value.rstrip().removesuffix("%")) / 100


def algorithm(value: Any) -> Algorithm | None:
    """Parse an algorithm from its name, or from its name and options."""
    if value is None:
        return None
    if not isinstance(value, str | dict):
        raise ValueError(  # noqa: TRY004 - pydantic catches ValueError
            f"expected a name such as jacobi, or its name and options, not {short(value)}"
        )
    options = {"name": value} if isinstance(value, str) else {"name": "jacobi", **value}
    if options["name"] not in (names := [item.name for item in Algorithm]):
        raise ValueError(f"`{short(options['name'])}` is not known.{nearest(str(options['name']), names)}")
    readers: dict[str, Callable[[Any], Any]] = {
        **dict.fromkeys(RATIOS, fraction),
        "smallest": positive,
        "scales": parse_scales,
    }
    try:
        return Algorithm({key: readers.get(key, raw)(item) for key, item in options.items()})  # type: ignore[no-any-return]
    except CouplingError as error:
        raise ValueError(str(error).removeprefix("algorithm: ")) from None


def thread_limit(value: Any) -> int | None:
    """Parse the largest number of threads that step members: None for `auto`, 1 for `off`."""
    if isinstance(value, str) and value in THREAD_WORDS:
        return THREAD_WORDS[value]
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MAX_THREADS:
        return value
    raise ValueError(f"expected auto, off or a number from 1 to {MAX_THREADS}, not {short(value)}")


def parse_scales(value: Any) -> dict[str, Any]:
    """Check the scales of variables: `member.variable` -> value as written."""
    if not isinstance(value, dict):
        raise ValueError(f"expected scales such as {{wall.force: 0.2 N}}, not {short(value)}")  # noqa: TRY004
    return {reference(name): raw(size) for name, size in value.items()}


def reference_figures(value: Any) -> Any:
    """Check one reference value, or one for each variant."""
    if isinstance(value, dict):
        return {name: raw(item, 4) for name, item in value.items()}
    return raw(value, 4)


def as_list(value: Any) -> Any:
    """Wrap a single value in a list."""
    return value if isinstance(value, list) else [value]


Item = TypeVar("Item")
Some = Annotated[list[Item], BeforeValidator(as_list)]  # one value, or a list of them
Pair = Annotated[list[Item], Field(min_length=2, max_length=2)]
UpToTwo = Annotated[tuple[Item, ...], BeforeValidator(as_list), Field(max_length=2)]
Time = Annotated[int, BeforeValidator(nanoseconds)]
Period = Annotated[int, BeforeValidator(period)]
Moment = Annotated[clock.Time, PlainValidator(duration)]  # of the simulation: any ratio, such as 1/30 s
Step = Annotated[clock.Time, PlainValidator(positive)]
Text = Annotated[str, BeforeValidator(text)]
Reference = Annotated[str, BeforeValidator(reference)]
Pattern = Annotated[str, BeforeValidator(pattern)]
Offset = Annotated[tuple[float, str], PlainValidator(offset)]
Value = Annotated[Any, BeforeValidator(raw)]
Signal = Annotated[Any, BeforeValidator(parsed_by(expression.parse))]
Condition = Annotated[Any, BeforeValidator(parsed_by(conditions.parse))]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**31)]
Method = Annotated[Any, BeforeValidator(algorithm)]
Threads = Annotated[int | None, BeforeValidator(thread_limit)]


class Keys(BaseModel):
    """A group of keys; unknown keys are an error."""

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True, populate_by_name=False, defer_build=True)
