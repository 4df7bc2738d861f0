"""Pictures of the machine: which components are drawn and which signals move them. `static/` has a script for each view.

A member is identified by its component's class; inside a group, of which only signals are known, by its signals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

RIG, BENCH, VESSEL, SCENE, ANY = "rig", "bench", "vessel", "scene", ""  # views; ANY joins the first existing one


@dataclass(frozen=True)
class ComponentDrawing:
    """How a component is drawn: view and kind of drawing, moving signals, and parameters for its size."""

    view: str
    kind: str
    signals: tuple[str, ...]
    sizes: tuple[str, ...] = ()


DRAWINGS = {
    "RegrippingSequencer": ComponentDrawing(RIG, "sequencer", ("step_number", "leading", "regrip_count")),
    "Servomotor": ComponentDrawing(RIG, "carriage", ("position", "velocity", "current", "limited")),
    "PneumaticCylinder": ComponentDrawing(RIG, "cylinder", ("extension", "pressure_extend")),
    "BraidedSleeve": ComponentDrawing(
        RIG, "sleeve", ("diameter", "gripping"), ("relaxed_diameter", "instrument_diameter", "orientation")
    ),
    "RotaryDrive": ComponentDrawing(RIG, "rotation", ("angle", "angular_velocity")),
    "Instrument": ComponentDrawing(
        RIG,
        "instrument",
        ("insertion_depth", "proximal_position", "tip_position", "proximal_angle", "slip_distance"),
        ("section_length",),
    ),
    "Sheath": ComponentDrawing(RIG, "sheath", ("tip_position", "reaction_force")),
    "StepperAxis": ComponentDrawing(BENCH, "axis", ("position", "step_count", "moving")),
    "OmnidirectionalCatheter": ComponentDrawing(
        BENCH, "tip", ("tip_x", "tip_y", "tip_z", "tip_angle", "needle_length")
    ),
    "PullWireCatheter": ComponentDrawing(BENCH, "tip", ("tip_y", "tip_z", "needle_length", "tension_share")),
    "InjectionSite": ComponentDrawing(BENCH, "site", ("depth", "given")),
    "Fluoroscope": ComponentDrawing(
        VESSEL,
        "fluoroscope",
        ("vessel", "wire", "catheter", "wire_tip", "catheter_tip", "catheter_location", "wire_location"),
    ),
    "VesselFriction": ComponentDrawing(VESSEL, "friction", ("wall_force",)),
    "Heart": ComponentDrawing(ANY, "heart", ("position", "beats")),
    "Wall": ComponentDrawing(ANY, "wall", ("force", "displacement"), ("surface_position",)),
    "ForceSensor": ComponentDrawing(ANY, "force", ("measured_force",)),
}
SIZES = frozenset(size for drawing in DRAWINGS.values() for size in drawing.sizes)
ORDER = (VESSEL, RIG, BENCH)
TITLES = {"wire": "guidewire"}  # of groups with another name
BAND = (0.1, 0.4)  # [N], contact force: paper A, section V


class ViewSignal(Protocol):
    """A variable: `name` as member.variable, `kind` is `parameter` for parameters, `start` its value then."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def kind(self) -> str: ...  # noqa: D102
    @property
    def start(self) -> Any: ...  # noqa: D102
    @property
    def recorded(self) -> bool: ...  # noqa: D102


class ViewSystem(Protocol):
    """What views are built of: classes of members, signals by name, scenes, and targets and warnings of an operator."""

    @property
    def members(self) -> Mapping[str, str]: ...  # noqa: D102
    @property
    def signals(self) -> Mapping[str, ViewSignal]: ...  # noqa: D102
    @property
    def scenes(self) -> Sequence[Mapping[str, Any]]: ...  # noqa: D102
    @property
    def targets(self) -> Mapping[str, Any]: ...  # noqa: D102
    @property
    def warnings(self) -> Sequence[Mapping[str, Any]]: ...  # noqa: D102


