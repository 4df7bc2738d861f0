"""What the force experiment's figures owe to what is not known of its plant: one at a time, Morris, and a Latin hypercube.

    python docs/uncertainty.py

prints the tables that `docs/credibility.py` writes into its page.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from coordinates import patched, ran
from scipy.stats import qmc, rankdata

from twin.run import apply_analyses, resolve_catalogs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Values = NDArray[np.float64]

SCENARIO = "heart_wall_replay"
VARIANTS = ("PI", "PI+FF", "PI+FF+BW")
METRICS = ("force_error_std", "force_error_max")
SAMPLES, TRAJECTORIES, SEED = 64, 6, 1  # SEED of the samples; the runs have the scenario's first
MILLI = 1e3  # of N

# parameter -> unit, value, least and largest, why so
UNCERTAIN: dict[str, tuple[str, float | tuple[float, ...], float, float, str]] = {
    "wall.bending_stiffness": ("N*m^2", 4.3e-4, 0.8, 1.2, "EI over a length chosen for the PI row; 20 %"),
    "sheath.stiffness": ("N/m", (2.2e3, 12e3, 12e3), 0.8, 1.2, "identified from tracking; 20 %"),
    "sheath.play": ("m", (0.0, 0.3e-3, 0.3e-3), 0.8, 1.2, "clearance by angle; 20 %"),
    "sheath.friction": ("N", (0.6, 0.8, 0.8), 0.8, 1.2, "estimate; 20 %"),
    "sheath.friction_coefficient": ("", 0.15, 1 / 3, 4 / 3, "estimate: 0.05 to 0.2"),
    "sheath.drag": ("N*s/m", (6.0, 3.0, 3.0), 0.5, 2.0, "the weakest source; half to double"),
    "servomotor.mass": ("kg", 0.65, 0.8, 1.2, "estimate; 20 %"),
    "sensor.noise": ("N", 3e-3, 0.5, 1.5, "estimate: about the resolution; 50 %"),
    "estimate.fiber.noise": ("m", 0.5e-12, 0.6, 2.0, "recalled: 0.3 to 1 pm"),
    "heart.scale": ("", 1.0, 0.95, 1.13, "10.65 mm printed, about 12 mm in the text"),
    "wall.wall_modulus": ("Pa", 105e3, 0.5, 2.0, "estimate of the silicone; half to double"),
}
NAMES = tuple(UNCERTAIN)


def parameters(unit: Values) -> dict[str, Any]:
    """Members' parameters of a point of the unit cube; its middle is not the nominal value where ranges are lopsided."""
    members: dict[str, Any] = {}
    for name, share in zip(NAMES, unit, strict=True):
        symbol, nominal, low, high, _ = UNCERTAIN[name]
        factor = low + (high - low) * share
        member, _, parameter = name.partition(".")
        texts = [f"{factor * one:.9g} {symbol}".strip() for one in np.atleast_1d(nominal)]
        value = texts if isinstance(nominal, tuple) else texts[0]
        members.setdefault(member, {"parameters": {}})["parameters"][parameter] = value
    return members


def nominal() -> Values:
    """Where the scenario is in the unit cube."""
    return np.array([(1.0 - low) / (high - low) for _, _, low, high, _ in UNCERTAIN.values()])


def figures(patch: Mapping[str, Any], seed: int = 1) -> Values:
    """Standard deviation and maximum of the force error [mN], a row for each controller, of a patched scenario."""
    scenario = patched(SCENARIO, patch)
    catalogs = resolve_catalogs(scenario)
    found = []
    for case in scenario.cases(list(VARIANTS), [seed]):
        table = apply_analyses(scenario, case.variant, ran(case, catalogs))
        found.append([MILLI * reduced(table, scenario.metrics[one]) for one in METRICS])
    return np.array(found)


