"""`twin list`: list scenarios, studies, components, drive profiles and runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin import installed
from twin.cli.options import filter_option, runs_option
from twin.cli.terminal import open_console, show_table, show_text
from twin.errors import ScenarioError, TwinError, find_similar, nearest, quote_names

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

STUDY = "manifest.json"  # of a study that has run
MAX_OVERRIDES = 4  # of a run
VERDICTS = {"info": "-", "cut": "run too short", "none": "no value", "other": "other settings"}  # of a metric
MAX_METRICS = 20  # of the description of a run
MAX_RUNS = 3  # in the overview
Listing = dict[str, str]  # descriptions by name


@click.command("list")
@click.argument("kinds", nargs=-1, metavar="[KIND]...")
@filter_option
@runs_option
def command(kinds: tuple[str, ...], text: str, runs: Path) -> None:
    """List entries of each KIND with their titles: scenarios, studies, components, profiles (of drives), runs.  [default: names of all kinds]

    Nothing is imported or run. Commands accept the listed names; `twin describe NAME` shows details.

    \b
    twin list
    twin list components --filter force
    """
    if runs != Path("runs") and not runs.is_dir():
        raise TwinError(f"--runs {runs}: there is no such folder. Leave it out, or name a folder of results.")
    listings = kinds_of_names(runs)
    singular = {"study": "studies"} | {kind.removesuffix("s"): kind for kind in listings if kind != "studies"}
    kinds = tuple(singular.get(kind, kind) for kind in kinds)
    for kind in kinds:
        if kind not in listings:
            advice = (
                f"Entries that contain it: twin list --filter {kind}." if not find_similar(kind, [*listings]) else ""
            )
            raise TwinError(f"There is no list of {kind!r}. {nearest(kind, listings)} {advice}".rstrip())
    count = 0
    for kind in kinds or listings:
        listing = listings[kind]()
        lines = {name: line for name, line in listing.items() if text.lower() in f"{name} {line}".lower()}
        count += len(lines)
        if text and not lines:
            continue
        show_text("", f"{kind}: {len(lines)}{hint(kind, lines, runs)}", "bold")
        groups = {"scenarios": by_topic, "components": by_folder, "runs": by_scenario}.get(kind)
        for heading, names in (groups(lines) if groups else {"": [*lines]}).items():
            if not kinds and not text:
                show_names(heading, names, kind)
                continue
            if heading:
                show_text("", f" {heading}:", "bold")
            show((Path(name).name if kind == "runs" else name, lines[name]) for name in names)
    if text and not count:
        raise TwinError(f"Nothing contains {text!r}. See `twin list{''.join(f' {kind}' for kind in kinds)}`.")
    if not kinds and not text:
        show_text("Titles: `twin list KIND`, such as `twin list scenarios`. Details: `twin describe NAME`.")


def kinds_of_names(runs: Path) -> dict[str, Callable[[], Listing]]:
    """Return what lists the names of each kind."""
    return {
        "scenarios": lambda: titles("scenario"),
        "studies": lambda: titles("study"),
        "components": components,
        **{kind: point.load() for kind, point in installed.entry_points("twin.listed").items()},
        "runs": lambda: runs_by_folder(runs),
    }


def hint(kind: str, lines: Listing, runs: Path) -> str:
    """Return what follows the number of entries: of runs their folder and order, or how to make one."""
    if kind != "runs":
        return ""
    return f", in {runs}, newest first" if lines else f" in {runs}; `twin run heart_wall_force` makes one"


def show_names(heading: str, names: Sequence[str], kind: str) -> None:
    """Print the names of a group in few lines; of runs the latest."""
    label = f" {heading}: " if heading else " "
    if kind == "runs":
        names = [Path(name).name for name in names]
        more = f" and {len(names) - MAX_RUNS} more" * (len(names) > MAX_RUNS)
        show_text(", ".join(names[:MAX_RUNS]) + more, label)
    else:
        show_text(", ".join(names), label)


def show(lines: Iterable[tuple[str, str]]) -> None:
    """Print names and descriptions, indented."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=True)
    table.add_column("name", no_wrap=True)
    table.add_column("line", overflow="fold")
    for name, line in lines:
        table.add_row(Text(name), Text(line))
    if table.row_count:
        open_console().print(table)


