"""`twin view`: open runs in the browser, export them, animate a scene, draw an environment."""

from __future__ import annotations

import importlib.util
import webbrowser
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli.options import no_open_option, option, port_option, runs_option, signal_option
from twin.cli.progress import ProgressBar
from twin.cli.terminal import say
from twin.errors import SceneError, TwinError, nearest

if TYPE_CHECKING:
    from twin.scene import Environment, Frames

STILL = (".svg", ".png", ".html")
MOVING = (".html", ".svg", ".gif", ".mp4")
PICTURES = (".png",)  # the last instant of a run
TABLES = (".csv", ".mat", ".mcap")  # signals of a run for other tools
PAGE = ".html"  # signals of runs, interactive
FORMATS = ("csv", "mat", "mcap", "html")  # a bare format means a file with the scenario's name


@dataclass(frozen=True, kw_only=True, slots=True)
class ViewOptions:
    """What to show of runs, where to write it, and how to serve it."""

    title: str
    variant: str
    seed: int | None
    patterns: tuple[str, ...]
    output: Path | None
    rate: float
    speed: float
    port: int | None
    no_open: bool


@click.command(name="view")
@click.argument("what", metavar="ENVIRONMENT|RUN...", nargs=-1, required=True)
@click.option("--scene", "as_scene", is_flag=True, help="Animate a scene of a run's scenario.")
@click.option("--title", default="", metavar="TITLE", help="Scene to animate.  [default: all scenes]")
@click.option("--variant", default="", metavar="NAME", help="Variant to show.  [default: all]")
@click.option(
    "--seed",
    type=int,
    metavar="N",
    help="Random seed to show.  [default: all; the first in scenes and very large pages]",
)
@signal_option
@option(
    "--output",
    "-o",
    former=("--export",),
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE|FORMAT",
    help="File to write: .html, .csv, .mat or .mcap of runs; .html, .svg, .png, .gif or .mp4 of a scene; .html, .svg or "
    ".png of an environment. A format alone, e.g. csv, names the file after the scenario.  [default: the browser; "
    "RUN/scene.html; NAME.svg]",
)
@click.option(
    "--rate",
    type=click.FloatRange(1.0, 60.0),
    default=25.0,
    show_default=True,
    metavar="HZ",
    help="Frames per second of an animation.",
)
@click.option(
    "--speed",
    type=click.FloatRange(0.001, 1000.0),
    default=1.0,
    show_default=True,
    metavar="FACTOR",
    help="Speed of .gif, .mp4 and .svg relative to real time.",
)
@port_option(1)
@no_open_option
@runs_option
def command(what: tuple[str, ...], as_scene: bool, runs: Path, **options: Any) -> None:
    """Open runs in the browser: signals, overlays, differences, spectra, failed expectations.

    Several runs are overlaid; `latest` is the last run, the name of a scenario its last run. STUDY:713 is a case of a study that was stored with its signals. With --output FILE.html
    the same page is written as one self-contained file.

    --scene animates a scene of a run. An ENVIRONMENT is drawn without a run: an SVG or GeoJSON file, or one of two_bends,
    heart_wall, free_gap, aortic_arch and left_ventricle.

    \b
    twin view latest
    twin view reference runs/heart_wall_force/latest --signal sensor.force
    twin view runs/heart_wall_force/latest --signal "sensor.*" -o force.html
    twin view runs/heart_wall_force/latest --signal "sensor.*" -o mcap
    twin view runs/bench_wall/latest --scene --variant PI -o force.gif
    twin view two_bends
    """
    from twin.results import find_by_time

    view_options, what = ViewOptions(**options), tuple(newest_run(text, runs) for text in what)
    if len(what) > 1 or is_run(str(find_by_time(runs, Path(what[0])))):
        view_runs([run_folder(text, runs) for text in what], view_options, as_scene)
    elif as_scene:
        view_scene(Path(what[0]), view_options, view_options.output)
    elif view_options.output is not None and view_options.output.suffix.lower() in TABLES:
        write_signals(Path(what[0]), view_options.output, view_options)
    elif view_options.patterns or view_options.title or view_options.variant or view_options.seed is not None:
        raise click.UsageError("--signal, --title, --variant and --seed need a run, not an environment.")
    else:
        check_name(what[0], runs)
        view_environment(what[0], view_options.output)


def view_runs(folders: list[Path], options: ViewOptions, as_scene: bool) -> None:
    """Animate runs, write their signals for other tools, or show them in the browser."""
    target = resolve_output(options.output, folders[0])
    if as_scene:
        view_scene(single_run(folders, "--scene animates"), options, target)
    elif target is not None and target.suffix.lower() in TABLES:
        write_signals(single_run(folders, f"{target.suffix} holds"), target, options)
    elif target is not None and target.suffix.lower() != PAGE:
        raise click.UsageError(
            f"{target}: signals can be written as {', '.join((PAGE, *TABLES))}. Add --scene for pictures of a run."
        )
    else:
        view_signals(folders, options, target)


def newest_run(text: str, runs: Path) -> str:
    """Return the `latest` run of a scenario that is named alone; other texts unchanged."""
    latest = runs / text / "latest"
    return str(latest) if len(Path(text).parts) == 1 and not Path(text).exists() and latest.exists() else text


