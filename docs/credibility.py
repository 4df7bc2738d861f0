"""Write the tables of docs/explanation/credibility.md and docs/data, from runs made now.

python docs/credibility.py                  all, five minutes when nothing else runs
python docs/credibility.py orders           those tables alone: orders, balance, steps, validation, sensitivity
"""

from __future__ import annotations

import itertools
import json
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import uncertainty
from co_simulation import FIXED, PAIRS, error, order, percent, reference
from fmus.sheath.model import NODES, Sheath
from tables import cells, select, write_data, write_table
from uncertainty import METRICS, VARIANTS

from twin.component import Component, output, solver, state
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Values = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "explanation" / "credibility.md"
BUILD = ROOT / "build"


# ---------------------------------------------------------------------------------------------------- code verification

METHODS = {"euler": solver.euler, "heun": solver.heun, "rk4": solver.rk4, "ros2": solver.ros2}
COUPLED = ("jacobi", "jacobi, order 1", "gauss_seidel, order 1", "energy", "iterative, order 1")
PAIR = "two masses, force"


def oscillator(method_: solver.Method) -> Any:
    """Position and speed of a unit mass on a unit spring: a cosine."""

    class Oscillator(Component):
        method = method_
        x = state((1.0, 0.0), "", "position and speed")
        y = output("", "position")

        def derivatives(self, t):  # noqa: ANN001, ANN202, ARG002
            self.der_x[0] = self.x[1]
            self.der_x[1] = -self.x[0]
            self.y = self.x[0]

    part = Oscillator()
    part.start()
    for k in range(10):
        part.advance(0.1 * k, 0.1)
    return part


def orders() -> str:
    """Observed orders of the methods of integration, and of the coupling algorithms, against solutions in closed form."""
    rows = ["| what | compared with | order expected | observed |", "|---|---|---|---|"]
    for name, method in METHODS.items():
        errors = [abs(float(oscillator(method(step)).y) - np.cos(1.0)) for step in (0.02, 0.01)]
        rows.append(f"| {name} | cos t | {method(1.0).order} | {np.log2(errors[0] / errors[1]):.2f} |")
    exact = reference(PAIRS[PAIR])
    for name in COUPLED:
        errors = [error(PAIRS[PAIR], FIXED[name], step, exact)[0] for step in PAIRS[PAIR].steps]
        told = 1 if name == "jacobi" else 2
        rows.append(f"| {name} | two masses, uncut, DOP853 to 1e-12 | {told} | {order(errors)} |")
    return "\n".join(rows)


def balance() -> str:
    """Energy that the sheath takes in, keeps and turns into heat: what is missing, over the step of integration."""
    rows = ["| step of integration | work in | heat | kept | missing |", "|---|---|---|---|---|"]
    for step in (0.2e-3, 0.1e-3):
        work, heat, kept = balanced(step)
        missing = percent(abs(work - heat - kept) / work)
        rows.append(
            f"| {1e3 * step:g} ms | {1e3 * work:.3f} mJ | {1e3 * heat:.3f} mJ | {1e3 * kept:.3f} mJ | {missing} |"
        )
    return "\n".join(rows)