def components() -> Listing:
    """Return the components of `fmus` with the first line of their documentation."""
    from twin.component import catalog

    return {name: catalog.summary(name) for name in catalog.names()}


def by_folder(names: Iterable[str]) -> dict[str, list[str]]:
    """Group components under the folder of their kind in `fmus`; those directly in `fmus` are the last."""
    from twin.component import catalog

    groups: dict[str, list[str]] = {}
    for name in names:
        folder = catalog.component_folder(name)
        kind = folder.parent.name.capitalize() if folder else ""
        groups.setdefault("Others" if kind in ("", "Fmus") else kind, []).append(name)
    return dict(sorted(groups.items(), key=lambda group: (group[0] == "Others", group[0])))


def titles(kind: str) -> Listing:
    """Return scenarios or studies of the working directory and of the project, with their titles."""
    from twin.scenario import scenario_paths

    return {name: scenario_paths.title(path) for name, path in scenario_paths.scenarios(kind).items()}


def by_topic(names: Iterable[str]) -> dict[str, list[str]]:
    """Group scenarios under headings: those to begin with first, then by topic, then the others."""
    from twin.scenario import scenario_paths

    paths = scenario_paths.scenarios()
    groups: dict[str, list[str]] = {
        heading: [] for heading in ("Start here", *scenario_paths.TOPICS.values(), "Others")
    }
    for name in names:
        topic = scenario_paths.TOPICS.get(scenario_paths.overview(paths[name]).topic, "Others")
        groups["Start here" if name in scenario_paths.START_HERE else topic].append(name)
    return {heading: group for heading, group in groups.items() if group}


def runs_by_folder(folder: Path) -> Listing:
    """Return finished runs and studies, the latest first, with their outcome."""
    from twin.results import finished_runs, run_order

    results = dict.fromkeys(finished_runs(folder), outcome)
    results |= dict.fromkeys(finished_runs(folder, STUDY), study_outcome)
    return {path.as_posix(): results[path](path) for path in sorted(results, key=run_order, reverse=True)}


def study_outcome(folder: Path) -> str:
    """Return the extent of a study that has run, and the requirement that the fewest of its cases meet."""
    try:
        study, answers = study_results(folder)
        texts = [f"STUDY of {study['cases']} cases", "" if study["status"] == "completed" else study["status"]]
        texts.append(f"{study['failed']} did not finish" if study["failed"] else "")
        if rates := [(rate["part"], rate["name"], rate["variant"]) for rate in answers.get("expectations", ())]:
            part, name, variant = min(rates)
            texts.append("all pass" if part == 1.0 else f"{100.0 * part:.3g} % pass '{name}' ({variant}), the least")
        return "; ".join(filter(None, texts))
    except (OSError, ValueError, KeyError, TypeError):
        return f"its {STUDY} cannot be read"


def study_results(folder: Path) -> list[dict[str, Any]]:
    """Return the manifest of a study that has run, and its answers, which it has unless it was interrupted or has no report."""
    files = (folder / STUDY, folder / "answers.json")
    return [json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {} for file in files]


def show_study_run(folder: Path) -> bool:
    """Print what a study has found, and what to do with it; return True."""
    study, answers = study_results(folder)
    show_text(f"{folder}: {study_outcome(folder)}")
    show_text(study.get("title", ""))
    sentences = answers.get("sentences", ())
    for sentence in sentences:
        show_text(sentence["text"])
    report = folder / "report.html"
    case = next((sentence["case"] for sentence in sentences if sentence["case"]), 1)
    show_text(f"Repeat a case: twin run --case {folder}:{case}")
    show_text(f"Cases: {folder / 'cases.parquet'}{f'  Report: {report}' if answers else ''}")
    return True


