"""Shape of an identify file: keys, their types and what they mean. Names and units are checked in `problem`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from twin.scenario import Keys, Period, Reference, Seed, Text, Time, Value

Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]  # as scipy.optimize.least_squares calls them


def shorthand(key: str, kind: type = str) -> BeforeValidator:
    """Return the validator of a group that may be given by the value of one key alone, of this type."""
    return BeforeValidator(lambda value: {key: value} if isinstance(value, kind) else value)


def listed(value: Any) -> Any:
    """A list, also of a single item."""
    return value if isinstance(value, list) else [value]


def probability(value: Any) -> Any:
    """A probability, from `95 %` or 0.95."""
    try:
        fraction = float(value.rstrip().removesuffix("%")) / 100 if isinstance(value, str) else float(value)
    except (TypeError, ValueError):
        fraction = 0.0
    if not 0.5 <= fraction < 1:
        raise ValueError("expected a probability from 50 % to below 100 %, such as 95 %")
    return fraction


class ColumnKeys(Keys):
    """A column as the file calls it, and its unit where the name does not state it."""

    name: Text = ""
    unit: Text = ""


Columns = dict[Text, Annotated[ColumnKeys, shorthand("name")]]


class ColumnsKeys(Keys):
    """How files call the columns of tables: table -> column -> name and unit."""

    columns: dict[Text, Columns] = Field(default_factory=dict)


class TableKeys(Keys):
    """How a table is read. `columns`: names for its columns; `time`: its column of times.

    `sample_time`: interval of the rows; the file's own times are ignored. `missing`: rows without a value.
    `duplicates`: rows at the same time.
    """

    time: Text = ""
    sample_time: Period | None = None
    columns: Columns = Field(default_factory=dict)
    missing: Literal["refuse", "drop"] = "refuse"
    duplicates: Literal["refuse", "first", "mean"] = "refuse"


class FileKeys(TableKeys):
    """A recorded file. `start`: the time in it that is zero in the run."""

    file: Text = ""
    start: Time = 0
    node: Annotated[int, Field(strict=True, ge=1, le=127)] | None = None  # of a decoded bus trace
    variant: Text = ""  # of a run
    seed: Seed | None = None
    gap: Period | None = None  # longest time without a value through which an input is drawn as a line


class RangeKeys(Keys):
    """Where a value is looked for. `start`: the first guess, by default what the model has."""

    low: Value | None = Field(None, alias="from")
    high: Value | None = Field(None, alias="to")
    start: Value | None = None
    scale: Literal["linear", "log"] = "linear"


class InputKeys(Keys):
    """A column that drives a variable: factor * column + offset."""

    signal: Reference = "."
    factor: float = 1.0
    offset: Value = 0.0


class OutputKeys(InputKeys):
    """A column that a variable is compared with.

    `noise`: standard deviation of the measurement, else it is estimated; `weight`: how much more it counts.
    `delay` and `offset` may be looked for, too.
    """

    offset: Value | RangeKeys = 0.0
    delay: Value | RangeKeys = 0.0
    noise: Value | None = None
    weight: Annotated[float, Field(gt=0)] = 1.0


class RecordingKeys(Keys):
    """A recording, and what it was made with."""

    scenario: Text = ""
    component: Text = ""
    variant: Text = ""
    seed: Seed | None = None
    step: Period | None = None
    set: dict[Text, Value] = Field(default_factory=dict)
    data: Annotated[list[Annotated[FileKeys, shorthand("file")]], BeforeValidator(listed)] = Field(default_factory=list)
    inputs: dict[Text, Annotated[InputKeys, shorthand("signal")]] = Field(default_factory=dict)
    outputs: dict[Text, Annotated[OutputKeys, shorthand("signal")]] = Field(default_factory=dict)
    start: Time | None = Field(None, alias="from")
    stop: Time | None = Field(None, alias="to")
    fit: dict[Text, RangeKeys] = Field(default_factory=dict)


class IdentifyKeys(RecordingKeys):
    """An identify file: one recording, or what several have in common. A recording's own keys win."""

    title: Text = ""
    description: Text = ""
    recordings: dict[Text, RecordingKeys] = Field(default_factory=dict)
    loss: Loss = "linear"
    confidence: Annotated[float, BeforeValidator(probability)] = 0.95
