"""Draw the figures of docs/explanation/contact.md and write its tables, from runs made now; takes a minute.

python docs/contact.py
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from figures import ROOT, save
from fmus.tip_contact.model import TipContact
from fmus.wall.model import Wall as SimpleWall
from matplotlib.figure import Figure
from tables import select, write_data, write_table

import twin
from fmus.bodies import experiments
from fmus.bodies.rod import cut
from fmus.bodies.world import World
from twin.scene import Wall

PAGE = ROOT / "docs" / "explanation" / "contact.md"
H = 1e-2  # of the pushes, which are slow [s]
STEP = 5e-5  # by which the root goes on in it [m]
EI, LENGTH = 4.3e-4, 48e-3
SPRING = 3 * EI / LENGTH**3
ANGLES = (15, 30, 45, 60)
FRICTIONS = (0.0, 0.1, 0.3)
COLORS = ("#0b62a4", "#d1495b", "#2f855a", "#b7791f")
PORCINE = {"indentation_force": 0.12, "exponent": 1.0, "layer_thickness": 1.0}
MEASURED = (
    (0.7, 0.3, 10),
    (6.9, 0.1, 80),
)  # porcine heart, ex vivo: depth and its deviation [mm] under a load [g] (Iijima)


def push(farthest: float, back: bool = False, **values: float) -> np.ndarray:
    """Way of the root from the first touch [m], force [N], clearance [rad], place along the wall [m]; as rows."""
    part = TipContact(surface_position=0.0, **values)
    part.initialize()
    ways = np.arange(STEP, farthest, STEP)
    rows = []
    for way in np.concatenate((ways, ways[::-1])) if back else ways:
        part.tip_position = way
        if part.step(0.0, H):
            break
        rows.append((way, float(part.force), float(part.clearance), float(part.slip)))
        if part.clearance < 0.0:
            break
    return np.array(rows).T


def bodies(degrees: float, friction: float, farthest: float) -> np.ndarray:
    """The same of a chain of bodies of which the sides touch too: way [m] and force along the root's axis [N]."""
    a, rod = np.deg2rad(degrees), replace(experiments.ROD, length=LENGTH, segments=24, relaxation=2e-3, curvature=0.5)
    radius, along = 0.5 * rod.diameter, np.array([np.sin(a), np.cos(a)])
    touch = np.array([LENGTH, 0.0]) + (radius + 2e-5) * np.array([np.cos(a), -np.sin(a)])
    wall = Wall(
        "wall", np.array([touch - 0.03 * along, touch + 0.06 * along]), moves="heart", stiffness=260.0, damping=1.7
    )
    place = experiments.make_environment(experiments.straight(LENGTH), wall)
    world = World(place, rod, cut(rod, 0.1e-3, 1e9, "bodies"), "bodies", friction, sides=LENGTH)
    world.space.damping = 1e-3
    rows = []
    for i in range(1, int(farthest / 1e-5)):
        world.step(1e-3, 0.0, -1e-5 * i)
        if i % 100 == 0:
            rows.append((1e-5 * i, world.pads[0].force()[0]))
    return np.array(rows).T


def angles() -> None:
    """Force over the way of the root, for angles and for friction."""
    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for degrees, color in zip(ANGLES, COLORS, strict=True):
        way, force, *_ = push(25e-3, contact_angle=np.deg2rad(degrees))
        left.plot(1e3 * way, force, color=color, label=f"{degrees} deg")
    for degrees, color in ((30, COLORS[1]), (45, COLORS[2])):
        way, force = bodies(degrees, 0.1, 22e-3)
        left.plot(1e3 * way[::2], force[::2], "o", color=color, ms=3, mfc="none", label=f"bodies, {degrees} deg")
    simple = SimpleWall(surface_position=0.0)
    simple.start(0.0)
    ways, forces = np.arange(0, 25e-3, 1e-4), []
    for way in ways:
        simple.tip_position = way
        simple.advance(0.0, H)
        forces.append(float(simple.force))
    left.plot(1e3 * ways, forces, "k--", lw=1, label="wall, simple")
    for friction, color in zip(FRICTIONS, ("#9aa5b1", "#d1495b", "#2f855a"), strict=True):
        way, force, *_ = push(12e-3, back=True, friction=friction)
        right.plot(1e3 * way, force, color=color, label=f"friction {friction:g}")
    left.set(
        title="Pushed on, friction 0.1",
        xlabel="way of the root since the touch [mm]",
        ylabel="force [N]",
        xlim=(-1, 38),
        ylim=(0, 0.4),
    )
    right.set(title="On and back, 30 deg", xlabel="way of the root since the touch [mm]")
    for axes in (left, right):
        axes.axhline(0.2, color="#2f855a", lw=0.8, ls=":")
        axes.legend(fontsize=7)
    save(figure, "contact.svg")


def stiffness() -> str:
    """Force that a further millimeter costs at 0.2 N, over that of the simple wall."""
    head = " | ".join(f"friction {one:g}" for one in FRICTIONS)
    rows = [f"| contact angle | {head} | lies down from, friction 0.1 |", "|---" * 5 + "|"]
    for degrees in (15, 20, 30, 40, 45, 60):
        cells = []
        for friction in FRICTIONS:
            way, force, clearance, _ = push(40e-3, contact_angle=np.deg2rad(degrees), friction=friction)
            i = int(np.argmax(force > 0.2))
            slope = np.gradient(force, way)[i]
            cells.append(f"{1e-3 * slope:.4f} N/mm ({slope / SPRING:.2f})" if force.max() > 0.2 else "lies down before")
            if friction == 0.1:
                flat = f"{force[-1]:.2f} N" if clearance[-1] < 0 else "not within 40 mm"
        rows.append(f"| {degrees} deg | {' | '.join(cells)} | {flat} |")
    return "\n".join(rows)


