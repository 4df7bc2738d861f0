"""Keys of a follow file: those of an identify file for model and recording, and what is estimated by which method."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from twin.follow.rig_keys import RigKeys, with_sources
from twin.identify import IdentifyKeys
from twin.scenario import Keys, Period, Seed, Text, Value


class EstimateKeys(Keys):
    """An estimated state or tunable parameter.

    `start`: first estimate, by default the model's value; `deviation`: its standard deviation. `walk`: standard deviation
    of the change in one second (random walk). `from`, `to`: bounds.
    """

    start: Value | None = None
    deviation: Value
    walk: Value = 0.0
    low: Value | None = Field(None, alias="from")
    high: Value | None = Field(None, alias="to")


class MethodKeys(Keys):
    """The filter: `unscented`, `extended`, or `ensemble` with its `size` and random `seed`."""

    name: Literal["unscented", "extended", "ensemble"] = "unscented"
    size: Annotated[int, Field(ge=2, le=10_000)] = 50
    seed: Seed = 0


def with_name(value: Any) -> Any:
    """A method, also if only its name is given."""
    return {"name": value} if isinstance(value, str) else value


class ChangeKeys(Keys):
    """A change to look for. `set`: variable -> amount: `x1.5`, `+5 mN`, a new value, or a list of these; `rate`: changes per hour."""

    set: dict[Text, Value | list[Value]] = Field(default_factory=dict)
    rate: Annotated[float, Field(gt=0)] = 0.1


class ForecastKeys(Keys):
    """Forecasts. `every`: interval of forecasts; `interval`: of the points in one; `limits`: signal -> lower and upper one.

    `planned`: inputs of which the future is known; all others are held. `calibrate`: how long errors of past forecasts of measured signals
    widen or narrow the bands, so that they hold 90 % of the measured values.
    """

    horizon: Period = 0
    every: Period | None = None
    interval: Period | None = None
    signals: list[Text] = Field(default_factory=list)
    limits: dict[Text, tuple[Value, Value]] = Field(default_factory=dict)
    planned: list[Text] = Field(default_factory=list)
    draws: Annotated[int, Field(ge=10, le=10_000)] = 50
    seed: Seed = 0
    calibrate: Period | None = None


class FollowKeys(IdentifyKeys):
    """A follow file. `rig`: what is followed live, instead of the recording `data`; `smooth`: lag of the smoothed estimates."""

    estimate: dict[Text, EstimateKeys] = Field(default_factory=dict)
    changes: dict[Text, ChangeKeys] = Field(default_factory=dict)
    forecast: ForecastKeys | None = None
    smooth: Period | None = None
    method: Annotated[MethodKeys, BeforeValidator(with_name)] = Field(default_factory=MethodKeys)
    rig: Annotated[RigKeys | None, BeforeValidator(with_sources)] = None
