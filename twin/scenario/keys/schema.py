"""Schema of a scenario file: keys, types and meaning. Names and units are checked in `check`."""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from twin.scenario.keys.key_types import (
    Condition,
    Keys,
    Method,
    Moment,
    Offset,
    Pair,
    Pattern,
    Reference,
    Seed,
    Signal,
    Some,
    Step,
    Text,
    Threads,
    UpToTwo,
    Value,
    fraction,
    reference_figures,
)
from twin.scenario.keys.space_schema import SpaceKeys


class MemberKeys(Keys):
    """`servo: {component: servomotor, parameters: {mass: 0.65 kg}, period: 1 ms}`; in a variant all are optional.

    `period`: sample period. `communication_step`: interval at which inputs and outputs are exchanged. `finite`: whether
    a value that is not finite ends the run. `isolate`: whether it runs in a separate process. `interface`: FMI
    interface; `solver`: for Model Exchange. `solver_tolerance`: relative, of that solver or of the FMU's own. `names`:
    of an FMU, names of variables here -> its own. `units`: of an FMU, variable -> unit that it does not declare.
    """

    component: Text | None = None
    parameters: dict[str, Value] = {}
    period: Step | None = None
    communication_step: Step | None = None
    finite: bool = True
    isolate: bool = False
    interface: Literal["", "co_simulation", "model_exchange", "scheduled_execution"] = ""
    solver: Text = ""
    solver_tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    names: dict[str, Text] = {}
    units: dict[str, Text] = {}
    description: Text = ""


class ConnectionKeys(Keys):
    """`servo.position -> sheath.gripper_position`; `from: null` removes an inherited connection.

    `factor`, `offset`: target = factor * source + offset, after units are converted, unless `convert` is false; a number
    as offset is in the target's unit. `bond`: name of the power bond that this connection and its reverse form. `hold`: the input is held over each step.
    """

    source: Reference | None = Field(alias="from")
    target: Reference = Field(alias="to")
    factor: Annotated[float, Field(allow_inf_nan=False)] = 1.0
    offset: Offset = (0.0, "")
    convert: bool = True
    bond: Text = ""
    hold: bool = False


class EventKeys(Keys):
    """An event at a time or with a condition, or a hardware fault, whose keys the hardware defines.

    `for`: time for which the condition must be true without interruption; `after`: time before which it is not evaluated.
    `repeat`: it acts again after the condition was false. `stop`: it ends the run.
    """

    at: Moment | None = None
    when: Condition | None = None
    hold: Step | None = Field(None, alias="for")
    after: Moment | None = None
    repeat: bool = False
    set: dict[Reference, Value] = {}
    override: dict[Reference, Value] = {}
    release: Some[Reference] = []
    stop: bool = False
    fault: dict[str, Any] | None = None
    description: Text = ""

    @model_validator(mode="before")
    @classmethod
    def collect_fault_keys(cls, value: Any) -> Any:
        """Collect the keys of a fault unchecked under `fault`; the hardware validates them."""
        if not isinstance(value, dict) or "fault" not in value:
            return value
        if others := [key for key in ("set", "override", "release") if key in value]:
            raise ValueError(f"`fault` and `{others[0]}` in one event. Make two events of them")
        event_keys = {key: item for key, item in value.items() if key in ("at", "when", "description")}
        return event_keys | {"fault": {key: item for key, item in value.items() if key not in event_keys}}

    @model_validator(mode="after")
    def check_combination(self) -> Self:
        """Refuse keys that do not go together."""
        if self.at is None and self.when is None:
            raise ValueError("`at` or `when` is missing. Add one, such as `at: 5 s` or `when: sensor.force > 0.3 N`")
        if self.at is not None and self.when is not None:
            raise ValueError("`at` and `when` in one event. Keep one; `after` is the begin of a condition")
        if self.fault is not None and self.at is None:
            raise ValueError("a fault happens at a time. Give `at`, not `when`")
        for key, value in {"for": self.hold, "after": self.after, "repeat": self.repeat, "stop": self.stop}.items():
            if value and self.when is None:
                raise ValueError(f"`{key}` is for events with a condition. Add `when`, or leave it out")
        return self


