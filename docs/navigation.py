"""Draw the figures of docs/explanation/navigation.md, and write its result tables, from runs made now.

python docs/navigation.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from figures import FIGURES, ROOT, draw_plots, run
from tables import select, span, write_data, write_table

from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario
from twin.scene import picture, scene_instants

if TYPE_CHECKING:
    from collections.abc import Iterable

PAGE = ROOT / "docs" / "explanation" / "navigation.md"
SHOWN = (0.0, 18.8, 48.0, 56.0)  # [s]: the start, after two legs of the wire, in the arch, the catheter at its farthest
SEEDS = range(101, 112)  # no value of the estimators was chosen with one of these
COLUMNS = (
    "wire_reached",
    "catheter_reached",
    "lead",
    "wire_moved",
    "catheter_moved",
    "hall_worst",
    "fused_worst",
    "catheter_push",
    "regrips",
)
MOVES = ("difference", "hall_error", "shift_error", "fused_error", "fused_gain", "registered")
HEAD = (
    "| case | seeds | largest error | status valid | largest error while valid | standard deviation reported: median | largest "
    "| within two standard deviations, while valid | always | largest error while valid, in these bands | NEES |"
)
PLOTS = {
    "Tips along the vessel": "navigation_tips.svg",
    "Error of the catheter's travel": "navigation_error.svg",
    "Curvature along the catheter, as in Fig. 10C": "navigation_curvature.svg",
    "Shape of the catheter after registration, as in Fig. 10D": "navigation_shape.svg",
}
NOISES = (0.5, 1.5, 3, 5)  # of the fiber [pm]; 0.5 is the scenario's
FEW = (
    "5 pm",
    "10 pm",
    "3 deg",
    "lost",
    "broken",
    "far from the entry, noise 3",
)  # parts of labels of cases with four seeds
NAVIGATION, TRAVEL = "in_vivo_navigation", "travel_distance"
FIBER = "  fiber: {component: fiber}\n"


def fiber(parameters: str) -> tuple[str, str]:
    """Replace the fiber's line of a scenario by one with parameters."""
    return FIBER, f"  fiber: {{component: fiber, parameters: {{{parameters}}}}}\n"


# label, scenario, variant, replacements in its text
CASES: tuple[tuple[str, str, str, tuple[tuple[str, str], ...]], ...] = (
    *((f"navigation, noise {noise} pm", NAVIGATION, "navigation", (fiber(f"noise: {noise} pm"),)) for noise in NOISES),
    *(
        (
            f"navigation, references off by {error} pm",
            NAVIGATION,
            "navigation",
            (fiber(f"reference_error: {error} pm"),),
        )
        for error in (5, 10)
    ),
    ("navigation, cores' angles off by 3 deg", NAVIGATION, "navigation", (fiber("angle_error: 3 deg"),)),
    ("navigation, 30 % of the samples lost", NAVIGATION, "navigation", (fiber("loss: 0.3"),)),
    ("navigation, a core broken", NAVIGATION, "navigation", (fiber("broken_core: 3"),)),
    (
        "navigation, the fiber is lost from 20 s on",
        NAVIGATION,
        "navigation",
        (
            (
                "  navigation: {title: from the groin to the arch and back}\n",
                "  navigation: {title: x, events: [{at: 20 s, set: {fiber.stopped: true}}]}\n",
            ),
        ),
    ),
    (
        "navigation, the fiber is lost from 33 s to 36 s",
        NAVIGATION,
        "navigation",
        (
            (
                "  navigation: {title: from the groin to the arch and back}\n",
                "  navigation: {title: x, events: [{at: 33 s, set: {fiber.stopped: true}}, {at: 36 s, set: {fiber.stopped: false}}]}\n",
            ),
        ),
    ),
    *(
        (f"far from the entry, noise {noise} pm", NAVIGATION, "far from the entry", (fiber(f"noise: {noise} pm"),))
        for noise in (0.5, 3)
    ),
    ("live", NAVIGATION, "live", ()),
    *(
        (f"{name}, 135 mm and back", TRAVEL, name, ())
        for name in (
            "abdomen",
            "diaphragm",
            "thorax",
            "arch",
            "whole profile",
            "no play",
            "no creep",
            "rigid",
            "slip",
            "slip back",
            "fiber lost",
            "fiber gone",
            "hall lost",
        )
    ),
    (
        "arch, noise 3 pm",
        TRAVEL,
        "arch",
        (("  fiber:         {component: fiber}\n", "  fiber: {component: fiber, parameters: {noise: 3 pm}}\n"),),
    ),
)

# what would make it wrong: label, replacements, the metrics that tell it
WRONG: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("nothing", ()),
    (
        "friction of the wire in the catheter is 8 times larger",
        (
            (
                "friction: {component: vessel_friction}",
                "friction: {component: vessel_friction, parameters: {dry: [0.5 N, 0.38 N, 3.04 N], coefficient: [0.15, 0.1, 0.8]}}",
            ),
        ),
    ),
    (
        "the wire is a plain one, 0.3 instead of 1.9 x 10^-3 N m^2",
        (
            (
                "instrument.initial_insertion: 60 mm}",
                "instrument.initial_insertion: 60 mm, instrument.bending_stiffness: 0.3e-3}",
            ),
            ("bending_stiffness: 1.94e-3", "bending_stiffness: 0.3e-3"),
        ),
    ),
    (
        "the gap between the catheter's gripper and entry is 250 mm instead of 40",
        (
            (
                "instrument.initial_insertion: 20 mm}",
                "instrument.initial_insertion: 20 mm, instrument.entry_distance: [380 mm, 250 mm]}",
            ),
        ),
    ),
    (
        "the air of the catheter's grippers is at 1 bar",
        (
            (
                "instrument.initial_insertion: 20 mm}",
                "instrument.initial_insertion: 20 mm, cylinder_1.supply_pressure: 1 bar, cylinder_2.supply_pressure: 1 bar}",
            ),
        ),
    ),
)
TELLING = ("wire_moved", "slip", "catheter_reached", "fused_worst")


