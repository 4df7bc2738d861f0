"""What came out of each scenario, for its page: figures, verdicts and plots of a run with its own seeds.

Stored in the cache (`twin.store`) under a key of all that decides it: the scenario, what its members are made of, files beside
it, the engine, how plots are drawn. Two scenarios on a core each; the first time all of them take some minutes.
"""

from __future__ import annotations

import os
import re
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from hw_bridge.bridge import load as load_hardware
from twin.component import PythonComponent
from twin.results import plotting
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario
from twin.store import Store, make_key
from twin.study.execution import manifest

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results import MetricResult
    from twin.scenario import ScenarioSpec

ROOT = Path(__file__).parents[1]
PAGE = "page.md"
STORE = Store(ROOT / "build")
HARDWARE = {"drive_faults": "simulated_force"}  # what happens to drives needs some
ENGINE = ("clock.py", "component", "compiler", "coupling", "fmi", "results", "run", "scenario")
SOURCES, DATA = (".py", ".c", ".h"), (".csv", ".svg", ".geojson", ".ssp", ".fmu")


def outcomes(paths: Mapping[str, Path]) -> dict[str, Path]:
    """Scenario -> folder with page.md and its pictures; a missing one is run now. A run that does not end ends this too."""
    whole = engine()
    keys = {name: key(load_scenario(path), whole) for name, path in paths.items()}
    wanted = [name for name in paths if STORE.get(name, keys[name]) is None]
    if wanted:
        workers = min(len(wanted), len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1)
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            runs = [pool.submit(run, name, paths[name], keys[name]) for name in wanted]
            for count, one in enumerate(as_completed(runs), 1):
                print(f"{count} of {len(wanted)} scenarios run: {one.result()}", flush=True)
    return {name: STORE.path(name, keys[name]) for name in paths}


def key(scenario: ScenarioSpec, whole: str) -> str:
    """Hash of all that decides what comes out; `whole`: of the engine."""
    members = manifest.components(scenario)
    python = any(isinstance(one, type) and issubclass(one, PythonComponent) for _, one in manifest.made_of(scenario))
    more = [content(ROOT / "fmus", SOURCES)] if python else []  # what they import is not in their hash
    more += [content(ROOT / "hw_bridge", (*SOURCES, ".yaml"))] if scenario.path.stem in HARDWARE else []
    return make_key(scenario.frozen(), whole, *more, *(f"{name} {one}" for name, one in sorted(members.items())))


def engine() -> str:
    """Hash of what runs and draws scenarios, and of the files beside them."""
    parts = [content(ROOT / "twin" / one, SOURCES) for one in ENGINE]
    return make_key(*parts, content(ROOT / "scenarios", DATA), Path(__file__).read_text())


def content(place: Path, suffixes: Sequence[str]) -> str:
    """Hash of the files of a folder, or of one."""
    files = sorted(one for one in place.rglob("*") if one.suffix in suffixes) if place.is_dir() else [place]
    return make_key(*(part for one in files for part in (str(one.relative_to(ROOT)), one.read_bytes())))


def run(name: str, path: Path, own: str) -> str:
    """Run a scenario and store its part of the page; its name."""
    bench = HARDWARE.get(name)
    hardware = load_hardware(Path(bench), build=ROOT / "build") if bench else None
    with tempfile.TemporaryDirectory() as folder:
        done = run_scenario(
            load_scenario(path), RunOptions(root=Path(folder), build=ROOT / "build", report=False), hardware=hardware
        )
        if done.run.status != "completed":
            raise SystemExit(f"{path}: {done.run.status}: {done.run.reason}")
        verdicts = [(one["verdict"], one["name"], one["detail"]) for one in done.summary["expectations"]]
        parts = ["## What came out\n"]
        parts += [table(("", "expectation", ""), verdicts)] * bool(verdicts)
        parts += figures(done.evaluation.metric_results)
        files: dict[str, bytes] = {}
        for number, plot in enumerate(done.scenario.plots):
            files[f"{name}-{number}.svg"] = plotting.plot_svg(plot, done.tables).encode()
            parts.append(f"![{plot.title}]({name}-{number}.svg)\n")
        STORE.put(name, own, {PAGE: "\n".join(parts).encode(), **files})
    return name


def figures(found: Sequence[MetricResult]) -> list[str]:
    """Metrics beside the paper's, folded: there may be many."""
    rows = [
        (
            one.metric.name,
            one.variant,
            one.metric.shown(one.paper) if one.paper is not None else "",
            span(one),
            one.verdict if one.paper is not None else "",
        )
        for one in found
    ]
    if not rows:
        return []
    lines = table(("metric", "variant", "paper", "twin, least to largest of the seeds", ""), rows)
    return [f'<details markdown="1">\n<summary>Metrics: {len(rows)} figures</summary>\n\n{lines}\n</details>\n']


def span(one: MetricResult) -> str:
    """The least and the largest value of the seeds, or one where both are written alike."""
    values = [value for value in one.values.values() if value is not None]
    if not values:
        return one.metric.shown(None)
    return " to ".join(dict.fromkeys(one.metric.shown(end, one.scale) for end in (min(values), max(values))))


def table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; braces at the end of a cell are code, since they would be read as HTML attributes."""
    lines = [titles, ["---"] * len(titles), *rows]
    cells = ([re.sub(r"({[^{}`]*})$", r"`\1`", cell.replace("|", "&#124;")) for cell in line] for line in lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in cells) + "\n"