class RecordKeys(Keys):
    """Variables to record, with `*` as wildcard, and the interval; by default all outputs at every step."""

    every: Step | None = None
    variables: list[Pattern] = []


class WindowKeys(Keys):
    """A time window of the run."""

    start: Moment | None = Field(None, alias="from")
    stop: Moment | None = Field(None, alias="to")


class MetricKeys(WindowKeys):
    """A scalar metric of a run; `reference`: published value, or one for each variant; `codes`: names of its values."""

    signal: Signal
    reduce: Literal["mean", "std", "rms", "max_abs", "min", "max", "final", "peak_to_peak"]
    unit: Text = ""
    reference: Annotated[Any, BeforeValidator(reference_figures)] = None
    tolerance: Annotated[float, BeforeValidator(fraction)] | None = None
    variants: Some[Text] = []
    description: Text = ""
    codes: dict[int, Text] = {}


class ExpectKeys(WindowKeys):
    """An acceptance criterion: limits for every run, an order of variants by a metric's mean, or the termination on hardware."""

    name: Text = ""
    metric: str | None = None
    signal: Signal | None = None
    variants: Some[Text] = []
    excluded: Some[Text] = Field([], alias="except")
    at_least: Value | None = None
    at_most: Value | None = None
    within: Pair[Value] | None = None
    ordered: Annotated[list[Text], Field(min_length=2)] | None = None
    descending: bool = True
    margin: Value | None = None
    mean: bool = False
    nominal: bool = False  # is judged only with the parameters of its own file
    ends: Literal["stopped", "completed"] | None = None
    unit: Text = ""


class AnalysisKeys(WindowKeys):
    """A function of recorded signals; see `twin.analysis`."""

    function: Text
    inputs: Annotated[dict[str, Signal], Field(min_length=1)]
    variants: Some[Text] = []
    description: Text = ""


class CurveKeys(Keys):
    """A curve of a plot, over time or over `x`."""

    signal: Signal
    x: Signal | None = None
    label: Text = ""


def curve(value: Any) -> Any:
    """Expand a signal to the keys of a curve."""
    return {"signal": value} if isinstance(value, str) else value


class PlotKeys(WindowKeys):
    """A plot of the report: signals over time, or `xy: [x, y]`, such as a hysteresis loop."""

    title: Text
    signals: list[Annotated[CurveKeys, BeforeValidator(curve)]] = []
    xy: Pair[Signal] | None = None
    label: Text = ""
    unit: Text = ""
    x_label: Text = ""
    x_unit: Text = ""
    per: Literal["variant"] | None = None
    points: bool = False
    variants: list[Text] = []
    band: Pair[Value] | None = None
    lines: Some[Value] = []


class SceneLineKeys(Keys):
    """A polyline, such as an instrument's shape, of a given `width`."""

    signal: Reference
    label: Text = ""
    width: Value | None = None


class ScenePointKeys(Keys):
    """Points of an array, or one point at the path length `along` of the environment's path."""

    signal: Reference | None = None
    along: Signal | None = None
    label: Text = ""


class SceneArrowKeys(Keys):
    """Vectors `signal` drawn from the points `at`."""

    signal: Reference
    at: Reference
    label: Text = ""


class SceneKeys(WindowKeys):
    """An animation of a run: lines, points and arrows within an environment, and curves over time."""

    title: Text
    environment: Text = ""
    motions: dict[str, Signal] = {}
    lines: Some[Annotated[SceneLineKeys, BeforeValidator(curve)]] = []
    points: Some[Annotated[ScenePointKeys, BeforeValidator(curve)]] = []
    arrows: Some[SceneArrowKeys] = []
    signals: Some[Annotated[CurveKeys, BeforeValidator(curve)]] = []
    unit: Text = ""
    axes: Pair[Literal["x", "y", "z"]] | None = None
    variants: Some[Text] = []
    space: SpaceKeys | None = None


