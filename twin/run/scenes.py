"""The scenes of a run: of its folder for `twin view`, and as pictures of its report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin.errors import SceneError, nearest
from twin.results import read_variables, recorded
from twin.scenario import examine
from twin.scene import instants, picture

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from twin.results import Signals
    from twin.scene import Frames, Scene

INSTANTS = 3  # of a scene in the report


def of_run(folder: Path, title: str = "", variant: str = "", seed: int | None = None) -> dict[str, Frames]:
    """Scenes of a finished run by scene and case, those of the first seed if none is named; SceneError if there are none."""
    scenario, problems = examine(folder / "scenario.yaml", imports=False)
    broken = [problem for problem in problems if " scene `" in problem]
    if broken:
        raise SceneError(broken)
    titles = [one.title for one in scenario.scenes]
    chosen = [one for one in scenario.scenes if title in ("", one.title)]
    if not chosen:
        what = (
            f"has no scene '{title}'. {nearest(title, titles)}" if titles else "its scenario has no `scenes`. Add one."
        )
        raise SceneError(f"{folder}: {what}")
    known = recorded(folder / "signals.parquet")
    names = dict.fromkeys(name for one in chosen for name in one.names if name in known)
    cases = read_variables(folder / "signals.parquet", [known[name] for name in names])
    if not cases:
        raise SceneError(f"{folder}: nothing was recorded. Run the scenario again.")
    variants, seeds = ({case[i]: None for case in cases} for i in (0, 1))
    if variant and variant not in variants:
        raise SceneError(f"{folder}: there is no variant '{variant}'. {nearest(variant, map(str, variants))}")
    if seed is not None and seed not in seeds:
        raise SceneError(f"{folder}: there is no seed {seed}. Known: {', '.join(map(str, seeds))}.")
    wanted = next(iter(seeds)) if seed is None else seed
    tables = {case: one for case, one in cases.items() if case[1] == wanted and variant in ("", case[0])}
    found = {name: shown for name, _, shown in shots(chosen, tables)}
    if not found:
        raise SceneError(f"{folder}: none of the signals of its scenes was recorded. Run the scenario again.")
    return found


def shots(scenes: Iterable[Scene], tables: Mapping[tuple[str, int], Signals]) -> Iterator[tuple[str, str, Frames]]:
    """(scene and case, case, instants) of everything that can be shown."""
    scenes = list(scenes)
    for scene in scenes:
        for (variant, seed), signals in tables.items():
            shown = None if scene.variants and variant not in scene.variants else instants(scene, signals)
            if shown is not None:
                case = f"{variant}, seed {seed}" if len(tables) > 1 else ""
                name = ", ".join(filter(None, [scene.title if len(scenes) > 1 or not case else "", case]))
                yield name, case, shown


def pictures(scenes: Iterable[Scene], tables: Mapping[tuple[str, int], Signals]) -> list[dict[str, str]]:
    """Scenes at some instants for a report, of the first case of each; `twin view` plays them."""
    found = []
    for scene in scenes:
        first = next(iter(shots([scene], tables)), None)
        if first is not None:
            _, case, shown = first
            note = "; ".join(filter(None, [case, "`twin view RUN --scene` plays it"]))
            svg = picture.as_svg(picture.figure(shown, "", INSTANTS), scene.title)
            found.append({"title": scene.title, "svg": svg, "note": note})
    return found
