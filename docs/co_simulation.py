"""Measure the algorithms for docs/explanation/co_simulation.md: tables and figures, from runs made now.

python docs/co_simulation.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).parents[1]))

from figures import ROOT, save
from tables import select, write_data, write_table

from benchmarks.couplings import PAIRS, Pair
from twin import compiler
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem, RecordMember
from twin.errors import TwinError
from twin.results import plotting
from twin.run import build_simulation, noop, resolve_catalogs, run_case
from twin.scenario import Backend, load_scenario

if TYPE_CHECKING:
    from collections.abc import Iterator

PAGE = ROOT / "docs" / "explanation" / "co_simulation.md"
SELECTED: dict[str, tuple[tuple[str, ...], tuple[int, ...] | None]] = {  # rows and columns of the page's tables
    "orders": (
        (
            "jacobi",
            "gauss_seidel",
            "gauss_seidel, order 1",
            "energy",
            "iterative, order 2",
        ),
        (0, 1, 6),
    ),
    "force": (("jacobi", "gauss_seidel, order 1", "step_doubling, order 1"), None),
}
BUILD = ROOT / "build"
MS = 1_000_000  # [ns]
POINTS = 16  # of a run that are compared
LONG = 400  # steps in which an unstable coupling shows it
LARGEST = 200.0  # step that is tried [ms]
FINEST = 1.05  # ratio to which a limit is found

NEWTON = {"acceleration": "newton", "agreement": 1e-9}
FIXED = {
    "jacobi": Algorithm("jacobi"),
    "jacobi, order 1": Algorithm("jacobi", order=1),
    "jacobi, order 1, smoothing 1": Algorithm("jacobi", order=1, smoothing=1.0),
    "jacobi, order 2": Algorithm("jacobi", order=2),
    "gauss_seidel": Algorithm("gauss_seidel"),
    "gauss_seidel, order 1": Algorithm("gauss_seidel", order=1),
    "gauss_seidel, order 2": Algorithm("gauss_seidel", order=2),
    "energy": Algorithm("energy"),
    "iterative": Algorithm("iterative", **NEWTON),
    "iterative, order 1": Algorithm("iterative", order=1, **NEWTON),
    "iterative, order 2": Algorithm("iterative", order=2, **NEWTON),
}
SHOWN = ("jacobi", "jacobi, order 1", "gauss_seidel, order 1", "energy", "iterative, order 1")  # in the figure
CHOOSING = {"step_doubling": {"order": 1}, "predictive": {"order": 1}, "ecco": {"order": 1}}
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
FIRST = "two masses, force"  # what its left half is of
WORK = "quarter car, progressive damper, force"  # what the right half of the figure is of


def coupled(pair: Pair, algorithm: Algorithm, step: int, every: int) -> CoSimulation:
    """A pair of masses, compiled. Where it is cut at a force, that and the place back are a power bond."""
    members = {
        name: RecordMember(name, part, compiler.load_component(type(part), BUILD))
        for name, part in pair.parts().items()
    }
    bond = "between" if pair.is_bond else ""
    ends = [Connection(source, target, bond=bond) for source, target in pair.connections]
    links = CoupledSystem({name: one.variables for name, one in members.items()}, ends).links()
    record = [("a", "x"), ("b", "x")]
    return CoSimulation(members, links, step, algorithm, build=BUILD, record=record, every=every)


def ran(pair: Pair, algorithm: Algorithm, step: int, stop: int, every: int) -> tuple[Any, int, CoSimulation]:
    """Places of both masses over time, steps of all members, and the co-simulation; TwinError if it fails."""
    simulated = coupled(pair, algorithm, step, every)
    try:
        simulated.initialize(0, stop)
        simulated.advance(stop)
    finally:
        simulated.terminate()
    signals = simulated.recording().signals
    sweeps = int(simulated.state["sweeps"]) or stop // step
    return np.array([signals["a.x"], signals["b.x"]]), sweeps, simulated


def reference(pair: Pair) -> Any:
    """Places of both masses at the points that are compared, from equations that are not cut."""
    times = np.linspace(0.0, pair.duration / 1e3, POINTS + 1)
    begin = [pair.begin, 0.0, 0.0, 0.0]
    return solve_ivp(lambda _, y: pair.rates(y), (0.0, times[-1]), begin, "DOP853", times, rtol=1e-12, atol=1e-15).y[
        [0, 2]
    ]


def error(pair: Pair, algorithm: Algorithm, step: float, exact: Any) -> tuple[float, int]:
    """Largest error relative to where the first mass began, and the steps made; `step` [ms]."""
    stop = pair.duration * MS
    try:
        places, sweeps, _ = ran(pair, algorithm, round(step * MS), stop, stop // POINTS)
    except TwinError:
        return np.inf, 0
    return float(np.abs(places - exact).max()) / pair.begin, sweeps


def is_stable(pair: Pair, algorithm: Algorithm, step: float) -> bool:
    """Whether a coupling that decays by itself decays with this step [ms], and iterations come to an end."""
    size = round(step * MS)
    try:
        places, _, simulated = ran(pair, algorithm, size, LONG * size, size)
    except TwinError:
        return False
    largest = np.abs(places).max(axis=0)
    quarter = LONG // 4
    return not simulated.notes and bool(largest[-quarter:].max() < largest[:quarter].max())


def limit(pair: Pair, algorithm: Algorithm) -> float:
    """The longest step [ms] up to which all are stable; infinite if none that was tried is not."""
    step = min(pair.steps)
    while is_stable(pair, algorithm, step):
        step *= 1.25
        if step > LARGEST:
            return np.inf
    good, bad = step / 1.25, step
    while bad / good > FINEST:
        middle = np.sqrt(good * bad)
        good, bad = (middle, bad) if is_stable(pair, algorithm, middle) else (good, middle)
    return good


def measured() -> dict[str, dict[str, list[float]]]:
    """Errors by pair, algorithm and step."""
    found: dict[str, dict[str, list[float]]] = {}
    for name, pair in PAIRS.items():
        exact = reference(pair)
        found[name] = {
            shown: [error(pair, one, step, exact)[0] for step in pair.steps]
            for shown, one in FIXED.items()
            if pair.is_bond or not one.correction
        }
    return found


def order(errors: list[float]) -> str:
    """The order between the two shortest steps."""
    return f"{np.log2(errors[-2] / errors[-1]):.1f}"


def tables(errors: dict[str, dict[str, list[float]]]) -> Iterator[tuple[str, str]]:
    """Text of the tables by name: measured orders, errors, limits of stability."""
    head = f"| algorithm | {' | '.join(PAIRS)} |\n{'|---' * (len(PAIRS) + 1)}|"

    def rows(cell: Any) -> str:
        lines = (
            f"| {shown} | {' | '.join(cell(name, shown) if shown in errors[name] else '-' for name in PAIRS)} |"
            for shown in FIXED
        )
        return "\n".join([head, *lines])

    def accuracy(name: str, shown: str) -> str:
        own = dict(zip(PAIRS[name].steps, errors[name][shown], strict=True))
        return f"{order(errors[name][shown])}: {percent(own[4])}, {percent(own[1])}"

    def stability(name: str, shown: str) -> str:
        found = limit(PAIRS[name], FIXED[shown])
        return f"{found:.{0 if found >= 10 else 1}f} ms" if np.isfinite(found) else f"> {LARGEST:.0f} ms"

    yield "orders", rows(accuracy)
    yield "limits", rows(stability)


def percent(value: float) -> str:
    """A relative error for people."""
    return f"{100 * value:.2g} %" if value < 1 else "unstable"


def work() -> str:
    """Errors of algorithms that choose their steps, and how many they made."""
    pair = PAIRS[WORK]
    exact = reference(pair)
    rows = ["| algorithm | tolerance | error | steps of each member |", "|---|---|---|---|"]
    for name, options in CHOOSING.items():
        for tolerance in TOLERANCES:
            found, count = error(pair, Algorithm(name, tolerance=tolerance, **options), max(pair.steps), exact)
            told = ", ".join(f"{key} {value}" for key, value in options.items())
            rows.append(f"| {name}, {told} | {tolerance:g} | {percent(found)} | {count} |")
    return "\n".join(rows)


def draw(errors: dict[str, dict[str, list[float]]]) -> None:
    """Error over step, and over the steps that members make for it."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for number, shown in enumerate(SHOWN):
        style = {"color": plotting.COLORS[number], "markersize": 3}
        left.loglog(PAIRS[FIRST].steps, errors[FIRST][shown], "o-", label=shown, **style)
        pair, exact = PAIRS[WORK], reference(PAIRS[WORK])
        points = [error(pair, FIXED[shown], step, exact) for step in pair.steps]
        right.loglog([count for _, count in points], [found for found, _ in points], "o-", **style)
    for power, begin in ((1, 4e-3), (2, 4e-5)):
        left.loglog((1.0, 8.0), (begin, begin * 8.0**power), color="0.6", linewidth=0.8)
        left.annotate(f"order {power}", (1.0, begin), color="0.4", fontsize=8)
    left.set(xlabel="step [ms]", ylabel="largest error / begin", title=FIRST, ylim=(1e-5, 3.0))
    left.legend(fontsize=8)
    for marker, (shown, options) in zip("sdv", CHOOSING.items(), strict=True):
        pair, exact = PAIRS[WORK], reference(PAIRS[WORK])
        points = [error(pair, Algorithm(shown, tolerance=one, **options), max(pair.steps), exact) for one in TOLERANCES]
        places = [count for _, count in points], [found for found, _ in points]
        right.loglog(*places, f"{marker}--", color="0.3", label=shown, markersize=4)
    right.set(xlabel="steps of each member", title=WORK, ylim=(1e-6, 3.0))
    right.legend(fontsize=8)
    with mpl.rc_context({"svg.hashsalt": "co_simulation"}):
        save(figure, "co_simulation.svg")