def stick() -> str:
    """What the friction keeps when the root turns around at 0.2 N."""
    rows = ["| friction | root's way until the tip slides back | force that this takes off |", "|---|---|---|"]
    for friction in FRICTIONS[1:]:
        ways, force, *_ = push(40e-3, friction=friction)
        part = TipContact(surface_position=0.0, friction=friction)
        part.initialize()
        i = int(np.argmax(force > 0.2))
        for way in ways[: i + 1]:
            part.tip_position = way
            part.step(0.0, H)
        for _ in range(100):  # until it rests
            part.step(0.0, H)
        begin, place = float(part.force), float(part.slip)
        back = 0.0
        while abs(part.slip - place) < 1e-9:
            back += 1e-6
            part.tip_position = ways[i] - back
            part.step(0.0, H)
        rows.append(f"| {friction:g} | {1e3 * back:.2f} mm | {begin - float(part.force):.3f} of {begin:.3f} N |")
    return "\n".join(rows)


def pressed(depths: np.ndarray, **values: Any) -> np.ndarray:
    """Force [N] of a stuck, straight section head on, which is rigid, at some depths [m]."""
    part = TipContact(
        contact_angle=0.0, friction=1.0, curvature=0.0, surface_position=0.0, bending_stiffness=4.3e-2, **values
    )
    part.initialize()
    forces = []
    for depth in depths:
        part.tip_position = depth
        part.step(0.0, H)
        forces.append(float(part.normal_force))
    return np.array(forces)


def tissue() -> None:
    """Force over indentation beside what was measured, and over time after a push."""
    figure = Figure(figsize=(8.4, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    depth = np.arange(1e-5, 8e-3, 1e-5)
    for values, most, color, label in (
        ({"layer_thickness": 1.0}, 3.5e-3, "#9aa5b1", "silicone, half-space"),
        ({}, 1.6e-3, "#0b62a4", "silicone, 2 mm (default)"),
        (PORCINE, 8e-3, "#d1495b", "porcine heart"),
    ):
        part = depth[depth < most]
        left.plot(1e3 * part, pressed(part, dissipation=0.0, **values), color=color, label=label)
    for deep, deviation, grams in MEASURED:
        left.errorbar(
            deep, 9.81e-3 * grams, xerr=deviation, fmt="ko", ms=3, label="measured (Iijima)" if grams == 10 else None
        )
    left.axhspan(0.1, 0.4, color="#2f855a", alpha=0.08)
    left.set(title="Pressed in slowly", xlabel="indentation [mm]", ylabel="force [N]", ylim=(0, 0.9))
    left.legend(fontsize=7)
    times = np.arange(1, 6001) * H
    for values, color, label in (
        ({}, "#0b62a4", "silicone: none"),
        ({**PORCINE, "relaxation": (0.2, 0.3)}, "#d1495b", "heart: 0.2 in 0.5 s, 0.3 in 30 s"),
    ):
        forces = pressed(np.full(len(times), 1e-3), dissipation=0.0, **values)
        right.semilogx(
            times,
            forces / pressed(np.array([1e-3]), dissipation=0.0, **values | {"relaxation": (0.0, 0.0)}),
            color=color,
            label=label,
        )
    right.set(title="Held", xlabel="time after the push [s]", ylabel="force over the lasting one", ylim=(0.9, 1.6))
    right.legend(fontsize=7)
    save(figure, "contact_tissue.svg")


def rows(folder: Path) -> str:
    """The force experiment with this contact, beside the simple wall and the wall of bodies."""
    found: dict[str, Any] = {}
    for name in ("heart_wall_replay", "contact_force", "bench_wall"):
        run = twin.load(ROOT / "scenarios" / f"{name}.yaml").run(seeds=[1], report=False, out=folder)
        found[name] = run.summary["metrics"]["force_error_std"]["variants"]
    lines = ["| variant | paper | wall | tip_contact | bodies (bench_wall) |", "|---|---|---|---|---|"]
    papers = {"PI": 0.0362, "PI+FF": 0.0238, "PI+FF+BW": 0.0119}
    for variant, values in found["contact_force"].items():
        cells = ["", "", f"{values['mean']:.4f} N", ""]
        if variant in papers:
            others = (found[one][variant]["mean"] for one in ("heart_wall_replay", "bench_wall"))
            cells[0], cells[1], cells[3] = (f"{one:.4f} N" for one in (papers[variant], *others))
        lines.append(f"| {variant} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Draw and write everything."""
    angles()
    tissue()
    pushed = stiffness()
    write_data("contact_stiffness", pushed)
    write_table(PAGE, "contact stiffness", select(pushed, ("20 deg", "30 deg", "45 deg")))
    write_data("contact_stick", stick())
    with tempfile.TemporaryDirectory() as folder:
        compared = rows(Path(folder))
    write_data("contact_rows", compared)
    write_table(PAGE, "contact rows", select(compared, ("PI", "PI+FF", "PI+FF+BW")))


if __name__ == "__main__":
    main()