def is_run(text: str) -> bool:
    """Whether something is a run, or a case of a study, rather than an environment."""
    path = Path(text)
    return (
        (path / "summary.json").exists()
        or path.is_dir()
        or path.name == "latest"
        or path.parts[:1] == ("runs",)
        or (text.rpartition(":")[2].isdigit() and not path.exists())
    )


def check_name(text: str, runs: Path) -> None:
    """Raise SceneError for a name that is neither an environment nor a file; suggest environments and runs."""
    from twin.results import LATEST, finished_runs
    from twin.scene import shipped_environments

    environments = shipped_environments()
    if len(Path(text).parts) == 1 and not Path(text).suffix and text not in environments:
        latest = {name for folder in finished_runs(runs) for name in (LATEST, folder.parent.name)}
        raise SceneError(f"There is no environment or run '{text}'. {nearest(text, [*environments, *latest])}")


def run_folder(text: str, runs: Path) -> Path:
    """Return the folder of a run: of `latest` alone that of the last run of any scenario."""
    from twin.results import LATEST, find_by_time, newer_note, resolve_latest

    if text == LATEST:
        folder = resolve_latest(Path(text), root=runs)
        if note := newer_note(folder):
            say(note, err=True)
        return folder
    return case_of_study(text, runs) or first_case(find_by_time(runs, Path(text)))


def first_case(folder: Path) -> Path:
    """Return the run of the first kept case of a study's folder; any other folder itself."""
    from twin.results import find_results, suggest_folders
    from twin.study import stored_cases, study_of_run

    if len(folder.parts) > 1 and not folder.exists() and folder.name != "latest":
        raise TwinError(f"{folder}: does not exist. {suggest_folders(folder, 'summary.json', 'cases.parquet')}")
    if any(folder.glob("*/cases.parquet")):
        find_results(folder, "cases.parquet", "study", "thousand_patients")  # says that it is a folder of studies
    if study_of_run(folder) != folder:
        return folder
    if not (cases := stored_cases(folder)):
        raise TwinError(f"{folder}: the study kept no signals of its cases. Run one again: twin run --case {folder}:1")
    return cases[min(cases)]


def case_of_study(text: str, runs: Path) -> Path | None:
    """Return the folder of `STUDY:713`, None for other texts; TwinError if its signals were not stored."""
    if Path(text).exists() or not text.rpartition(":")[2].isdigit():
        return None
    from twin.study import stored_case_folder

    return stored_case_folder(text, runs)


def resolve_output(output: Path | None, folder: Path) -> Path | None:
    """Return the file to write: for a bare format the scenario's name with that suffix."""
    if output is None or str(output) not in FORMATS:
        return output
    from twin.face import open_run

    return Path(f"{open_run(folder).summary['scenario']['name']}.{output}")


def single_run(folders: list[Path], what: str) -> Path:
    """Return the only run; UsageError if there are several."""
    if len(folders) > 1:
        raise click.UsageError(f"{what} one run, not {len(folders)}. Name one.")
    return folders[0]


def view_signals(folders: list[Path], options: ViewOptions, target: Path | None) -> None:
    """Show signals of runs in the browser, or write them as a page."""
    from twin.results import write_text
    from twin.viewer import (
        RunCollection,
        embedded_page,
        left_out,
        open_recorded_run,
        select_cases,
        select_signals,
        serve,
    )

    as_file = target is None and importlib.util.find_spec("nicegui") is None
    if as_file:
        target = folders[0] / f"signals{PAGE}"
    replaced = target is not None and check_target(target, (PAGE,)).exists()
    runs = RunCollection([open_recorded_run(folder) for folder in folders])
    has_case = bool(options.variant) or options.seed is not None
    cases = select_cases(runs, options.variant, options.seed) if target or has_case else ()
    signals = select_signals(runs, options.patterns) if options.patterns else ()
    if internal := left_out(runs, options.patterns, signals):
        text = f"left out: {', '.join(internal)} (long arrays, states of random numbers; name them to include them)"
        say(text, err=True)  # the first line is the address
    if target is None:
        serve(runs, options.port, say, open_browser=not options.no_open, signals=signals, cases=cases)
        return
    page = embedded_page(runs, signals, cases, select_cases(runs, options.variant, options.seed, every=True))
    write_text(target, page.text)
    thinned = f"; {page.thinned} curves reduced to minima and maxima" * bool(page.thinned)
    added = f" ({page.added} of them of failed requirements)" * bool(page.added)
    say(f"signals: {page.signals}{added}, curves: {page.curves}, {len(page.text) / 1e6:.2g} MB{thinned}")
    say(f"{target}" + " (replaced)" * replaced)
    if as_file:
        say("The page is one file. For the viewer, which also follows a run: pip install 'catheter-twin[console]'")
        if not options.no_open:
            webbrowser.open(target.resolve().as_uri())