def balanced(step: float, seconds: float = 1.3) -> tuple[float, float, float]:
    """Work, heat by the laws of friction and drag, and stored energy [J] of the sheath.

    Its gripper goes to and fro by 5 mm at 1 Hz; 0.2 N act on the tip.
    """
    finer = type("Finer", (Sheath,), {"method": solver.rk4(step), "__doc__": Sheath.__doc__})
    sheath = finer(contact_force=0.2)
    sheath.start()
    steps = round(seconds / step)
    times = step * np.arange(steps + 1)
    gripper = 5e-3 * np.sin(2.0 * np.pi * times)
    place, speed = np.zeros((steps + 1, NODES)), np.zeros((steps + 1, NODES))
    thrust = np.zeros((steps + 1, NODES + 1))
    for k in range(steps + 1):
        if k:
            sheath.gripper_position = 0.5 * (gripper[k - 1] + gripper[k])
            sheath.advance(times[k - 1], step)
        sheath.gripper_position = gripper[k]
        sheath.derivatives(times[k])
        place[k], speed[k], thrust[k] = sheath.position, np.abs(sheath.der_position), sheath.thrust
    pressed = np.asarray(sheath.wrap) * 0.5 * (np.abs(thrust[:, :-1]) + np.abs(thrust[:, 1:]))
    friction = np.asarray(sheath.friction) + sheath.friction_coefficient * pressed + np.asarray(sheath.drag) * speed
    stored = 0.5 * thrust[:, :-1] ** 2 / np.asarray(sheath.stiffness)
    work = np.trapezoid(thrust[:, 0], gripper) - 0.2 * (place[-1, -1] - place[0, -1])
    heat = np.trapezoid(np.sum(friction * speed, axis=1), times)
    return float(work), float(heat), float(np.sum(stored[-1] - stored[0]))


# ----------------------------------------------------------------------------------------------- calculation verification

STEPS = {"1 ms": {}, "0.5 ms": {"step": "0.5 ms"}, "0.25 ms": {"step": "0.25 ms"}}
DRIVE = {"members": {"servomotor": {"communication_step": "0.5 ms"}}}  # its loops sample every 0.5 ms
SAFETY = 1.25  # of an estimate from three grids: Roache, as ASME V&V 20 has it


def steps() -> str:
    """The force rows over the communication step, and what the step of 1 ms may be off by."""
    found = {
        name: uncertainty.figures({**patch, **(DRIVE if name == "0.25 ms" else {})}) for name, patch in STEPS.items()
    }
    rows = [f"| figure | {' | '.join(STEPS)} | u_num at 1 ms |", "|---" * (len(STEPS) + 2) + "|"]
    for k, variant in enumerate(VARIANTS):
        for j, metric in enumerate(METRICS):
            values = [one[k, j] for one in found.values()]
            cells = " | ".join(f"{one:.2f} mN" for one in values)
            rows.append(f"| {metric}, {variant} | {cells} | {numerical(values):.2f} mN |")
    return "\n".join(rows)


def numerical(values: list[float]) -> float:
    """Uncertainty of the first of figures at steps that are halved: distance to the finest, extended by the first order."""
    return SAFETY * abs(values[0] - values[-1]) * 4.0 / 3.0


# ------------------------------------------------------------------------------------------------------------ validation

FIT, ADJUSTED, ASSUMED, PREDICTION = "fit", "adjusted", "assumed", "prediction"

# scenario -> (metric, what its variants' names begin with, how it came about, what the comparison may be used for)
ROWS: dict[str, tuple[tuple[str, str, str, str], ...]] = {
    "heart_wall_replay": (
        ("force_error_std", "PI+FF+BW", ADJUSTED, "silicone; one machine"),
        ("force_error_std", "PI+FF", ADJUSTED, "silicone; one machine"),
        ("force_error_std", "PI", FIT, "length of the free tip"),
        ("force_error_max", "", ADJUSTED, "largest of ten seconds"),
    ),
    "linear_grip": (("slip_load", "", FIT, "two values for two figures of each instrument"),),
    "rotational_grip": (("slip_torque", "", FIT, "one value for each instrument"),),
    "rotation": (
        ("error", "catheter, 72", FIT, "stiffness; other speeds follow from friction without speed"),
        ("error", "guidewire, 72", FIT, "friction; other speeds follow from friction without speed"),
        ("error", "", ASSUMED, "friction without speed"),
    ),
    "stepper_calibration": (("lead", "", FIT, "an input"), ("lead_deviation", "", FIT, "an input")),
    "needle": (
        ("slope", "", FIT, "an input"),
        ("per_pull", "", FIT, "an input"),
        ("table_std", "", FIT, "scatter fitted"),
        ("table_mean", "", PREDICTION, "the cause is not known"),
    ),
    "coordinate_feedforward": (
        ("rms_z", "unmodified", PREDICTION, "planar, no contact"),
        ("rms_y", "unmodified", PREDICTION, "planar, no contact"),
        ("rms_z", "calibrated", FIT, "circular: see the injection catheter"),
        ("rms_y", "calibrated", FIT, "circular: see the injection catheter"),
    ),
    "hysteresis_identification": (
        ("tracking_error_std", "uncompensated", FIT, "stiffness of the sheath"),
        ("tracking_error_std", "compensated", ADJUSTED, "free in air"),
        ("tracking_error_max", "", ADJUSTED, "free in air"),
    ),
    "tip_tracking": (
        ("error_std", "", PREDICTION, "fiber of estimated errors"),
        ("error_max", "", PREDICTION, "fiber of estimated errors"),
    ),
}