# ------------------------------------------------------------------------------------------------- the force experiment

FORCE = "scenarios/heart_wall_force.yaml"
VARIANT = "PI+FF, replayed"
FINE = ("step=50 us", "servomotor.communication_step=0.5 ms")  # its drive samples every 0.5 ms and steps by no less
SIGNALS = ("wall.force", "sheath.tip_position", "sheath.reaction_force")
TRIED = {
    "jacobi": ("algorithm=jacobi",),
    "jacobi, order 1": ("algorithm.order=1",),
    "gauss_seidel": ("algorithm=gauss_seidel",),
    "gauss_seidel, order 1": ("algorithm=gauss_seidel", "algorithm.order=1"),
    "iterative": ("algorithm=iterative",),
    "iterative, order 1": ("algorithm=iterative", "algorithm.order=1"),
    "step_doubling, order 1": ("algorithm=step_doubling", "algorithm.order=1", "algorithm.smallest=0.5 ms"),
}


def force(*overrides: str) -> tuple[dict[str, Any], int]:
    """Signals of the force experiment, and the steps that members without a period made."""
    scenario = load_scenario(ROOT / FORCE, ("seeds=1", "stop_time=16 s", *overrides))
    case = next(one for one in scenario.cases() if one.variant == VARIANT)
    simulated = build_simulation(case, resolve_catalogs(scenario)[VARIANT], Backend.compiled, BUILD)
    run_case(case, simulated, noop)
    simulated.terminate()
    recorded = simulated.recording()
    late = recorded.time >= 9.0
    sweeps = int(simulated.state["sweeps"]) or int(simulated.state["tick"])
    return {name: recorded.signals[name][late] for name in SIGNALS}, sweeps


def force_table() -> str:
    """How far each algorithm is from the fine run, relative to how much a signal varies."""
    exact, _ = force(*FINE)
    rows = [f"| algorithm at 1 ms | {' | '.join(SIGNALS)} | steps |", "|---" * (len(SIGNALS) + 2) + "|"]
    runs = {"jacobi at 0.1 ms": ("step=100 us", FINE[1]), **TRIED}
    for shown, overrides in runs.items():
        found, sweeps = force(*overrides)
        cells = [
            f"{100 * np.sqrt(np.mean((found[one] - exact[one]) ** 2)) / np.std(exact[one]):.2f} %" for one in SIGNALS
        ]
        rows.append(f"| {shown} | {' | '.join(cells)} | {sweeps} |")
    return "\n".join(rows)


def main() -> None:
    """Measure all, write the tables and draw the figure."""
    errors = measured()
    draw(errors)
    for name, text in (*tables(errors), ("work", work()), ("force", force_table())):
        write_data(f"coupling_{name}", text)
        if name in SELECTED:
            write_table(PAGE, name, select(text, *SELECTED[name]))


if __name__ == "__main__":
    main()