class ControlKeys(Keys):
    """An operator control of an input: `range` at full deflection, `rest` when released.

    `along`: inputs set to a value while the control is held. `stick`: an axis of the on-screen joystick; `keys`: for the
    upper and the lower limit, as the browser names them (`KeyboardEvent.code`); `axis`, `reverse`, `buttons`: of a
    gamepad.
    """

    input: Reference
    label: Text = ""
    description: Text = ""
    range: Value | None = None
    rest: Value | None = None
    dead_zone: Annotated[float, BeforeValidator(fraction), Field(lt=1.0)] = 0.0
    along: dict[Reference, Value] = {}
    stick: Literal["", "x", "y", "x2", "y2"] = ""
    keys: UpToTwo[Text] = ()
    axis: Annotated[int, Field(strict=True, ge=0, lt=32)] | None = None
    reverse: bool = False
    buttons: UpToTwo[Annotated[int, Field(strict=True, ge=0, lt=64)]] = ()
    variants: Some[Text] = []


class TargetKeys(Keys):
    """Targets of an operator: points that a signal reaches within `tolerance`, with a value for each of its elements."""

    signal: Reference
    points: Annotated[dict[Text, Annotated[Some[Value], Field(min_length=1)]], Field(min_length=1)]
    tolerance: Value
    path: Reference = ""
    hint: Text = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that are read."""
        return self.signal, self.path or self.signal


class WarningKeys(Keys):
    """A warning in the picture of the console while a scalar signal, its magnitude for a limit above zero, is above it."""

    signal: Reference
    minus: Reference = ""  # what is subtracted
    above: Value
    text: Text
    remedy: dict[Reference, Literal["forward", "back"]] = {}  # inputs of controls, for a positive value

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that are read."""
        return tuple(filter(None, (self.signal, self.minus)))


class ConsoleKeys(Keys):
    """The page of `twin console`: controls, targets, warnings, and the parameters and inputs listed first, each with the ends
    of its slider or an empty list.
    """

    controls: list[ControlKeys] = []
    parameters: dict[Reference, Annotated[list[Value], Field(max_length=2)]] = {}
    targets: TargetKeys | None = None
    warnings: list[WarningKeys] = []


class RunKeys(Keys):
    """Keys that a variant may change."""

    title: Text = ""
    stop_time: Moment | None = None
    step: Step | None = None
    algorithm: Method = None
    members: dict[str, MemberKeys | None] = {}
    connections: list[ConnectionKeys] = []
    events: list[EventKeys] | None = None
    parameter_sets: list[dict[Text, dict[str, Value]]] = []


class ValidityKeys(Keys):
    """The latest stop time for which a scenario is valid, and the reason."""

    stop_time: Moment
    reason: Annotated[str, Field(min_length=1)]


class MutationKeys(Keys):
    """Result of mutation tests of the expectations: number of mutations, and undetected ones with the reason."""

    tried: Annotated[int, Field(strict=True, ge=0)]
    unnoticed: dict[Text, Text] = {}


class ScenarioKeys(RunKeys):
    """A scenario file."""

    description: Text = ""
    summary: Text = ""
    topic: Text = ""
    source: Text = ""
    extends: Text = ""
    start_time: Moment = 0
    threads: Threads = None
    seeds: Annotated[list[Seed], Field(min_length=1)] = [0]
    seed: Seed | None = None
    variants: dict[str, RunKeys | None] = {}
    record: RecordKeys = RecordKeys()
    analyses: dict[str, AnalysisKeys] = {}
    metrics: dict[str, MetricKeys] = {}
    expect: list[ExpectKeys] = []
    plots: list[PlotKeys] = []
    scenes: list[SceneKeys] = []
    groups: dict[str, Annotated[Some[Text], Field(min_length=1)]] = {}
    console: ConsoleKeys = ConsoleKeys()
    valid_until: ValidityKeys | None = None
    mutations: MutationKeys | None = None