def by_scenario(names: Iterable[str]) -> dict[str, list[str]]:
    """Group runs by their scenario, that of the latest run first."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(Path(name).parent.name, []).append(name)
    return groups


def outcome(folder: Path) -> str:
    """Return how a run ended, from its summary, and in what it differs from the whole scenario."""
    from twin.results import describe_outcome

    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        word, counts = describe_outcome(summary)
        text = f"{word} {counts.replace(' requirements', '')}".rstrip()
        if summary["status"] != "completed" and not summary["cases"]:
            text = f"{word}: nothing was simulated"
        return "; ".join([text, *settings(summary, folder / "scenario.yaml")])
    except (OSError, ValueError, KeyError, TypeError):
        return "its summary.json cannot be read"


def show_run(folder: Path) -> bool:
    """Print how a run ended, in what it differs from its scenario, failures, metrics, and what to do with it; return True."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    about = summary["scenario"]
    name = folder.resolve().name if folder.parent.parent == Path("runs") else folder
    show_text(f"{folder}: run of {about['name']}, {str(summary['started'])[:16].replace('T', ' ')}")
    changes = changes_of_run(Path(about.get("path", "")), folder)
    for line in (about["title"], changes, outcome(folder), summary.get("sentence", "")):
        if line:
            show_text(line)
    for entry in summary["expectations"]:
        if entry["verdict"] == "fail":
            show_text(f"{entry['name']}: {entry['detail']}", "FAIL    ")
    show_metrics(summary["metrics"])
    show_text(f"Look: twin view {name}")
    show_text(f"Compare with another run: twin compare {name} RUN")
    return True


def changes_of_run(scenario: Path, folder: Path) -> str:
    """Return what the scenario of a run changes in the one that it extends; empty if the file is newer than the run."""
    from twin.run import changes_of_base
    from twin.scenario import load_scenario

    try:
        is_same = scenario.is_file() and scenario.stat().st_mtime < (folder / "scenario.yaml").stat().st_mtime
        return changes_of_base(load_scenario(scenario)) if is_same else ""
    except (OSError, TwinError):
        return ""


def show_metrics(metrics: dict[str, Any]) -> None:
    """Print the metrics of a summary, means over the seeds, those that are judged first."""
    from twin.results import common_format, display_units, si_conversion

    units = display_units({name: metric["unit"] for name, metric in metrics.items()})
    rows = []
    for name, metric in metrics.items():
        factor, offset = si_conversion(metric["unit"])
        texts = [[entry["mean"], entry["paper"]] for entry in metric["variants"].values()]
        shown = common_format([x * factor + offset for pair in texts for x in pair if x is not None], units[name])
        for (variant, entry), pair in zip(metric["variants"].items(), texts, strict=True):
            cells = ["-" if value is None else shown.text(value * factor + offset) for value in pair]
            rows.append([name, variant, *cells, VERDICTS.get(entry["verdict"], entry["verdict"])])
    rows.sort(key=lambda row: (row[-1] != "fail", row[-1] == "-"))
    show_table(("metric", "variant", "mean", "reference", "verdict"), rows[:MAX_METRICS], 2, texts=1)
    if len(rows) > MAX_METRICS:
        show_text(f"and {len(rows) - MAX_METRICS} more in summary.json and the report")


def settings(summary: dict[str, Any], scenario: Path) -> list[str]:
    """Return the overrides of a run, its variants if not all of the scenario ran, and its seeds if not those of the scenario."""
    from twin.scenario import read

    study = summary.get("study")
    overrides = summary.get("overrides", [])
    if study:
        overrides = [*(f"{name}={value}" for name, value in study["factors"].items()), *study["overrides"]]
    more = [f"and {len(overrides) - MAX_OVERRIDES} more"] * (len(overrides) > MAX_OVERRIDES)
    texts = [", ".join(["set " + overrides[0], *overrides[1:MAX_OVERRIDES], *more])] if overrides else []
    try:
        root = read(scenario, scenario.name)
    except (OSError, ScenarioError):
        return texts
    variants, seeds = (list(dict.fromkeys(case[key] for case in summary["cases"])) for key in ("variant", "seed"))
    if 0 < len(variants) < len(root.get("variants").entries):
        texts.append(f"only {', '.join(quote_names(variants))}")
    if (
        seeds
        and seeds != [seed.value for seed in root.get("seeds").value or ()]
        and (seeds != [0] or "seeds" in root.entries)
    ):
        texts.append(f"seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}")
    return texts
