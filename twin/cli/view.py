"""`twin view`: runs in the browser or as a page, as they moved, as files of other tools; an environment as it is drawn."""

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
TABLES = (".csv", ".mat", ".mcap")  # of a run: its signals
PAGE = ".html"  # of runs: their signals, to be looked at
FORMATS = ("csv", "mat", "mcap", "html")  # that may stand for a file of the scenario's name


@click.command(name="view")
@click.argument("what", metavar="ENVIRONMENT|RUN...", nargs=-1, required=True)
@click.option("--scene", "as_scene", is_flag=True, help="Play a scene of a run's scenario.")
@click.option("--title", default="", metavar="TITLE", help="With --scene: this one. [default: all that there are]")
@click.option("--variant", default="", metavar="NAME", help="Of a run: this variant. [default: all]")
@click.option("--seed", type=int, metavar="N", help="Of a run: this seed. [default: the first; of CSV, MAT, MCAP all]")
@click.option("--signal", "--signals", "patterns", multiple=True, metavar="NAME",
              help="Of a run: this alone, such as sensor.*; a page shows expressions too; may be repeated.")  # fmt: skip
@click.option(
    "--export",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Where to. Of runs: .html, a page of their signals; .csv, .mat, .mcap. With --scene: .html, .svg, .png, .gif, .mp4. "
    "Of an environment: .html, .svg, .png. [default: the browser; RUN/scene.html; NAME.svg here]",
)
@click.option("--rate", type=click.FloatRange(1.0, 60.0), default=25.0, show_default=True, help="Frames a second.")
@click.option("--speed", type=click.FloatRange(0.001, 1000.0), default=1.0, show_default=True,
              help="Times real time of .gif, .mp4 and .svg.")  # fmt: skip
@click.option("--port", type=click.IntRange(1, 65535), help="Of the browser's page. [default: a free one]")
@click.option("--no-open", is_flag=True, help="Say the page's address, and open no browser.")
@click.option("--runs", type=click.Path(file_okay=False, path_type=Path), default=Path("runs"), show_default=True,
              help="Folder in which studies are looked for.")  # fmt: skip
def command(
    what: tuple[str, ...],
    as_scene: bool,
    title: str,
    variant: str,
    seed: int | None,
    patterns: tuple[str, ...],
    export: Path | None,
    rate: float,
    speed: float,
    port: int | None,
    no_open: bool,
    runs: Path,
) -> None:
    """Look at runs in the browser: signals, overlays, differences, spectra, where what was expected failed.

    Several runs are laid over each other. STUDY:713 is a case of a study that was kept with its signals.
    With --export FILE.html all of it is one page that needs nothing else: open it in a browser, or send it.
    Also: play a scene of a run, write its signals for other tools, draw an ENVIRONMENT without running it:
    an SVG or GeoJSON file, or a name: two_bends, heart_wall, free_gap, aortic_arch, left_ventricle.

    \b
    twin view runs/heart_wall_force/latest
    twin view reference runs/heart_wall_force/latest --signal sensor.force
    twin view runs/heart_wall_force/latest --signal "sensor.*" --export force.html
    twin view runs/heart_wall_force/latest --signal "sensor.*" --export mcap
    twin view runs/bench_wall/latest --scene --variant PI --export force.gif
    twin view two_bends
    """
    if len(what) > 1 or is_run(what[0]):
        folders = [case_of_study(one, runs) or Path(one) for one in what]
        target = named(export, folders[0])
        if as_scene:
            view_run(alone(folders, "--scene plays"), (title, variant, seed), target, rate, speed)
        elif target is not None and target.suffix.lower() in TABLES:
            write_signals(alone(folders, f"{target.suffix} holds"), target, patterns, variant, seed)
        elif target is not None and target.suffix.lower() != PAGE:
            raise click.UsageError(
                f"{target}: signals go to {', '.join((PAGE, *TABLES))}. For pictures of a run add --scene."
            )
        else:
            view_signals(folders, patterns, variant, seed, target, (port, not no_open))
    elif as_scene:
        view_run(Path(what[0]), (title, variant, seed), export, rate, speed)
    elif export is not None and export.suffix.lower() in TABLES:
        write_signals(Path(what[0]), export, patterns, variant, seed)
    elif patterns or title or variant or seed is not None:
        raise click.UsageError("--signal, --title, --variant and --seed choose from a run; this is none.")
    else:
        view_environment(what[0], export)


