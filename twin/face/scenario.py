"""A scenario file in Python: content, changed values, runs; functions that run, step or follow a file in one call."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.component import Component, source
from twin.errors import ScenarioError, TwinError, quote_names
from twin.face import notebook
from twin.face.conversions import (
    BackendName,
    as_list,
    check_file,
    choice,
    integers,
    mapping,
    nanoseconds,
    override_text,
    python_option_names,
)
from twin.face.finished_run import Run, checked_run
from twin.face.progress import progress_callback
from twin.face.simulation import Simulation, sourceless
from twin.former import former_argument
from twin.live import checked_rate
from twin.run import (
    WARNING,
    RunCallbacks,
    RunOptions,
    refuse_faults,
    remarks_on_values,
    resolve_catalogs,
    run_scenario,
    value_remarks,
)
from twin.scenario import Backend, changed, lint, resolve_variables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.face.progress import Progress
    from twin.follow import Following
    from twin.scenario import ScenarioSpec

CAUSALITIES = "input output parameter"  # in the order of messages


def load(path: str | Path) -> Scenario:
    """Read and check a scenario file; ScenarioError with all `problems`, as of `twin check`."""
    check_file(path, "scenario", (".yaml", ".yml"), ScenarioError)
    checked, problems = lint(path)
    if problems:
        raise ScenarioError(problems)
    return Scenario(checked, {})


class Scenario:
    """A checked scenario file, immutable. `checked`: the object of the command line."""

    def __init__(self, checked: ScenarioSpec, classes: Mapping[str, type[Component]]) -> None:
        self._classes = dict(classes)  # by name in the scenario
        variants = []
        for case in checked.variants:
            members = {
                name: replace(member, made=self._classes.get(member.component, member.made))
                for name, member in case.members.items()
            }
            variants.append(replace(case, members=members))
        self.checked = replace(checked, variants=tuple(variants))

    @property
    def name(self) -> str:
        """Name of the file, and of the folder of its runs."""
        return self.checked.name

    @property
    def title(self) -> str:
        """Title."""
        return self.checked.title

    @property
    def description(self) -> str:
        """Purpose."""
        return self.checked.description

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self.checked.path

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, in the order of the file."""
        return tuple(case.variant for case in self.checked.variants)

    @property
    def seeds(self) -> tuple[int, ...]:
        """Random seeds of each variant."""
        return self.checked.seeds

    @property
    def plots(self) -> tuple[str, ...]:
        """Titles of the plots."""
        return tuple(plot.title for plot in self.checked.plots)

    def set(self, name: str, value: Any) -> Scenario:
        """Return the scenario with another value; this one is unchanged. ScenarioError with all `problems`.

        `name` is that of `twin run --set`: `member.parameter`, `member.component`, `variants.NAME.member.parameter`,
        `stop_time`, `step`, `seeds`, ... `value`: text with a unit, a number in its own unit, a list or an array; for a component
        also a class. It applies to all variants, also where a variant sets the value: name the variant to change only this one.
        """
        return self._with_values({name: value})

    def _with_values(self, values: Mapping[str, Any]) -> Scenario:
        classes, overrides, replaced = dict(self._classes), [], {}
        for name, value in values.items():
            text = reference(value, classes) if isinstance(value, type) else override_text(value)
            if isinstance(value, type):
                classes[text] = value
                replaced[name.removesuffix(".component").rpartition(".")[2]] = value
            overrides.append(f"{name}={text}")
        with python_option_names():
            try:
                scenario = Scenario(changed(self.checked, overrides), classes)
                resolve_catalogs(scenario.checked)
            except ScenarioError as error:
                raise ScenarioError(with_missing_connectors(error.problems, self.checked, replaced)) from None
        return scenario

    def run(
        self,
        variants: str | Sequence[str] | None = None,
        seeds: int | Sequence[int] | None = None,
        *,
        progress: Progress = None,
        report: bool = True,
        out: str | Path = "runs",
        build: str | Path = "build",
        backend: BackendName = "fmu",
        checkpoint: float | str = 0.0,
        form: BackendName | None = None,
    ) -> Run:
        """Run variants with seeds, default all, and write the folder `out/<name>/<time>/`.

        `progress`: by default shown after 3 s in a terminal or notebook; True: at once, False: never, or a callback with a case's
        name and its completed fraction. `backend`: fmu, compiled or interpreted, which is slow. `checkpoint`: simulated time between
        two checkpoints, for `Run.resume` and `Run.branch`.

        SimulationError if a member fails, ScenarioError if no case could begin; `error.run` has what was recorded. Ctrl-C ends the
        run early: its `status` is `interrupted`. For requirements that are not met, see `Run.check`.
        """
        backend = former_argument("form", form, "backend", backend)
        with python_option_names(), progress_callback(progress, self.title) as report_progress:
            options = RunOptions(
                backend=Backend(choice(backend, Backend, "backend")),
                variants=as_list(variants),
                seeds=integers(seeds, "seeds"),
                root=Path(out),
                build=Path(build),
                report=report,
                checkpoint_ns=nanoseconds(checkpoint, "checkpoint"),
            )
            outcome = run_scenario(self.checked, options, callbacks=RunCallbacks(progress=report_progress))
        notes = [] if backend == Backend.interpreted else sourceless(self._classes.values())
        return checked_run(outcome.folder, self, notes)

    def simulate(
        self,
        variant: str | None = None,
        seed: int | None = None,
        *,
        backend: BackendName = "compiled",
        build: str | Path = "build",
    ) -> Simulation:
        """Initialize the members of one case and return it as a simulation, to be advanced from Python; nothing is written.

        `variant`, `seed`: the first of the scenario by default. Events of the scenario happen at their time, and the signals
        of `record` are in its `results`. `backend`: compiled, fmu or interpreted.
        """
        for kind, names in (("variant", as_list(variant)), ("seed", as_list(seed))):
            if len(names) > 1:
                raise TwinError(f"{kind}: a simulation has one, not {len(names)}. Give one, or use `run`.")
        cases = self.checked.cases(as_list(variant), integers(seed, "seed"))
        case = cases[0]
        refuse_faults([case], None)
        catalogs = resolve_catalogs(self.checked)
        catalog = catalogs[case.variant]
        remarks = partial(value_remarks, self.checked, case, catalog)
        chosen = Backend(choice(backend, Backend, "backend"))
        with progress_callback(None, f"preparing {self.title}"):
            simulation = Simulation(case, catalog, chosen, Path(build), True, False, remarks, self.checked.plots)
        simulation.notes += [line for line in remarks_on_values(self.checked, catalogs) if line.startswith(WARNING)]
        return simulation

    def __reduce__(self) -> tuple[Any, ...]:
        # variants have generated classes; they are resolved again from the content of the file
        return restored, (replace(self.checked, variants=()), self._classes)

    def __repr__(self) -> str:
        variants, seeds = ", ".join(quote_names(self.variants)), ", ".join(map(str, self.seeds))
        return f"<Scenario {self.name}: {self.title}; variants {variants}; seeds {seeds}>"

    def _repr_html_(self) -> str:
        checked = self.checked
        titles = [(escape(variant.variant), escape(variant.title)) for variant in checked.variants]
        overrides = f"set: {', '.join(checked.overrides)}" if checked.overrides else ""
        return notebook.page(
            notebook.heading(checked.title),
            notebook.paragraph(checked.description),
            notebook.paragraph(overrides),
            notebook.table({"variant": "text", "what": "text"}, titles if len(titles) > 1 else []),
            notebook.scenario_system(checked),
        )


