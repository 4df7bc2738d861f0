"""Shape of a validation file: keys, their types and what they mean."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from twin.identify import RangeKeys, TableKeys, listed, probability, shorthand
from twin.scenario import Keys, Period, Text, Value

BaselineName = Literal[
    "line", "quadratic", "cubic", "play_cubic", "linear_second_order", "narx", "network", "play_network"
]


def rate(value: Any) -> Any:
    """A rate of false alarms, from `5 %` or 0.05."""
    try:
        return 1 - probability(
            f"{100 - float(value.rstrip().removesuffix('%'))} %" if isinstance(value, str) else 1 - value
        )
    except (TypeError, ValueError):
        raise ValueError("expected a rate above 0 % and up to 50 %, such as 5 %") from None


class MeasuredSignalKeys(Keys):
    """A measured column and the variable that it is compared with.

    `unit`: of figures; `quantity`: its name in figures. `noise`: its weight in a fit is 1/noise; estimated by default.
    `rate`: column of its measured derivative, for the initial state of dynamic baselines.
    """

    signal: Text = ""
    unit: Text = ""
    quantity: Text = ""
    noise: Value | None = None
    rate: Text = ""


class FoldKeys(Keys):
    """How training data are divided for cross-validation: a fold per file, per value of a column, or blocks in time.

    `count`: number of blocks per file, or of folds into which the values of a column are distributed (0: one per value).
    """

    by: Literal["file", "block", "column"] = "file"
    count: Annotated[int, Field(ge=0)] = 0
    column: Text = ""


class SetKeys(TableKeys):
    """Files of one kind, the component that predicts them, and what is compared.

    `turned`: outputs that some recordings have with the opposite sign, as the component learns from the first sample;
    baselines then go through the first sample too, with the signs that bring it closer to the first one of the fit.
    `equal_files`: fit to equally many rows of each file. `window`, `train_window`: rows after which a roll-out starts from a new initial state; 0: never.
    """

    files: Annotated[list[Text], BeforeValidator(listed)] = Field(default_factory=list)
    train: Annotated[list[Text], BeforeValidator(listed)] = Field(default_factory=list)
    component: Text = ""
    step: Period | None = None
    set: dict[Text, Value] = Field(default_factory=dict)
    inputs: dict[Text, Text] = Field(default_factory=dict)
    outputs: dict[Text, Annotated[MeasuredSignalKeys, shorthand("signal")]] = Field(default_factory=dict)
    distance: Annotated[dict[Text, list[Text]], shorthand("distance", list)] = Field(default_factory=dict)
    initial: dict[Text, Text] = Field(default_factory=dict)
    window: Annotated[int, Field(ge=0)] = 0
    train_window: Annotated[int, Field(ge=0)] | None = None
    fit: dict[Text, RangeKeys] = Field(default_factory=dict)
    rezero: dict[Text, RangeKeys] = Field(default_factory=dict)
    baselines: list[BaselineName] = Field(default_factory=list)
    turned: list[Text] = Field(default_factory=list)
    folds: FoldKeys = FoldKeys()
    equal_files: bool = False


class ValidationKeys(Keys):
    """A validation file. `band`: probability of prediction bands; `false_alarms`: rate of the consistency test."""

    title: Text = ""
    description: Text = ""
    source: Text = ""
    license: Text = ""
    band: Annotated[float, BeforeValidator(probability)] = 0.9
    false_alarms: Annotated[float, BeforeValidator(rate)] = 0.05
    sets: dict[Text, SetKeys] = Field(default_factory=dict)
