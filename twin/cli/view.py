"""`twin view`: an environment as it is drawn, a run as it moved, or its signals as a file of other tools."""

from __future__ import annotations

import sys
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.simulate import Bar
from twin.cli.terminal import say
from twin.errors import SceneError, TwinError, nearest

if TYPE_CHECKING:
    from twin.scene import Environment, Frames

STILL = (".svg", ".png", ".html")
MOVING = (".html", ".svg", ".gif", ".mp4")
PICTURES = (".png",)  # of a run: its last instant
TABLES = (".csv", ".mat")  # of a run: its signals


@click.command(name="view")
@click.argument("what", metavar="ENVIRONMENT|RUN")
@click.option("--scene", "as_scene", is_flag=True, help="Play a scene of a run's scenario.")
@click.option("--title", default="", metavar="TITLE", help="With --scene: this one. [default: all that there are]")
@click.option("--variant", default="", metavar="NAME", help="Of a run: this variant. [default: all]")
@click.option("--seed", type=int, metavar="N", help="Of a run: this seed. [default: the first; of signals all]")
@click.option("--signal", "patterns", multiple=True, metavar="NAME",
              help="Of a run's signals: this alone, such as sensor.*; may be repeated.")  # fmt: skip
@click.option(
    "--export",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Where to: .html, .svg, .png; of a run also .gif, .mp4; of its signals .csv, .mat. [default: NAME.svg here, RUN/scene.html]",
)
@click.option("--rate", type=click.FloatRange(1.0, 60.0), default=25.0, show_default=True, help="Frames a second.")
@click.option("--speed", type=click.FloatRange(0.001, 1000.0), default=1.0, show_default=True,
              help="Times real time of .gif, .mp4 and .svg.")  # fmt: skip
def command(
    what: str,
    as_scene: bool,
    title: str,
    variant: str,
    seed: int | None,
    patterns: tuple[str, ...],
    export: Path | None,
    rate: float,
    speed: float,
) -> None:
    """Draw an environment without running it, play what a run recorded, or write its signals for other tools.

    ENVIRONMENT is an SVG or GeoJSON file, or a name: two_bends, heart_wall, free_gap, aortic_arch, left_ventricle.
    A scene's page needs no server and nothing else: open it in a browser, or send it.

    \b
    twin view two_bends
    twin view runs/bench_wall/latest --scene
    twin view runs/bench_wall/latest --scene --variant PI --export force.gif --speed 0.5
    twin view runs/bench_wall/latest --signal "sensor.*" --export force.csv
    """
    is_table = export is not None and export.suffix.lower() in TABLES
    if patterns and not is_table:
        raise click.UsageError(f"--signal chooses what is written. Add --export FILE, one of {', '.join(TABLES)}.")
    if is_table and not as_scene and export is not None:
        write_signals(Path(what), export, patterns, variant, seed)
    elif as_scene:
        view_run(Path(what), (title, variant, seed), export, rate, speed)
    elif (Path(what) / "summary.json").exists() or Path(what).is_dir() or Path(what).name == "latest":
        raise click.UsageError(
            f"{what} is a run. Add --scene to play what it recorded. For its signals: --export FILE.csv."
        )
    elif title or variant or seed is not None:
        raise click.UsageError("--title, --variant and --seed choose from a run. Add --scene.")
    else:
        view_environment(what, export)


def checked(target: Path, suffixes: tuple[str, ...]) -> Path:
    """A file that can be written; SceneError if not."""
    if target.suffix not in suffixes:
        raise SceneError(f"{target}: cannot be written. Use {', '.join(suffixes)}.")
    if not target.parent.is_dir():
        raise SceneError(f"{target}: there is no folder {target.parent}. Make it first.")
    return target


