"""A run in Python: metrics, signals and plots, read from the run's folder on demand."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from twin import clock
from twin.errors import ScenarioError, SimulationError, TwinError, UnknownNameError, quote_names
from twin.face import arrays, notebook
from twin.face.conversions import choice, mapping, nanoseconds, override_text, python_option_names
from twin.face.signal_names import (
    array_of,
    find_variable,
    flatten,
    internal_names,
    names_of,
    variants_with,
)
from twin.face.signal_plots import OPERATORS, PlotSource, SignalPlots
from twin.files import split_unit
from twin.results import (
    Plot,
    RecordedVariable,
    Signals,
    compare_runs,
    dimension,
    export,
    find_results,
    list_empty_columns,
    list_recorded_variables,
    newer_note,
    read_variables,
    si_conversion,
)
from twin.run import RunOptions, event_rows
from twin.scenario import lint

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd
    import xarray as xr

    from twin.face.scenario import Scenario
    from twin.results import Comparison, EventLine
    from twin.scenario import ScenarioSpec


def open_run(path: str | Path) -> Run:
    """Open a finished run: by its folder, the last one with signals as `runs/SCENARIO/latest` or by the scenario's name in runs/.

    TwinError if there is none, with similar names. A newer run that failed without signals is named in `notes`.
    """
    folder = find_results(Path(path), "summary.json", "run", "heart_wall_force")
    note = newer_note(folder) if folder != Path(path) else ""
    return Run(folder, notes=[note] * bool(note))


CARD_WIDTH = 6.4  # of the plot in a notebook [in]: its letters stay legible where the notebook is narrow


def checked_run(folder: Path, scenario: Scenario | None = None, notes: Sequence[str] = ()) -> Run:
    """Return a run; one that failed raises SimulationError, or ScenarioError if no case began, with `error.run`."""
    run = Run(folder, scenario, notes)
    if run.status != "failed":
        return run
    problems = list(dict.fromkeys(run.reason.splitlines()))
    error: TwinError = ScenarioError(problems)
    if run.variants:
        error = SimulationError(
            [*problems, f"What was recorded is in {notebook.shown(folder)}, and here as error.run."]
        )
    error.run = run
    raise error


class Run(SignalPlots):
    """Results of a scenario: `metrics`, signals as `run["member.variable"]`, `plot`, `report`.

    `list(run)`: names of recorded signals; `summary`: content of summary.json. All else is read on demand.
    """

    def __init__(self, folder: str | Path, scenario: Scenario | None = None, notes: Sequence[str] = ()) -> None:
        self.folder = folder = Path(folder)
        try:
            self.summary: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise TwinError(f"{folder / 'summary.json'}: cannot be read ({error}). Run the scenario again.") from None
        if not isinstance(self.summary, dict):
            raise TwinError(f"{folder / 'summary.json'}: is not a JSON object. Run the scenario again.")
        self.notes: list[str] = [*notes, *self.summary.get("notes", [])]
        self._scenario, self._where = scenario, str(folder)

    @property
    def status(self) -> str:
        """`completed`, `interrupted` or `failed`."""
        return str(self.summary["status"])

    @property
    def reason(self) -> str:
        """Why the run ended early, or nothing."""
        return str(self.summary["reason"])

    @property
    def passed(self) -> bool:
        """Whether the run is complete and all judged requirements are met."""
        return bool(self.summary["passed"])

    def check(self) -> Run:
        """Return the run if it is complete and all judged requirements are met; else TwinError with a line for each failure."""
        if self.passed:
            return self
        raise TwinError([f"{self.folder}: {notebook.outcome(self.summary)[1]}", *notebook.failures(self.summary)])

    @property
    def variants(self) -> tuple[str, ...]:
        """Variants that were run."""
        return tuple(dict.fromkeys(case["variant"] for case in self.summary["cases"]))

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds that were run."""
        return tuple(dict.fromkeys(case["seed"] for case in self.summary["cases"]))

    @cached_property
    def signals(self) -> xr.Dataset:
        """All signals but internal states over time x variant x seed (x elements), units in `.attrs["units"]`; also `run[name]`."""
        variables = self._matching(["*"])
        return arrays.dataset(variables, read_variables(self._signals, variables), self.variants, self.seeds)

    @property
    def metrics(self) -> pd.DataFrame:
        """Columns metric, variant, seed, value (in its unit), unit, paper, ratio, verdict (on the mean over the seeds)."""
        return arrays.metrics(self.summary)

    @property
    def requirements(self) -> pd.DataFrame:
        """Columns name, verdict (pass, fail or skipped: not judged), detail."""
        return arrays.requirements(self.summary)

    @property
    def report(self) -> Path:
        """report.html."""
        path = self.folder / "report.html"
        if not path.exists():
            raise TwinError(f"{path}: does not exist. Run the scenario with report=True.")
        return path

    def resume(self, *, report: bool = True, build: str | Path = "build") -> Run:
        """Continue the run from its last checkpoints to its end, as a new run; TwinError if that is not possible."""
        return self._continued(None, (), report, build)

    def branch(
        self, at: float | str, values: Mapping[str, Any], *, report: bool = True, build: str | Path = "build"
    ) -> Run:
        """Continue the run from a time with changed values, as a new run. `values`: tunable parameters and free inputs by name."""
        changes = mapping(values, "values", '{"controller.setpoint": "0.3 N"}')
        overrides = [f"{name}={override_text(value)}" for name, value in changes.items()]
        return self._continued(nanoseconds(at, "at"), overrides, report, build)

    def _continued(self, at_ns: clock.Time | None, overrides: Sequence[str], report: bool, build: str | Path) -> Run:
        from twin.run import continue_run

        with python_option_names():
            options = RunOptions(root=self.folder.parents[1], build=Path(build), report=report)
            return checked_run(continue_run(self.folder, options, at_ns=at_ns, overrides=overrides).folder)

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run, to repeat it; ScenarioError if its components are missing."""
        if self._scenario is None:
            from twin.face.scenario import Scenario, load

            checked = load(self.folder / "scenario.yaml").checked
            name = self.summary["scenario"]["name"]  # of the folder of its runs
            self._scenario = Scenario(replace(checked, name=name), {})
        return self._scenario

    @cached_property
    def _checked(self) -> ScenarioSpec:
        """The scenario; of an earlier run as far as it can be read without its components."""
        return self._scenario.checked if self._scenario else lint(self.folder / "scenario.yaml", imports=False)[0]

    @cached_property
    def _declared(self) -> dict[str, RecordedVariable]:
        """Variables of all variants of the scenario, also of those that were not run."""
        return list_recorded_variables(self._signals)

    @cached_property
    def _recorded(self) -> dict[str, RecordedVariable]:
        empty = list_empty_columns(self._signals)
        return {name: item for name, item in self._declared.items() if not empty.issuperset(item.columns)}

    @property
    def _signals(self) -> Path:
        path = self.folder / "signals.parquet"
        if not path.exists():
            raise TwinError(f"{path}: does not exist any more. Run the scenario again.")
        return path

    def variable(self, name: str) -> RecordedVariable:
        """Return a recorded variable or element `sheath.x[3]`, counted from 1; UnknownNameError if there is none."""
        others = [] if name in self else variants_with(name, self._checked)
        if others and not set(others) & set(self.variants):
            these = f"{', '.join(quote_names(self.variants))} {'have' if len(self.variants) > 1 else 'has'}"
            raise UnknownNameError(f"{self.folder}: {these} no {name!r}. Run {' or '.join(quote_names(others))}.")
        return find_variable(name, self._recorded, self._where)

    @overload
    def __getitem__(self, name: str) -> xr.DataArray: ...
    @overload
    def __getitem__(self, name: list[str]) -> xr.Dataset: ...
    def __getitem__(self, name: str | list[str]) -> Any:
        """Return a variable over time x variant x seed (x element_of_N), in its own unit `.attrs["units"]`, as a DataArray.

        Also an expression, such as `sensor.force - wall.force`; either in another unit: `sensor.force [mN]`. A list of
        variables or a pattern, such as `sensor.*`, gives a Dataset. Variants that did not record it are omitted.
        """
        if not self.variants:
            raise TwinError(f"{self.folder}: no case has run, so there are no signals. {self.reason}".rstrip())
        if isinstance(name, list) or (isinstance(name, str) and self._names_of(name, self._recorded) != [name]):
            variables = self._matching([name])
            return arrays.dataset(variables, read_variables(self._signals, variables), self.variants, self.seeds)
        if not isinstance(name, str):
            example = 'run["sensor.force"].sel(variant="PI", seed=1)'
            raise UnknownNameError(f"{self.folder}: {name!r} is not the name of a signal. Use, for example, {example}.")
        base, symbol = split_unit(name)
        if symbol and name not in self:
            is_difference = base not in self and dimension.is_difference(self._parsed(base, self._recorded))
            return arrays.in_unit(self[base], symbol, is_difference)
        if name not in self and array_of(name, self._recorded) is None and any(sign in name for sign in OPERATORS):
            return self._evaluated(name)
        variable = self.variable(name)
        cases = read_variables(self._signals, [variable])
        return arrays.array(variable, {case: signals for case, signals in cases.items() if name in signals.values})

    def _evaluated(self, text: str) -> xr.DataArray:
        """Return the values of an expression, in the unit that follows from those of its signals, if known."""
        parsed = self._parsed(text, self._recorded)
        measure = self._measure(parsed)
        symbol = measure.unit
        factor, offset = si_conversion(symbol, dimension.is_difference(parsed))
        cases = {}
        for case, signals in read_variables(self._signals, [self._recorded[name] for name in names_of(parsed)]).items():
            if (result := signals.evaluate(parsed)) is not None:
                cases[case] = Signals(result[0], {text: (result[1] - offset) / factor})
        values = arrays.array(RecordedVariable(text, unit=symbol), cases)
        if measure.factors is None:
            del values.attrs["units"]  # unknown; "" means dimensionless
        return values

    def to_dataframe(self, *patterns: str | Sequence[str]) -> pd.DataFrame:
        """Return all samples: columns `variant`, `seed`, `time` [s], and one for each scalar; units in `.attrs["units"]`.

        `patterns`: names or patterns of variables; `*` by default. As `signals`, patterns leave out internal states.
        """
        return arrays.samples(self._signals, self._matching(patterns or ["*"]))

    def _matching(self, patterns: Sequence[str | Sequence[str]]) -> list[RecordedVariable]:
        """Return the variables with these names or patterns, all without any; UnknownNameError if there is none of one."""
        names = [name for text in flatten(patterns) for name in self._names_of(text, self._recorded)]
        return [self.variable(name) for name in dict.fromkeys(names if patterns else self)]

    def export(self, path: str | Path, *patterns: str | Sequence[str]) -> Path:
        """Write signals of all cases for other tools: .csv, .mat (MATLAB) or .mcap; return the path. `patterns`: as of `to_dataframe`."""
        target = Path(path)
        choice(
            target.suffix.lower(),
            (".csv", ".mat", ".mcap"),
            f"{path}: kind of file (for Parquet, take signals.parquet in the run's folder)",
        )
        if not target.parent.is_dir():
            raise TwinError(f"{path}: there is no folder {target.parent.resolve()}. Create it first.")
        export(
            self._signals, target, self._matching(patterns), {(c["variant"], c["seed"]) for c in self.summary["cases"]}
        )
        return target

    def compare(self, other: Run | str | Path, *patterns: str | Sequence[str], tolerance: float = 0.0) -> Comparison:
        """Compare with another run, sample by sample: `agrees`, tables of `signals` and `metrics`, `problems`.

        `tolerance`: relative. `patterns`: all signals, also internal states, with these names.
        """
        second = other if isinstance(other, Run) else open_run(other)
        return compare_runs((self.folder, second.folder), (self.summary, second.summary), tolerance, flatten(patterns))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of recorded signals."""
        return iter(self._recorded)

    def __contains__(self, name: object) -> bool:
        return name in self._recorded

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    @cached_property
    def _source(self) -> PlotSource:
        if not self.variants:
            raise TwinError(f"{self.folder}: nothing was run. The run failed: {self.reason}")
        rows = event_rows(self._checked.variants, self.summary.get("conditions", ()))
        return PlotSource(
            self.variants,
            self.seeds,
            self._declared,
            self._recorded,
            internal_names(self._checked),
            self._checked.plots,
            [row.annotation for row in rows],
            lambda names: read_variables(self._signals, [self._recorded[name] for name in names]),
        )

    def _find_recorded(self, name: str) -> RecordedVariable:
        return self.variable(name)

    @cached_property
    def _plots(self) -> Sequence[Plot]:
        return self._checked.plots

    @cached_property
    def _event_lines(self) -> list[EventLine]:
        rows = event_rows(self._checked.variants, self.summary.get("conditions", ()))
        return [row.annotation for row in rows]

    def __getstate__(self) -> dict[str, Any]:
        # the rest is read again from the folder
        return {
            "folder": self.folder.absolute(),
            "summary": self.summary,
            "notes": self.notes,
            "_scenario": None,
            "_where": self._where,
        }

    def __repr__(self) -> str:
        counts = (("variant", len(self.variants)), ("seed", len(self.seeds)))
        cases = " x ".join(f"{count} {kind}{'s' * (count != 1)}" for kind, count in counts)
        return f"<Run {self.folder}: {self.status}, {'passed' if self.passed else 'not passed'}, {cases}>"

    def __str__(self) -> str:
        return notebook.run_text(self.summary, self.folder)

    def _repr_html_(self) -> str:
        failures = [outcome for outcome in self.summary["expectations"] if outcome["verdict"] == "fail"]
        return notebook.page(
            notebook.heading(self.summary["scenario"]["title"]),
            notebook.state(self.summary),
            notebook.links(self.folder),
            notebook.paragraph(self.summary.get("sentence", "")),
            *map(notebook.paragraph, self.notes),
            notebook.requirements(failures),
            notebook.verdicts(self.summary),
            notebook.plot(self._first_plot()),
            notebook.folded("All requirements", notebook.requirements(self.summary["expectations"])),
            notebook.folded("System", notebook.scenario_system(self._checked)),
        )

    def _first_plot(self) -> str:
        """Return the first plot of the scenario as SVG; nothing without one, or if its signals were not recorded."""
        try:
            figure = self.plot(*[plot.title for plot in self._checked.plots[:1]], interactive=False)
        except TwinError:
            return ""
        figure.set_size_inches(CARD_WIDTH, figure.get_size_inches()[1])
        return str(figure._repr_svg_())
