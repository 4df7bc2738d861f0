"""JSON messages: one object with a time stamp and values; nested objects have names such as `arm.position`."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from twin.follow.sources.message import Message

if TYPE_CHECKING:
    from collections.abc import Iterator

UNITS = "units"  # object of units, by the names of the values


def parse(source: str, data: bytes, arrival: float, time_name: str) -> Message:
    """Parse a JSON object; a message with its `problem` if it is none. null is no value."""
    try:
        content = json.loads(data, parse_int=float)  # a whole number may be larger than any float
        if not isinstance(content, dict):
            return Message(source, arrival, problem="a message is no JSON object such as {'time': 1.25, 'tip': 0.1}")
        units, stamp = content.pop(UNITS, {}), content.pop(time_name, None)
        entries = list(flatten(content, ""))
    except (ValueError, RecursionError) as error:
        return Message(source, arrival, problem=f"a message is no JSON ({str(error).partition(':')[0]})")
    if stamp is not None and not (is_number(stamp) and math.isfinite(stamp)):
        return Message(source, arrival, problem=f"`{time_name}` of a message is no number of seconds")
    values: dict[str, float] = {}
    for name, value in entries:
        if is_number(value):
            values[name] = float(value)
        elif value is not None:
            return Message(source, arrival, problem=f"`{name}` of a message is no number")
    units = {name: str(text) for name, text in units.items()} if isinstance(units, dict) else {}
    return Message(source, arrival, None if stamp is None else float(stamp), values, units)


def is_number(value: Any) -> bool:
    """Whether a value of JSON is a number; a Boolean counts as 0 or 1."""
    return isinstance(value, int | float)


def flatten(content: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the values of nested objects with their names."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
