"""Scenes of a run: from its folder for `twin view`, and for its report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from twin.errors import SceneError, nearest
from twin.results import list_recorded_variables, read_variables
from twin.run.recorded_views import machine_film
from twin.run.report_figure import ReportFigure
from twin.scenario import lint
from twin.scene import page, picture, scene_instants

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from twin.results import Signals, Violation
    from twin.scene import Frames, Scene

MAX_FILMS = 24  # of a report
MAX_VALUES = 400_000  # moving coordinates of a report: 1.1 MB


def run_scenes(folder: Path, title: str = "", variant: str = "", seed: int | None = None) -> dict[str, Frames]:
    """Load the scenes of a finished run by scene and case, by default of the first seed; SceneError if there are none."""
    scenario, problems = lint(folder / "scenario.yaml", imports=False)
    scene_problems = [problem for problem in problems if " scene `" in problem]
    if scene_problems:
        raise SceneError(scene_problems)
    planar = [scene for scene in scenario.scenes if scene.names]
    titles = [scene.title for scene in planar]
    selected = [scene for scene in planar if title in ("", scene.title)]
    if not selected:
        reason = (
            f"has no scene '{title}'. {nearest(title, titles)}" if titles else "its scenario has no `scenes`. Add one."
        )
        raise SceneError(f"{folder}: {reason}")
    variables = list_recorded_variables(folder / "signals.parquet")
    names = dict.fromkeys(name for scene in selected for name in scene.picture_names if name in variables)
    cases = read_variables(folder / "signals.parquet", [variables[name] for name in names])
    if not cases:
        raise SceneError(f"{folder}: nothing was recorded. Run the scenario again.")
    variants, seeds = ({case[i]: None for case in cases} for i in (0, 1))
    if variant and variant not in variants:
        raise SceneError(f"{folder}: there is no variant '{variant}'. {nearest(variant, map(str, variants))}")
    if seed is not None and seed not in seeds:
        raise SceneError(f"{folder}: there is no seed {seed}. Known: {', '.join(map(str, seeds))}.")
    selected_seed = next(iter(seeds)) if seed is None else seed
    tables = {case: signals for case, signals in cases.items() if case[1] == selected_seed and variant in ("", case[0])}
    frames_by_name = {name: frames for name, _, frames in scene_frames(selected, tables)}
    if not frames_by_name:
        raise SceneError(f"{folder}: none of the signals of its scenes was recorded. Run the scenario again.")
    return frames_by_name


def scene_frames(
    scenes: Iterable[Scene], tables: Mapping[tuple[str, int], Signals]
) -> Iterator[tuple[str, str, Frames]]:
    """Iterate over (title and case, case, frames) of everything that was recorded."""
    scenes = list(scenes)
    for scene in scenes:
        for (variant, seed), signals in tables.items():
            frames = None if scene.variants and variant not in scene.variants else scene_instants(scene, signals)
            if frames is not None:
                case = f"{variant}, seed {seed}" if len(tables) > 1 else ""
                name = ", ".join(filter(None, [scene.title if len(scenes) > 1 or not case else "", case]))
                yield name, case, frames


@dataclass(frozen=True)
class ReportScenes:
    """Scenes of a report: films of all variants with the first seed and of failures; for paper, each scene once, at the first failure or halfway."""

    films: list[dict[str, Any]]
    stills: list[ReportFigure]
    left_out: int = 0  # cases without a film


def report_scenes(
    scenes: Sequence[Scene],
    tables: Mapping[tuple[str, int], Signals],
    views: Mapping[str, list[dict[str, Any]]] = MappingProxyType({}),
    violations: Sequence[Violation] = (),
) -> ReportScenes:
    """Return the scenes of a run for its report; `twin view` plays them with all instants.

    `views`: of the machine, by variant, as the viewer draws them; they replace the lines of the scenes.
    `violations`: each case in which one is shown first has a film, with that instant.
    """
    first_seeds: dict[str, tuple[str, int]] = {}
    for case in tables:
        first_seeds.setdefault(case[0], case)
    instants: dict[tuple[str, int], list[float]] = {}
    for case, instant in (violation.start for violation in violations):
        instants.setdefault(case, []).extend([] if instant is None else [instant])
    filmed = [*instants, *(case for case in first_seeds.values() if case not in instants)]
    shown = {case: signals for case, signals in tables.items() if case in filmed[:MAX_FILMS]}
    has_seeds = len({seed for _, seed in tables}) > 1
    names = {f"{case[0]}, seed {case[1]}" if len(shown) > 1 else "": case for case in shown}
    machines = {
        name: partial(machine_film, own, shown[case]) for name, case in names.items() if (own := views.get(case[0]))
    }
    animations = {scene.title: list(scene_frames([scene], shown)) for scene in scenes}
    several = len(animations) > 1
    makers: list[tuple[str, str, Callable[[int, Sequence[float]], dict[str, Any]]]] = [
        (name or "Machine", name, film) for name, film in machines.items()
    ]
    makers += [
        (", ".join(filter(None, [title if several or not name else "", name])), name, partial(page.film_data, frames))
        for title, cases in animations.items()
        for _, name, frames in cases
        if name not in machines
    ]
    makers = makers[:MAX_FILMS]
    films = [
        {
            "name": title if has_seeds else title.removesuffix(f", seed {case[1]}"),
            "case": case,
            **film(MAX_VALUES // len(makers), instants.get(case, ())),
        }
        for title, name, film in makers
        for case in [names[name]]
    ]
    stills = []
    for title, cases in animations.items():
        starts = [violation.start for violation in sorted(violations, key=lambda each: bool(each.reduce))]
        cases.sort(key=lambda entry: names[entry[1]] != starts[0][0] if starts else False)
        for _, name, frames in cases[:1]:
            instant = starts[0][1] if starts and names[name] == starts[0][0] else None
            at = (frames.time[0] + frames.time[-1]) / 2 if instant is None else instant
            svg = picture.figure_svg(picture.scene_figure(frames, at=at), title)
            stills.append(ReportFigure(title, svg, name, is_scene=True))
    return ReportScenes(films, stills, len(filmed) - len(shown))