def build_views(catalog: ViewSystem) -> list[dict[str, Any]]:
    """Return the views with their parts and the signals that move them; empty for unknown components."""
    views: dict[tuple[str, str], list[dict[str, Any]]] = {}
    loose = []
    for member, variables, drawing in _members(catalog):
        group, _, own = member.rpartition(".")
        part = {
            "kind": drawing.kind,
            "member": own,
            "signals": {signal: f"{member}.{signal}" for signal in drawing.signals if signal in variables},
            "sizes": {size: variables[size].start for size in drawing.sizes if size in variables},
        }
        if drawing.view == ANY:
            loose.append(part)
        else:
            views.setdefault((drawing.view, group), []).append(part)
    ordered = sorted(views, key=lambda key: ORDER.index(key[0]))
    views_in_order: list[dict[str, Any]] = [
        {"view": view, "title": TITLES.get(group, group), "parts": views[view, group], "band": BAND}
        for view, group in ordered
    ]
    if all(view["view"] != VESSEL for view in views_in_order):
        guided = {"instrument", "sheath", "sleeve", "tip"}  # a carriage alone shows less than the scene
        guided_views = [view for view in views_in_order if {part["kind"] for part in view["parts"]} & guided]
        scenes = _scene_views(catalog)
        views_in_order = [*scenes, *guided_views] if scenes else views_in_order
    for view in views_in_order:
        view["targets"] = [
            {"name": name, "at": point, "tolerance": catalog.targets["tolerance"]}
            for name, point in _targets_in(view, catalog)
        ]
        view["limits"] = {warning["signal"]: warning["above"] for warning in catalog.warnings if "minus" not in warning}
    joined = next((view for view in views_in_order if view["view"] != VESSEL), None)
    if joined is not None:
        joined["parts"] += loose
    return views_in_order


def _targets_in(view: Mapping[str, Any], catalog: ViewSystem) -> Iterable[tuple[str, Any]]:
    """Return the targets that a view can draw: points in a plane, of a signal that it shows."""
    shown = {name for part in view["parts"] for name in part["signals"].values()}
    is_planar = catalog.targets and catalog.targets["signal"] in shown
    return catalog.targets["points"].items() if is_planar else ()


def _scene_views(catalog: ViewSystem) -> list[dict[str, Any]]:
    """Return a view for each scene of the scenario whose lines and points are recorded."""
    views = []
    for scene in catalog.scenes:
        arrows = [name for arrow in scene["arrows"] for name in (arrow["signal"], arrow["at"])]
        curves = [each["signal"] for each in (*scene["lines"], *scene["points"])]
        names = [*curves, *arrows, *scene["motions"].values()]
        if names and all(name in catalog.signals and catalog.signals[name].recorded for name in names):
            part = {"kind": SCENE, "member": "", "signals": {name: name for name in names}, "sizes": {}}
            views.append({"view": SCENE, "title": scene["title"], "parts": [part], "band": BAND, "scene": dict(scene)})
    return views


def _members(catalog: ViewSystem) -> Iterator[tuple[str, Mapping[str, Any], ComponentDrawing]]:
    """Yield drawable members, also those of groups, with the variables whose values are known."""
    members: dict[str, dict[str, Any]] = {}
    for signal in catalog.signals.values():
        member, _, variable = signal.name.rpartition(".")
        if signal.recorded or signal.kind == "parameter":
            members.setdefault(member, {})[variable] = signal
    for member, variables in members.items():
        drawing = DRAWINGS.get(catalog.members.get(member, ""))
        if drawing is None and member not in catalog.members:
            drawing = next(
                (drawing for drawing in DRAWINGS.values() if {*drawing.signals, *drawing.sizes} <= variables.keys()),
                None,
            )
        if drawing is not None and any(signal in variables for signal in drawing.signals):
            yield member, variables, drawing