def write_signals(run: Path, target: Path, patterns: tuple[str, ...], variant: str, seed: int | None) -> None:
    """Write signals of a run as a file of other tools."""
    from twin.face import open_run
    from twin.results import export, recorded

    opened = open_run(run)
    source = opened.folder / "signals.parquet"
    if not source.is_file():
        raise TwinError(f"{source}: is not there any more. Run the scenario again.")
    if not target.parent.is_dir():
        raise TwinError(f"{target}: there is no folder {target.parent}. Make it first.")
    variables = recorded(source)
    for one in patterns:
        if not any(fnmatchcase(name, one) for name in variables):
            raise TwinError(f"{run}: {one!r} was not recorded. {nearest(one, list(variables))}")
    chosen = [
        one for name, one in variables.items() if not patterns or any(fnmatchcase(name, each) for each in patterns)
    ]
    cases = {
        (one["variant"], one["seed"])
        for one in opened.summary["cases"]
        if variant in ("", one["variant"]) and seed in (None, one["seed"])
    }
    if not cases:
        known = ", ".join(f"{name}" for name in opened.variants)
        raise TwinError(f"{run}: has no such case. Variants: {known}; seeds: {', '.join(map(str, opened.seeds))}.")
    replaced = target.exists()
    export(source, target, chosen, cases)
    say(f"{len(chosen)} signals of {len(cases)} case{'s' * (len(cases) > 1)}")
    say(f"{target}" + " (replaced)" * replaced)


def view_environment(what: str, export: Path | None) -> None:
    """Draw an environment, and say what is in it."""
    from twin.results import write_text
    from twin.scene import page, picture, read, still

    environment = read(what)
    target = checked(export or Path(f"{environment.name}.svg"), STILL)
    if environment.file.exists() and target.exists() and target.samefile(environment.file):
        raise SceneError(f"{target}: is the drawing itself. Name another file with --export.")
    shown, replaced = still(environment), target.exists()
    if target.suffix == ".html":
        write_text(target, page.html(environment.title, {environment.name: shown}, environment.source))
    else:
        picture.save(picture.figure(shown, environment.title), target)
    for line in described(environment):
        say(line)
    say(f"{target}" + " (replaced)" * replaced)


def described(environment: Environment) -> list[str]:
    """An environment in words."""
    x, y = (1e3 * environment.entry).tolist()
    far, near = environment.length * 1e3, environment.clearance * 1e3
    lines = [
        environment.title,
        f"path: {far:.4g} mm from ({x:.4g}, {y:.4g}) mm, {near:.4g} mm from its middle to the nearest wall",
    ]
    for wall in environment.walls:
        values = (
            ("moves with", wall.moves),
            ("friction", wall.friction),
            ("stiffness N/m", wall.stiffness),
            ("thickness mm", wall.thickness * 1e3),
        )
        told = ", ".join(
            f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}" for name, value in values if value
        )
        lines.append(f"wall {wall.name}: {len(wall.points)} points{', solid' * wall.closed}{told and ', ' + told}")
    return lines


def view_run(run: Path, chosen: tuple[str, str, int | None], export: Path | None, rate: float, speed: float) -> None:
    """Play scenes of a run."""
    from twin.face import open_run
    from twin.run import scenes

    opened = open_run(run)
    films = scenes.of_run(opened.folder, *chosen)
    target = checked(export or opened.folder / "scene.html", (*MOVING, *PICTURES))
    replaced = target.exists()
    if target.suffix == ".html":
        from twin.results import write_text
        from twin.scene import page

        about = opened.summary["scenario"]
        titles = {one.title for one in films.values()}
        title = titles.pop() if len(titles) == 1 else about["title"] or about["name"]
        write_text(
            target, page.html(title, films, f"{about['title']}, {opened.summary['started'][:16].replace('T', ' ')}")
        )
    else:
        if len(films) > 1:
            raise SceneError(f"{target}: shows one of {', '.join(films)}. Choose with --title, --variant and --seed.")
        filmed(next(iter(films.values())), target, rate, speed)
    say(f"{target}" + " (replaced)" * replaced)


def filmed(frames: Frames, target: Path, rate: float, speed: float) -> None:
    """Write a film, or of a .png the last instant; a bar shows how far it is."""
    import numpy as np

    from twin.results import write_text
    from twin.scene import film, picture

    if target.suffix == ".svg":
        write_text(target, film.moving_svg(frames, rate, speed))
    elif target.suffix == ".png":
        last = frames.at(np.array([len(frames.time) - 1]))
        picture.save(picture.figure(last, f"{frames.title}, {frames.time[-1]:g} s"), target)
    else:
        shown = Bar("drawing") if sys.stdout.isatty() else None
        try:
            film.movie(frames, target, rate, speed, shown or (lambda _: None))
        finally:
            if shown:
                shown.close()