def restored(checked: ScenarioSpec, classes: Mapping[str, type[Component]]) -> Scenario:
    """Return a pickled scenario."""
    return Scenario(replace(changed(checked, ()), name=checked.name), classes)


def reference(cls: type, classes: Mapping[str, type[Component]]) -> str:
    """Return the name of a class in a scenario; earlier classes of the same name get other names."""
    if not issubclass(cls, Component):
        raise ScenarioError(f"{cls.__name__} is not a component. Derive it from twin.component.Component.")
    if problems := list(source.declaration_problems(cls)):
        raise ScenarioError([f"{source.location(cls)}: {line.removeprefix(f'{cls.__name__}.')}" for line in problems])
    text = f"{cls.__module__}:{cls.__qualname__}"
    while classes.get(text, cls) is not cls:
        text += "'"
    return text


def with_missing_connectors(
    problems: Sequence[str], scenario: ScenarioSpec, classes: Mapping[str, type[Component]]
) -> list[str]:
    """Replace the problems of variables that a member's new class lacks by one that names the class and the variables."""
    for member, cls in classes.items():
        lacks = re.compile(rf"(?<![\w.]){re.escape(member)} has no variable [`']([^`'\[]+)")
        names = dict.fromkeys(match[1] for problem in problems for match in lacks.finditer(problem))
        if not names:
            continue
        catalogs = resolve_variables(scenario)[0].values()
        declared = {name: item for catalog in catalogs for name, item in catalog.get(member, {}).items()}
        needs: dict[str, list[str]] = {}
        for name in names:
            kind, symbol = (declared[name].causality, declared[name].unit) if name in declared else ("variable", "")
            needs.setdefault(kind, []).append(f"{name} [{symbol}]" if symbol else name)
        kinds = sorted(needs, key=CAUSALITIES.find)
        text = ", ".join(f"{kind}{'s' * (len(needs[kind]) > 1)} {', '.join(needs[kind])}" for kind in kinds)
        line = f"{source.location(cls)}: as `{member}` of {scenario.name} it needs {text}. Declare them."
        problems = [line, *(problem for problem in problems if not lacks.search(problem))]
    return list(problems)