def check_target(target: Path, suffixes: tuple[str, ...]) -> Path:
    """Return the file; SceneError if it cannot be written."""
    if target.suffix not in suffixes:
        raise SceneError(f"{target}: cannot be written. Use {', '.join(suffixes)}.")
    if not target.parent.is_dir():
        raise SceneError(f"{target}: there is no folder {target.parent}. Create it first.")
    return target


def write_signals(run: Path, target: Path, options: ViewOptions) -> None:
    """Write signals of a run as a file for other tools."""
    from twin.face import open_run
    from twin.results import export, list_recorded_variables

    opened = open_run(run)
    source = opened.folder / "signals.parquet"
    if not source.is_file():
        raise TwinError(f"{source}: does not exist any more. Run the scenario again.")
    if not target.parent.is_dir():
        raise TwinError(f"{target}: there is no folder {target.parent}. Create it first.")
    variables, patterns = list_recorded_variables(source), options.patterns
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in variables):
            raise TwinError(f"{run}: {pattern!r} was not recorded. {nearest(pattern, list(variables))}")
    selected = [
        variable
        for name, variable in variables.items()
        if not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)
    ]
    cases = {
        (case["variant"], case["seed"])
        for case in opened.summary["cases"]
        if options.variant in ("", case["variant"]) and options.seed in (None, case["seed"])
    }
    if not cases:
        variants = ", ".join(f"{name}" for name in opened.variants)
        raise TwinError(f"{run}: has no such case. Variants: {variants}; seeds: {', '.join(map(str, opened.seeds))}.")
    replaced = target.exists()
    export(source, target, selected, cases)
    say(f"{len(selected)} signal{'s' * (len(selected) > 1)} of {len(cases)} case{'s' * (len(cases) > 1)}")
    say(f"{target}" + " (replaced)" * replaced)


def view_environment(what: str, output: Path | None) -> None:
    """Draw an environment and describe it."""
    from twin.results import write_text
    from twin.scene import page, picture, read_environment, still_frames

    environment = read_environment(what)
    target = check_target(output or Path(f"{environment.name}.svg"), STILL)
    if environment.file.exists() and target.exists() and target.samefile(environment.file):
        raise SceneError(f"{target}: is the environment itself. Name another file with --output.")
    frames, replaced = still_frames(environment), target.exists()
    if target.suffix == ".html":
        write_text(target, page.page_html(environment.title, {environment.name: frames}, environment.source))
    else:
        picture.save_figure(picture.scene_figure(frames, environment.title), target)
    for line in describe(environment):
        say(line)
    say(f"{target}" + " (replaced)" * replaced)


def describe(environment: Environment) -> list[str]:
    """Return a description of an environment, as lines."""
    x, y = (1e3 * environment.entry).tolist()
    length, clearance = environment.length * 1e3, environment.clearance * 1e3
    lines = [
        environment.title,
        f"path: {length:.4g} mm from ({x:.4g}, {y:.4g}) mm, clearance from center line to nearest wall {clearance:.4g} mm",
    ]
    for wall in environment.walls:
        values = (
            ("moves with", wall.moves),
            ("friction", wall.friction),
            ("stiffness N/m", wall.stiffness),
            ("thickness mm", wall.thickness * 1e3),
        )
        properties = ", ".join(
            f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}" for name, value in values if value
        )
        lines.append(
            f"wall {wall.name}: {len(wall.points)} points{', solid' * wall.closed}{properties and ', ' + properties}"
        )
    return lines


def view_scene(run: Path, options: ViewOptions, output: Path | None) -> None:
    """Animate scenes of a run."""
    from twin.face import open_run
    from twin.run import scenes

    opened = open_run(run)
    animations = scenes.run_scenes(opened.folder, options.title, options.variant, options.seed)
    target = check_target(output or opened.folder / "scene.html", (*MOVING, *PICTURES))
    replaced = target.exists()
    if target.suffix == ".html":
        from twin.results import write_text
        from twin.scene import page

        about = opened.summary["scenario"]
        titles = {frames.title for frames in animations.values()}
        title = titles.pop() if len(titles) == 1 else about["title"] or about["name"]
        write_text(
            target,
            page.page_html(title, animations, f"{about['title']}, {opened.summary['started'][:16].replace('T', ' ')}"),
        )
    else:
        if len(animations) > 1:
            raise SceneError(
                f"{target}: can show one of {', '.join(animations)}. Choose with --title, --variant and --seed."
            )
        write_animation(next(iter(animations.values())), target, options.rate, options.speed)
    say(f"{target}" + " (replaced)" * replaced)


def write_animation(frames: Frames, target: Path, rate: float, speed: float) -> None:
    """Write an animation, or the last instant as a .png; show the progress."""
    import numpy as np

    from twin.results import write_text
    from twin.scene import animation, picture

    if target.suffix == ".svg":
        write_text(target, animation.animated_svg(frames, rate, speed))
    elif target.suffix == ".png":
        last = frames.select(np.array([len(frames.time) - 1]))
        picture.save_figure(picture.scene_figure(last, f"{frames.title}, {frames.time[-1]:g} s"), target)
    else:
        with ProgressBar("drawing", delay=1.0) as bar:
            animation.write_movie(frames, target, rate, speed, partial(bar.show, bar.title))