def is_run(text: str) -> bool:
    """Whether something is a run, or a case of a study, rather than an environment."""
    path = Path(text)
    return (
        (path / "summary.json").exists() or path.is_dir() or path.name == "latest" or path.parts[:1] == ("runs",)
        or (text.rpartition(":")[2].isdigit() and not path.exists())
    )  # fmt: skip


def case_of_study(text: str, runs: Path) -> Path | None:
    """The folder of `STUDY:713`, if something is that; TwinError if its signals were not kept."""
    if Path(text).exists() or not text.rpartition(":")[2].isdigit():
        return None
    from twin.study import stored_case_folder

    return stored_case_folder(text, runs)


def named(export: Path | None, folder: Path) -> Path | None:
    """Where to: of a bare `csv` the scenario's name with that ending, here."""
    if export is None or str(export) not in FORMATS:
        return export
    from twin.face import open_run

    return Path(f"{open_run(folder).summary['scenario']['name']}.{export}")


def alone(folders: list[Path], what: str) -> Path:
    """The one run of several that there may be."""
    if len(folders) > 1:
        raise click.UsageError(f"{what} one run, not {len(folders)}. Name one.")
    return folders[0]


def view_signals(
    folders: list[Path],
    patterns: tuple[str, ...],
    variant: str,
    seed: int | None,
    target: Path | None,
    place: tuple[int | None, bool],
) -> None:
    """Signals of runs in the browser, or as a page."""
    from twin.results import write_text
    from twin.viewer import Runs, chosen_cases, chosen_signals, of_samples, opened, serve

    replaced = target is not None and checked(target, (PAGE,)).exists()
    shown = Runs([opened(one) for one in folders])
    cases = chosen_cases(shown, variant, seed) if target or variant or seed is not None else ()
    signals = chosen_signals(shown, patterns) if target or patterns else ()
    if target is None:
        port, in_browser = place
        serve(shown, port, say, opened=in_browser, signals=signals, cases=cases)
        return
    page = of_samples(shown, signals, cases)
    write_text(target, page.text)
    thinned = f"; of {page.thinned} only the smallest and largest of every part" * bool(page.thinned)
    say(f"signals: {len(signals)}, curves: {page.curves}, {len(page.text) / 1e6:.2g} MB{thinned}")
    say(f"{target}" + " (replaced)" * replaced)


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
    from twin.results import export, list_recorded_variables

    opened = open_run(run)
    source = opened.folder / "signals.parquet"
    if not source.is_file():
        raise TwinError(f"{source}: is not there any more. Run the scenario again.")
    if not target.parent.is_dir():
        raise TwinError(f"{target}: there is no folder {target.parent}. Make it first.")
    variables = list_recorded_variables(source)
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
    say(f"{len(chosen)} signal{'s' * (len(chosen) > 1)} of {len(cases)} case{'s' * (len(cases) > 1)}")
    say(f"{target}" + " (replaced)" * replaced)


def view_environment(what: str, export: Path | None) -> None:
    """Draw an environment, and say what is in it."""
    from twin.results import write_text
    from twin.scene import page, picture, read_environment, still_frames

    environment = read_environment(what)
    target = checked(export or Path(f"{environment.name}.svg"), STILL)
    if environment.file.exists() and target.exists() and target.samefile(environment.file):
        raise SceneError(f"{target}: is the drawing itself. Name another file with --export.")
    shown, replaced = still_frames(environment), target.exists()
    if target.suffix == ".html":
        write_text(target, page.page_html(environment.title, {environment.name: shown}, environment.source))
    else:
        picture.save_figure(picture.scene_figure(shown, environment.title), target)
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
    films = scenes.run_scenes(opened.folder, *chosen)
    target = checked(export or opened.folder / "scene.html", (*MOVING, *PICTURES))
    replaced = target.exists()
    if target.suffix == ".html":
        from twin.results import write_text
        from twin.scene import page

        about = opened.summary["scenario"]
        titles = {one.title for one in films.values()}
        title = titles.pop() if len(titles) == 1 else about["title"] or about["name"]
        write_text(
            target,
            page.page_html(title, films, f"{about['title']}, {opened.summary['started'][:16].replace('T', ' ')}"),
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
    from twin.scene import animation, picture

    if target.suffix == ".svg":
        write_text(target, animation.animated_svg(frames, rate, speed))
    elif target.suffix == ".png":
        last = frames.select(np.array([len(frames.time) - 1]))
        picture.save_figure(picture.scene_figure(last, f"{frames.title}, {frames.time[-1]:g} s"), target)
    else:
        shown = Bar("drawing") if sys.stdout.isatty() else None
        try:
            animation.write_movie(frames, target, rate, speed, shown or (lambda _: None))
        finally:
            if shown:
                shown.close()
