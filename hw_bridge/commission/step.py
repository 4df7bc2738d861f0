"""Step response of a drive, compared with the simulated drive's, and identification of its gains."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log
from typing import TYPE_CHECKING, Any

import numpy as np

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.commission.single_axis_session import SingleAxisSession
from hw_bridge.device import Drive, Motor
from hw_bridge.plant import store_motor_parameters
from hw_bridge.profiles import motor_parameters

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys

BEFORE, AFTER = 0.05, 0.4  # recorded around the step [s]
GAINS = ("velocity_gain", "position_gain")  # of a motor's component
WIDEST = 8.0  # largest factor of the search
SETTLING_BAND = 0.05  # of the step, to count as settled
EXPLAINED = 0.5  # share of the difference that gains have to explain to be reported


@dataclass(frozen=True)
class Response:
    """Time since the step [s], displacement [m or rad], current [A]; one row for each cycle."""

    time: Any
    displacement: Any
    current: Any
    step: float

    def figures(self) -> dict[str, float]:
        """Rise time from 10 to 90 % [s], overshoot [share], settling time [s], remaining error [m or rad]."""
        part = self.displacement / self.step
        inside = np.abs(part - 1.0) <= SETTLING_BAND
        settled = self.time[len(inside) - int(np.argmin(inside[::-1]))] if not inside.all() and inside[-1] else np.nan
        first = [self.time[np.argmax(part >= level)] if (part >= level).any() else np.nan for level in (0.1, 0.9)]
        return {
            "rise": float(first[1] - first[0]),
            "overshoot": float(max(part.max() - 1.0, 0.0)),
            "settled": float(settled),
            "left": float(self.step - self.displacement[-1]),
        }


def response(session: SingleAxisSession, step: float) -> Response:
    """Hold, then step the target by `step`; at the end go back with a ramp."""
    begin, here = session.node.target_position, len(session.samples)
    session.rest(round(BEFORE * 1e9))
    start = session.samples[-1]
    until = session.network.now + round(AFTER * 1e9)
    while session.network.now < until:
        session.go(begin + step)
    samples = session.samples[here:]
    limits = session.keys.limits
    session.move(begin, 0.1 * limits.velocity, 0.1 * limits.acceleration)
    return Response(
        np.array([sample.time for sample in samples]) - start.time,
        np.array([sample.position for sample in samples]) - start.position,
        np.array([sample.current for sample in samples]),
        step,
    )


def simulated(keys: HardwareKeys, name: str, step: float, build: Path, gains: dict[str, float]) -> Response:
    """Step response of the profile's drive in simulated time; `gains`: factors on its motor's component."""
    own = keys.nodes[name]
    chosen = own.drive
    parameters = motor_parameters(chosen, own.motor)
    motor = Motor(parameters.model, build=build)
    drive = store_motor_parameters(Drive(chosen, own.node, motor), parameters)
    for gain, factor in gains.items():
        motor.scale(gain, factor)
    bus = Bus(keys.bit_rate)
    bus.attach(drive)
    session = SingleAxisSession(keys.model_copy(update={"simulated": True}), name, SimulatedNetwork(bus))
    with session.enabled():
        return response(session, step)


def difference(real: Response, twin: Response) -> float:
    """RMS of the distance between two responses, at the times of the first [m or rad]."""
    return float(np.sqrt(np.mean((real.displacement - np.interp(real.time, twin.time, twin.displacement)) ** 2)))


def explain(
    real: Response, keys: HardwareKeys, name: str, build: Path
) -> tuple[Response, dict[str, float], list[float]]:
    """Return the twin's response, the best-fitting gain factors, and the difference before and after [m or rad].

    One gain after the other, each by a bounded search: with friction and saturation there is no formula.
    """
    from scipy.optimize import minimize_scalar

    def gain_difference(gains: dict[str, float]) -> float:
        return difference(real, simulated(keys, name, real.step, build, gains))

    plain = simulated(keys, name, real.step, build, {})
    fitted: dict[str, float] = {}
    before = least = difference(real, plain)
    for gain in GAINS:
        best = minimize_scalar(
            lambda power, gain=gain: gain_difference({**fitted, gain: exp(power)}),
            bounds=(-log(WIDEST), log(WIDEST)),
            method="bounded",
            options={"maxiter": 12, "xatol": 0.02},
        )
        if best.fun < least:
            fitted[gain], least = exp(float(best.x)), float(best.fun)
    return plain, fitted, [before, least]


def picture(path: Path, curves: dict[str, Response], unit: str, factor: float) -> None:
    """Draw displacement and current over time, one line for each response, as SVG."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from twin.results import figure_files as figures
    from twin.results import plotting

    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": "step"}):
        figure = Figure(figsize=(plotting.WIDTH, 4.6), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for (label, curve), color, style in zip(curves.items(), plotting.COLORS, plotting.LINE_STYLES, strict=False):
            above.plot(1e3 * curve.time, factor * curve.displacement, color=color, linestyle=style, label=label)
            below.plot(1e3 * curve.time, curve.current, color=color, linestyle=style)
        step = next(iter(curves.values())).step
        above.axhline(factor * step, color="#7b8794", linestyle=":", label="target")
        above.set_ylabel(f"way [{unit}]")
        below.set_ylabel("current [A]")
        below.set_xlabel("time since the step [ms]")
        above.legend()
        path.write_text(figures.figure_to_svg(figure))
