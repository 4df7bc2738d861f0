"""One case of a study again, with all its signals: `twin run --case STUDY:713`. It repeats to the bit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from twin import clock
from twin.errors import ScenarioError
from twin.run import RunOptions, RunResult, StudyCase, resolve_catalogs, run_scenario
from twin.scenario import Backend, ScenarioSpec, load_scenario, with_events
from twin.study.design import Assignment, Distribution, Factor, option
from twin.study.execution import case_table, manifest
from twin.study.execution.case_engine import DONE

STUDY_FILES = (".yaml", ".yml")


@dataclass(frozen=True)
class Single:
    """A case of a study as a scenario file with options. `events`: time [ns] -> options that take effect then.

    `factors`: their values as text; `chosen`: the options that set them.
    """

    number: int
    file: Path
    options: tuple[str, ...]
    variant: str
    seed: int
    row: dict[str, Any]
    events: dict[clock.Time, list[str]] = field(default_factory=dict)
    study: str = ""
    folder: Path = Path()
    factors: dict[str, str] = field(default_factory=dict)
    chosen: tuple[str, ...] = ()

    @property
    def about(self) -> StudyCase:
        """What the page of a run tells of this case."""
        return StudyCase(self.study, self.number, self.factors, self.chosen, self.folder)

    def applied_to(self, scenario: ScenarioSpec) -> ScenarioSpec:
        """Return a scenario with the title and the events of this case."""
        for time_ns, options in self.events.items():
            scenario = with_events(scenario, time_ns, options, self.variant)
        return replace(scenario, title=f"Case {self.number} of {self.study}, {self.variant}")

    def different(self, run: RunResult) -> list[str]:
        """Metrics of a run that are not those of the study to the bit, with both values."""
        differences = []
        for figure in run.evaluation.metric_results:
            name, value = figure.metric.name, figure.values.get(self.seed)
            before = self.row.get(name)
            if before != value and not (before is None and figure.verdict == "cut"):
                differences.append(f"{name} {figure.metric.shown(value)}, in the study {figure.metric.shown(before)}")
        return differences

    def compared(self, run: RunResult) -> str:
        """Whether a run did what the study did, in one line."""
        if not run.evaluation.metric_results and self.row["status"] == DONE:
            return f"case {self.number}: no metric, unlike in the study"
        if different := self.different(run):
            return f"case {self.number}: not as in the study: {'; '.join(different)}"
        return f"case {self.number}: metrics as in the study, to the bit"


def resolve_case(text: str, root: Path) -> tuple[Path, int]:
    """Folder and number that `STUDY:713` names: a study's folder, its file, or the name of one that has run."""
    where, colon, digits = text.rpartition(":")
    if not colon or not digits.isdigit() or not where:
        raise ScenarioError(f"--case {text}: expected STUDY:NUMBER, such as thousand_patients:713.")
    path = Path(where)
    if (path / manifest.NAME).exists():
        return path, int(digits)
    name = path.stem if path.suffix in STUDY_FILES else path.name
    folders = manifest.study_folders(root / name, case_table.NAME)
    if not folders:
        raise ScenarioError(f"--case {text}: no study {name} has run in {root}. Name its folder, or run it first.")
    return folders[-1], int(digits)


def stored_case_folder(text: str, root: Path) -> Path:
    """Folder of the run of a case that a study has kept with its signals; ScenarioError if it has not."""
    folder, number = resolve_case(text, root)
    runs = stored_cases(folder)
    if number not in runs:
        case_table.single(folder, number)  # ScenarioError if the study has no such case
        available = f"Kept: {', '.join(map(str, runs))}. " if runs else ""
        raise ScenarioError(
            f"{text}: the study did not keep this case's signals. {available}Run it again: twin run --case {text}"
        )
    return runs[number]


def stored_cases(folder: Path) -> dict[int, Path]:
    """Folders of the runs of all cases that a study has kept with their signals, by number."""
    return {int(number): folder / str(run) for number, run in manifest.read(folder).get("runs", {}).items()}


def study_of_run(folder: Path) -> Path | None:
    """Folder of the study that a run belongs to, or is itself; None for other runs."""
    for candidate in [folder, *folder.parents[:3]]:
        if (candidate / manifest.NAME).is_file() and (candidate / case_table.NAME).is_file():
            return candidate
    return None


def single(folder: Path, number: int) -> Single:
    """A case as a scenario with the options that make it what it was."""
    row = case_table.single(folder, number)
    study_manifest = manifest.read(folder)
    file, made = folder / study_manifest["frozen"], tuple(study_manifest["options"])
    frozen = load_scenario(file, made)
    variant = str(row["variant"])
    (case,) = (case for case in frozen.variants if case.variant == variant)
    factors = factors_of(study_manifest)
    values = [float("nan") if row[factor.name] is None else float(row[factor.name]) for factor in factors]
    assignment = Assignment(case, resolve_catalogs(frozen)[variant], factors)
    chosen = tuple(assignment.options(values))
    events: dict[clock.Time, list[str]] = {}
    for event in assignment.events(values):
        events.setdefault(event.time_ns, []).append(option(event.variable, event.value))
    return Single(
        number,
        file,
        (*made, *chosen),
        variant,
        int(row["seed"]),
        row,
        events,
        study_manifest["title"],
        folder,
        {factor.name: factor.shown(value) for factor, value in zip(factors, values, strict=True)},
        chosen,
    )


def factors_of(study_manifest: dict[str, Any]) -> list[Factor]:
    """What varied, as the manifest tells it."""
    unknown = Distribution("values", (0.0,))
    return [
        Factor(
            entry["name"],
            tuple(entry["sets"]),
            tuple(entry["scales"]),
            unknown,
            entry["unit"],
            entry.get("display_unit", ""),
            source=entry["source"],
            at_ns=None if entry.get("at_ns") is None else clock.from_json(entry["at_ns"]),
        )
        for entry in study_manifest["factors"]
    ]


def repeat(folder: Path, number: int, *, root: Path = Path("runs"), build: Path = Path("build")) -> RunResult:
    """Run a case again, with everything that `twin run` writes."""
    single_case = single(folder, number)
    options = RunOptions(
        backend=Backend.compiled,
        variants=[single_case.variant],
        seeds=[single_case.seed],
        root=root,
        build=build,
        study_case=single_case.about,
    )
    return run_scenario(single_case.applied_to(load_scenario(single_case.file, single_case.options)), options)