def kind_of(scenario: str, metric: str, variant: str) -> tuple[str, str] | None:
    """How a row came about, and what it may be used for; the first that fits."""
    for name, begin, kind, use in ROWS[scenario]:
        if name == metric and variant.startswith(begin):
            return kind, use
    return None


def summary_of(name: str) -> dict[str, Any]:
    """Metrics of a scenario, run as it is."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_scenario(
            load_scenario(ROOT / "scenarios" / f"{name}.yaml"), RunOptions(root=Path(folder), build=BUILD, report=False)
        )
        metrics: dict[str, Any] = json.loads((outcome.folder / "summary.json").read_text())["metrics"]
    return metrics


def validation() -> str:
    """Each published figure: S, D, E = S - D, and the spread over seeds, in multiples of which E is given."""
    rows = [
        "| scenario, figure, variant | D, paper | S, twin | s over seeds | E = S - D | E / D | abs(E) / s | kind | comparator, use |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in ROWS:
        for metric, one in summary_of(name).items():
            for variant, figure in one["variants"].items():
                told = kind_of(name, metric, variant) if figure["paper"] is not None else None
                if told is not None:
                    rows.append(row(f"{name}, {metric}, {variant}", one["unit"], figure, told))
    return "\n".join(rows)


def row(label: str, unit: str, figure: Mapping[str, Any], told: tuple[str, str]) -> str:
    """One published figure beside the twin's."""
    values, paper = list(figure["values"].values()), figure["paper"]
    off, spread = figure["mean"] - paper, float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
    ratio = f"{abs(off) / spread:.1f}" if spread > 1e-9 * abs(paper) else "-"  # steps of a sensor hide the spread
    seeds = f"{spread if ratio != '-' else 0.0:.2g} {unit}, {len(values)}" if len(values) > 1 else "-, 1"
    cells = [
        f"{paper:.4g} {unit}",
        f"{figure['mean']:.4g} {unit}",
        seeds,
        f"{off:+.2g} {unit}",
        f"{100 * off / paper:+.0f} %",
        ratio,
    ]
    return f"| {label} | {' | '.join(cells)} | {told[0]} | {told[1]} |"


# ---------------------------------------------------------------------------------------------- uncertainty and agreement

SEEDS = range(1, 11)
PAPER = {"PI": (36.2, 78.2), "PI+FF": (23.8, 52.0), "PI+FF+BW": (11.9, 25.3)}  # [mN], section V.B
CLINICAL = 100.0  # distance of the setpoint to the lower limit of force [mN]
BEATS = 30  # of three repeats of ten seconds at 1 Hz
U_DATA = 1.0 / np.sqrt(2.0 * (BEATS - 1))  # of a standard deviation, relative, as if each beat were one sample