# cases of these labels are the scenario as it is
NOMINAL = {
    "navigation": "navigation, noise 0.5 pm",
    "far from the entry": "far from the entry, noise 0.5 pm",
    "live": "live",
}


def metrics(
    scenario: str, variant: str, replaced: Iterable[tuple[str, str]], seeds: Iterable[int], folder: Path
) -> dict[str, Any]:
    """Metrics of one variant over seeds: name -> (description, unit, values in that unit)."""
    path = ROOT / "scenarios" / f"{scenario}.yaml"
    text = path.read_text()
    for old, new in replaced:
        if old not in text:
            raise ValueError(f"{path}: no {old.strip()!r} to replace. Adapt CASES in {__file__}")
        text = text.replace(old, new)
    outcome = run_scenario(
        parse_scenario(text, path),
        RunOptions(
            backend=Backend.compiled,
            variants=[variant],
            seeds=list(seeds),
            root=folder / "many",
            build=ROOT / "build",
            report=False,
        ),
    )
    return {
        name: (one["description"], one["unit"], np.array(list(one["variants"][variant]["values"].values())))
        for name, one in outcome.summary["metrics"].items()
        if variant in one["variants"]
    }


def case_seeds(label: str) -> range:
    """Eleven seeds, or four of them for the cases of `FEW`."""
    return SEEDS[:4] if any(part in label for part in FEW) and "135 mm" not in label else SEEDS


def consistency(found: dict[str, dict[str, Any]]) -> str:
    """Errors beside what the estimate says of itself, one row for each case."""
    rows = [HEAD, "|---" * 11 + "|"]
    for label, scenario, _, _ in CASES:
        own = {name: one[2] for name, one in found[label].items()}
        worst = own["fused_worst" if scenario == NAVIGATION else "largest_error"]
        covered = f"{100 * own['covered'].min():.1f} %" if own["valid_part"].max() > 0.0 else "never valid"
        rows.append(
            f"| {label} | {len(worst)} | {span(worst, '.1f')} mm | {span(100 * own['valid_part'], '.0f')} % | {own['valid_worst'].max():.1f} mm "
            f"| {np.median(own['told_median']):.1f} mm | {own['told_largest'].max():.1f} mm | {covered} "
            f"| {100 * own['covered_always'].min():.1f} % | {own['bands'].max():.2f} | {span(own['nees'], '.2f')} |"
        )
    return "\n".join(rows)


def reached(found: dict[str, dict[str, Any]]) -> str:
    """What comes out: least to largest over the seeds, one row for each variant."""
    one = found[NOMINAL["navigation"]]
    rows = [f"| variant | {' | '.join(one[name][0] for name in COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for variant, label in NOMINAL.items():
        own = found[label]
        rows.append(
            f"| {variant} | {' | '.join(f'{shown(own[name][2])} {own[name][1]}'.rstrip() for name in COLUMNS)} |"
        )
    return "\n".join(rows)


def moves(found: dict[str, dict[str, Any]]) -> str:
    """The last two moves: least to largest over the seeds, one row for each metric."""
    rows = ["| the last two moves, 135 mm out and back | least to largest |", "|---|---|"]
    for description, unit, values in (found[NOMINAL["navigation"]][name] for name in MOVES):
        rows.append(f"| {description} | {f'{shown(values)} {unit}'.rstrip()} |")
    return "\n".join(rows)


def wrong(folder: Path) -> str:
    """What a wrong assumption changes, one row for each."""
    rows = [
        "| if | largest motion of the held wire | slip in a gripper | farthest place of the catheter | error of its travel | largest standard deviation reported |",
        "|---" * 6 + "|",
    ]
    for label, replaced in WRONG:
        own = metrics(NAVIGATION, "navigation", replaced, SEEDS[:3], folder)
        rows.append(
            f"| {label} | {' | '.join(f'{shown(own[name][2])} mm' for name in TELLING)} | {shown(own['told_largest'][2])} mm |"
        )
    return "\n".join(rows)


def shown(numbers: Iterable[float]) -> str:
    """Least to largest with three digits."""
    return span(numbers, "#.3g").replace(". to", " to").removesuffix(".")


def main() -> None:
    """Draw and write everything."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        outcome = run(NAVIGATION, folder)
        draw_plots(outcome, PLOTS)
        frames = scene_instants(outcome.scenario.scenes[0], outcome.tables["navigation", 0])
        assert frames is not None
        chosen = frames.select(np.searchsorted(frames.time, np.array(SHOWN) - 1e-9))
        (FIGURES / "navigation_vessel.svg").write_text(
            picture.figure_svg(picture.scene_figure(chosen, instants=len(SHOWN)), "navigation_vessel") + "\n"
        )
        write_data("navigation_wrong", wrong(folder))
        found = {}
        for label, scenario, variant, replaced in CASES:
            print(label, flush=True)
            found[label] = metrics(scenario, variant, replaced, case_seeds(label), folder)
    text = reached(found)
    write_data("navigation_reached", text)
    write_table(PAGE, "in_vivo_navigation", select(text, None, (0, 1, 2, 4, 5, 6, 7)))
    write_data("navigation_moves", moves(found))
    write_data("navigation_consistency", consistency(found))


if __name__ == "__main__":
    main()