def reduced(table: Any, metric: Any) -> float:
    """A metric's value in SI."""
    from twin.results import evaluate

    result = evaluate({metric.name: metric}, [], {("", 0): table})
    return float(result.metric_results[0].values[0])


def at(unit: Values) -> Values:
    """The same at a point of the unit cube."""
    return figures({"members": parameters(unit)})


def one_at_a_time() -> dict[str, tuple[Values, Values]]:
    """Parameter -> standard deviations at its least and its largest value, all others nominal."""
    found = {}
    for index, name in enumerate(NAMES):
        ends = np.tile(nominal(), (2, 1))
        ends[:, index] = (0.0, 1.0)
        found[name] = (at(ends[0])[:, 0], at(ends[1])[:, 0])
    return found


def morris(trajectories: int = TRAJECTORIES) -> tuple[Values, Values]:
    """Mean of the absolute elementary effects and their standard deviation [mN per range]: parameter x controller.

    Morris, Technometrics 33(2), 1991; radial, as Campolongo et al., Comput. Phys. Commun. 182(4), 2011: from each base point
    one parameter after the other is exchanged for that of another point.
    """
    count = len(NAMES)
    points = qmc.Sobol(2 * count, rng=SEED).random(2 ** int(np.ceil(np.log2(trajectories))))[:trajectories]
    effects = np.zeros((trajectories, count, len(VARIANTS)))
    for k, point in enumerate(points):
        base, other = point[:count], point[count:]
        begin = at(base)[:, 0]
        for i in range(count):
            changed = base.copy()
            changed[i] = other[i]
            effects[k, i] = (at(changed)[:, 0] - begin) / (other[i] - base[i])
    return np.abs(effects).mean(axis=0), effects.std(axis=0, ddof=1)


def hypercube(samples: int = SAMPLES) -> tuple[Values, Values]:
    """Points of the unit cube and the figures there: sample x controller x metric."""
    points = qmc.LatinHypercube(len(NAMES), rng=SEED).random(samples)
    return points, np.array([at(one) for one in points])


def first_order(points: Values, found: Values) -> tuple[Values, float]:
    """Part of the variance that each parameter explains by itself, linear in ranks; and of all together, R2."""
    x = np.apply_along_axis(rankdata, 0, points)
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    y = rankdata(found)
    y = (y - y.mean()) / y.std()
    slopes = np.linalg.lstsq(x, y, rcond=None)[0]
    return slopes**2, float(1.0 - np.var(y - x @ slopes))


def sensitivity_table(
    single: Mapping[str, tuple[Values, Values]], effects: tuple[Values, Values], points: Values, found: Values
) -> str:
    """One row for each parameter."""
    columns = [
        *(f"one at a time, {one}" for one in VARIANTS),
        "Morris, PI+FF+BW",
        *(f"first order, {one}" for one in VARIANTS),
    ]
    rows = [f"| parameter | range | {' | '.join(columns)} |", "|---" * (len(columns) + 2) + "|"]
    orders = [first_order(points, found[:, k, 0]) for k in range(len(VARIANTS))]
    for i, name in enumerate(NAMES):
        low, high = UNCERTAIN[name][2:4]
        cells = [f"{single[name][0][k]:.1f} to {single[name][1][k]:.1f} mN" for k in range(len(VARIANTS))]
        cells.append(f"{effects[0][i, -1]:.2f} ({effects[1][i, -1]:.2f}) mN")
        cells += [f"{100 * order[0][i]:.0f} %" for order in orders]
        rows.append(f"| {name} | {low:.2g} to {high:.2g} | {' | '.join(cells)} |")
    explained = " | ".join(f"{100 * order[1]:.0f} %" for order in orders)
    rows.append(f"| all together, R2 |{' |' * (len(VARIANTS) + 2)} {explained} |")
    return "\n".join(rows)


def main() -> None:
    """Print the tables."""
    points, found = hypercube()
    print(sensitivity_table(one_at_a_time(), morris(), points, found))


if __name__ == "__main__":
    main()