def agreement(found: Values) -> str:
    """E = S - D of the force rows beside u_val, after ASME V&V 20: u_val^2 = u_num^2 + u_input^2 + u_seed^2 + u_D^2."""
    seeds = np.array([uncertainty.figures({}, seed) for seed in SEEDS])
    fine = uncertainty.figures({**STEPS["0.25 ms"], **DRIVE})
    columns = [
        "figure",
        "D, paper",
        "S, twin",
        "E = S - D",
        "u_num",
        "u_input",
        "u_seed",
        "u_D",
        "u_val",
        "E / u_val",
        "inputs, 5 to 95 %",
    ]
    rows = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for k, variant in enumerate(VARIANTS):
        for j, metric in enumerate(METRICS):
            paper, twin = PAPER[variant][j], float(seeds[:, k, j].mean())
            parts = (
                numerical([seeds[0, k, j], fine[k, j]]),
                found[:, k, j].std(ddof=1),
                seeds[:, k, j].std(ddof=1),
                U_DATA * paper,
            )
            whole = float(np.sqrt(np.sum(np.square(parts))))
            low, high = np.percentile(found[:, k, j], (5, 95))
            cells = [f"{paper:.1f}", f"{twin:.1f}", f"{twin - paper:+.1f}", *(f"{one:.2f}" for one in (*parts, whole))]
            cells += [f"{(twin - paper) / whole:+.1f}", f"{low:.1f} to {high:.1f}"]
            rows.append(f"| {metric}, {variant} [mN] | {' | '.join(cells)} |")
    return "\n".join(rows)


def order_table(found: Values) -> str:
    """In how many of the plants the controllers are in the paper's order, and what is left to the clinical limit."""
    deviations = found[:, :, 0]
    rows = ["| of the plants drawn | |", "|---|---|"]
    for k, (one, other) in enumerate(itertools.pairwise(VARIANTS)):
        count = int(np.sum(deviations[:, k + 1] < deviations[:, k]))
        rows.append(f"| {other} better than {one} | {count} of {len(found)} |")
    for k, variant in enumerate(VARIANTS):
        count = int(np.sum(found[:, k, 1] < CLINICAL))
        rows.append(f"| force within 0.1 to 0.3 N with {variant} | {count} of {len(found)} |")
    return "\n".join(rows)


TABLES: dict[str, Callable[[], str]] = {"orders": orders, "balance": balance, "steps": steps, "validation": validation}
FILES = {"orders": "convergence_orders", "balance": "energy_balance", "steps": "communication_steps"}  # of docs/data
MOVING = (
    "wall.bending_stiffness",
    "sheath.stiffness",
    "sheath.friction",
    "sheath.friction_coefficient",
    "sheath.drag",
    "heart.scale",
)


def write_tables(tables: Mapping[str, str]) -> None:
    """Write the complete tables to docs/data, and what the page shows of them into the page."""
    for name, text in tables.items():
        write_data(FILES.get(name, name), text)
    if "validation" in tables:
        rows = [row[0] for row in cells(tables["validation"]) if row[7] == PREDICTION]
        write_table(PAGE, "validation", select(tables["validation"], rows, (0, 1, 2, 5, 6)))
    if "agreement" in tables:
        write_table(PAGE, "agreement", select(tables["agreement"], None, (0, 1, 2, 3, 8, 9)))
        write_table(PAGE, "sensitivity", select(tables["sensitivity"], MOVING, (0, 1, 4, 8)))


def main(asked: list[str]) -> None:
    """Make the tables that are asked for, or all."""
    tables = {name: made() for name, made in TABLES.items() if not asked or name in asked}
    if not asked or "sensitivity" in asked:
        points, found = uncertainty.hypercube()
        tables["order_of_controllers"] = order_table(found)
        tables["agreement"] = agreement(found)
        single = uncertainty.one_at_a_time()
        tables["sensitivity"] = uncertainty.sensitivity_table(single, uncertainty.morris(), points, found)
    write_tables(tables)


if __name__ == "__main__":
    main(sys.argv[1:])