def run(
    scenario: str | Path | Scenario | Run,
    variants: str | Sequence[str] | None = None,
    seeds: int | Sequence[int] | None = None,
    *,
    values: Mapping[str, Any] | None = None,
    progress: Progress = None,
    report: bool = True,
    out: str | Path = "runs",
    build: str | Path = "build",
    backend: BackendName = "fmu",
    checkpoint: float | str = 0.0,
) -> Run:
    """Run a scenario, by its path, the name of a shipped one or a run of it, with changed `values`; ScenarioError with all `problems`.

        run = twin.run("heart_wall_force", "PI", values={"heart.rate": "1.4 Hz"})
        run.metrics; run["sensor.measured_force"]

    `values`: by name, as of `Scenario.set`. `variants`, `seeds`: all of the scenario by default. `progress`: as of
    `Scenario.run`. `report`: whether report.html is written. `out`: folder of the run folders, `build`: of compiled FMUs.
    `backend`: fmu, compiled or interpreted. `checkpoint`: simulated time [s] between checkpoints; 0: none.
    """
    return with_values(scenario, values).run(
        variants,
        seeds,
        progress=progress,
        report=report,
        out=out,
        build=build,
        backend=backend,
        checkpoint=checkpoint,
    )


def live(
    scenario: str | Path | Scenario | Run,
    variant: str | None = None,
    seed: int | None = None,
    *,
    values: Mapping[str, Any] | None = None,
    rate: float = 1.0,
    backend: BackendName = "compiled",
    build: str | Path = "build",
) -> Simulation:
    """Initialize one case of a scenario and return it as a simulation that `advance` paces against the wall clock.

        with twin.live("heart_wall_force", "PI") as simulation:
            simulation.advance("5 s")
            simulation["controller.setpoint"] = "0.3 N"
            simulation.advance(until=simulation.stop_time)

    `rate`: simulated over wall-clock time, 0.1 to 10, or inf: as fast as possible. `values`: by name, as of `Scenario.set`,
    also of fixed parameters. All else as of `Scenario.simulate`; signals are those of `run` to the bit if nothing is set.
    """
    checked_rate(rate, "rate")
    simulation = with_values(scenario, values).simulate(variant, seed, backend=backend, build=build)
    simulation.rate = rate
    return simulation


def with_values(scenario: str | Path | Scenario | Run, values: Mapping[str, Any] | None) -> Scenario:
    """Return a scenario, or that of a run, with changed values."""
    if isinstance(scenario, Run):
        scenario = scenario.scenario
    original = scenario if isinstance(scenario, Scenario) else load(scenario)
    changes = mapping(values, "values", '{"heart.rate": "1.4 Hz"}')
    return original._with_values(changes) if changes else original


def follow(
    file: str | Path,
    *,
    recording: str | Path | None = None,
    rig: str | Path | None = None,
    build: str | Path = "build",
) -> Following:
    """Return the estimates of a follow file's recording or rig, to be iterated; ScenarioError with all problems."""
    from twin.follow import Following

    check_file(file, "file", (".yaml", ".yml"), ScenarioError)
    return Following(file, recording, rig, build)
