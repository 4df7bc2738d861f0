"""From the keys of a recording to what is compared with what: read, look up, convert, with file and line of every mistake."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from twin import clock
from twin.coupling import Catalog, find
from twin.errors import ScenarioError, TwinError, nearest
from twin.identify.problem import Input, Output, RecordedExperiment, Unknown, named
from twin.identify.recordings import replay
from twin.identify.recordings.reader import KeyReader, member_of
from twin.identify.recordings.recorded_files import Column, RecordedFile
from twin.identify.recordings.schema import InputKeys, RangeKeys
from twin.run import resolve_catalogs
from twin.scenario import Case, Node, ScenarioSpec, load_scenario, made_scenario

SETTABLE = ("parameter", "input")
LONGEST = 10**6 * clock.NANOSECONDS  # a stop time that no recording reaches


class Loader(KeyReader):
    """One recording: `open`, `look`, `parameters`, `reduce`, `recording`, in this order and for all recordings at once.

    `separate`: what is looked for in this recording alone.
    """

    full_case: Case
    reduced: Case
    catalog: Catalog
    compared: list[Output]
    free: list[Unknown]  # delays and offsets
    driving: list[tuple[str, InputKeys, Column]]

    def __init__(self, path: Path, name: str, root: Node, separate: frozenset[str], problems: list[str]) -> None:
        super().__init__(path, root, problems)
        self.name, self.separate = name, separate

    def open(self) -> None:
        """Read the model and the files."""
        self.refuse_missing()
        self.model = self.scenario()
        self.sources = self.files()
        self.columns = self.read_columns(self.sources)

    def look(self) -> None:
        """Look up what is compared and what drives."""
        assert self.model is not None, "what is missing was told"
        self.full_case, self.catalog = self.case(self.model)
        self.compared, self.free = self.outputs(self.columns, self.catalog)
        self.driving = self.inputs(self.columns, self.catalog)

    def recording(self, unknowns: list[Unknown]) -> RecordedExperiment:
        """What is needed to simulate it."""
        assert self.model is not None, "what is missing was told"
        if self.keys.scenario:
            self.notes += replay.fixed_in_scenario(
                self.model, self.full_case, [unknown for unknown in unknowns if not unknown.recording]
            )
        case, outputs = self.timed(self.reduced, self.compared, self.driving, unknowns)
        self.stop_if_wrong()
        played = self.played(case, self.driving)
        case = replay.bind_tables(case, [table.values for table in played])
        model = self.keys.component or f"{self.model.name}, {case.variant}".removesuffix(", base")
        left_out = tuple(name for name in self.full_case.members if name not in case.members)
        return RecordedExperiment(
            self.name,
            case,
            replay.catalog_of(case, self.catalog),
            tuple(outputs),
            tuple(played),
            tuple(self.sources),
            model,
            left_out,
            self.separate,
        )

    def scenario(self) -> ScenarioSpec | None:
        """The model."""
        keys = self.keys
        options = [f"{name}={value}" for name, value in keys.set.items()]
        try:
            if keys.scenario:
                if not (self.folder / keys.scenario).is_file():
                    scenario_names = [folder.name for folder in (self.folder / keys.scenario).parent.glob("*.y*ml")]
                    self.add_problem(
                        f"there is no file {keys.scenario}. {nearest(Path(keys.scenario).name, scenario_names)}",
                        "scenario",
                    )
                    return None
                return load_scenario(self.folder / keys.scenario, options)
            if not keys.component:
                return None
            member: dict[str, Any] = {"component": keys.component}
            if parameters := self.given(keys.set):
                member["parameters"] = parameters
            data = {"stop_time": LONGEST // clock.NANOSECONDS, "members": {member_of(keys.component): member}}
            data["step"] = keys.step / clock.NANOSECONDS if keys.step else 1e-3
            return made_scenario(data, str(self.path))
        except ScenarioError as error:
            self.problems += [self.mapped(text) for text in error.problems]
        return None

    def given(self, values: dict[str, Any]) -> dict[str, Any]:
        """What `set` says of the only component."""
        name = member_of(self.keys.component)
        for key in values:
            if key.partition(".")[0] != name:
                self.add_problem(f"there is no member `{key.partition('.')[0]}`. Write {name}.parameter.", "set", key)
        return {key.removeprefix(f"{name}."): value for key, value in values.items() if key.startswith(f"{name}.")}

    def mapped(self, text: str) -> str:
        """A problem of an option, or of the only component, with the line that it stands for."""
        own = f"{self.path}: member `{member_of(self.keys.component)}`: "
        if text.startswith(own):
            return f"{self.location('component')}: component: {text.removeprefix(own)}"
        for name, value in self.keys.set.items():
            option = f"--set {name}={value}: "
            if text.startswith(option):
                return f"{self.location('set', name)}: set.{name}: {text.removeprefix(option)}"
        return text

    def files(self) -> list[RecordedFile]:
        """The recorded files that are there."""
        existing_files = []
        for i, item in enumerate(self.keys.data):
            path = ("data", i) if isinstance(self.root.find(("data",)).value, list) else ("data",)
            if not item.file:
                self.add_problem("`file` is missing. Add it, such as `file: em.csv`.", *path)
                continue
            try:
                existing_files.append(RecordedFile(item, self.folder))
                _ = existing_files[-1].names
            except TwinError as error:
                existing_files = [file for file in existing_files if file.keys is not item]
                self.add_problem(error, *path)
        return existing_files

    def read_columns(self, files: list[RecordedFile]) -> dict[str, Column]:
        """What `inputs` and `outputs` name, read."""
        columns: dict[str, Column] = {}
        for group in ("inputs", "outputs"):
            for name in getattr(self.keys, group):
                having = [file for file in files if name in file.names]
                if not having:
                    column_names = [column for file in files for column in file.names]
                    if len(files) == len(self.keys.data):
                        self.add_problem(
                            f"no file has this column{self.suffix}. {nearest(name, column_names, '`')}", group, name
                        )
                elif len(having) > 1:
                    listed = " and ".join(file.shown for file in having)
                    self.add_problem(f"{listed} have this column. Rename one of them.", group, name)
                else:
                    try:
                        columns[name] = having[0].column(name)
                    except TwinError as error:
                        self.problems += str(error).split("\n")
        return columns

    def case(self, scenario: ScenarioSpec) -> tuple[Case, Catalog]:
        """The variant that is meant, and its variables."""
        names = [variant.variant for variant in scenario.variants]
        wanted = self.keys.variant
        if wanted and wanted not in names:
            self.add_problem(f"there is no variant `{wanted}`. {nearest(wanted, names, '`')}", "variant")
            self.stop_if_wrong()
        if not wanted and len(names) > 1:
            self.add_problem(f"has variants. Add one, such as variant: {names[0]}", "scenario")
            self.stop_if_wrong()
        try:
            catalogs = resolve_catalogs(scenario)
        except ScenarioError as error:
            self.problems += [self.mapped(text) for text in error.problems]
            self.stop_if_wrong()
        case = scenario.cases([wanted] if wanted else [], [self.keys.seed] if self.keys.seed is not None else [])[0]
        return case, catalogs[case.variant]

    def outputs(self, columns: dict[str, Column], catalog: Catalog) -> tuple[list[Output], list[Unknown]]:
        """What is compared, and delays and offsets that are looked for."""
        outputs, unknowns = [], []
        for name, keys in self.keys.outputs.items():
            path = ("outputs", name)
            variable = self.looked_up(keys.signal, catalog, *path)
            if variable is None or name not in columns:
                continue
            if variable.shape:
                self.add_problem(f"{keys.signal} is an array. Name one element, such as {keys.signal}[1].", *path)
                continue
            own: dict[str, float | str] = {}
            for key, symbol in (("delay", "s"), ("offset", variable.unit)):
                raw = getattr(keys, key)
                if not isinstance(raw, RangeKeys):
                    own[key] = self.quantity(raw, symbol, *path, key, is_difference=True)
                    continue
                own[key] = label = named(f"{key} of {name}", self.name)
                window = self.range(raw, symbol, 0.0, *path, key)
                shown = "ms" if key == "delay" else variable.display_unit
                where = self.location(*path, key)
                unknowns.append(Unknown(label, symbol, *window, raw.scale == "log", display_unit=shown, where=where))
            before = len(self.problems)
            noise = (
                None
                if keys.noise is None
                else self.quantity(keys.noise, variable.unit, *path, "noise", is_difference=True)
            )
            if noise is not None and noise <= 0 and len(self.problems) == before:
                self.add_problem(f"{keys.noise} is not above zero. {self.noise_advice}", *path, "noise")
            column = columns[name]
            values = self.converted(column, variable, keys, *path)
            element = find(keys.signal, catalog).element or 0
            outputs.append(
                Output(
                    name,
                    column.file,
                    keys.signal,
                    variable.unit,
                    variable.display_unit,
                    column.time,
                    values,
                    own["delay"],
                    own["offset"],
                    element,
                    noise,
                    keys.weight,
                    self.name,
                )
            )
        return outputs, unknowns

    def inputs(self, columns: dict[str, Column], catalog: Catalog) -> list[tuple[str, InputKeys, Column]]:
        """What drives the model, in the variables' units."""
        input_columns = []
        for name, keys in self.keys.inputs.items():
            path = ("inputs", name)
            variable = self.looked_up(keys.signal, catalog, *path)
            if variable is None or name not in columns:
                continue
            if variable.causality not in ("input", "output", "local"):
                self.add_problem(
                    f"{keys.signal} is {variable.causality}. Name an input, or an output that others read.", *path
                )
            if variable.shape:
                self.add_problem(f"{keys.signal} is an array. Name one element, such as {keys.signal}[1].", *path)
            values = self.converted(columns[name], variable, keys, *path)
            values = values + self.quantity(keys.offset, variable.unit, *path, "offset", is_difference=True)
            input_columns.append((name, keys, replace(columns[name], values=values)))
        return input_columns

    def parameters(self, loaders: Sequence[Loader]) -> Iterator[Unknown]:
        """The members' parameters that are looked for; those of all recordings by the first of them that has the member."""
        case, catalog = self.full_case, self.catalog
        for name, keys in self.keys.fit.items():
            path = ("fit", name)
            separate = name in self.separate
            if not separate and self is not owner(name, loaders):
                continue
            variable = self.looked_up(name, catalog, *path)
            if variable is None:
                continue
            member, _, inner = name.partition(".")
            if variable.causality not in SETTABLE and variable.initial not in ("exact", "approx"):
                self.add_problem(f"is {variable.causality}, no parameter. Name a parameter or an input.", *path)
                continue
            given, problems = case.members[member].values(member, catalog[member])
            self.problems += problems
            reference = find(name, catalog)
            now = np.ravel(given.get(reference.variable.name, reference.variable.start))
            now = now[reference.first : reference.first + reference.size]
            low, high, start = self.range(keys, variable.unit, float(now[0]), *path)
            for bound in (low, high):
                wrong, advice = replace(variable, shape=()).outside(bound)
                if wrong:
                    self.add_problem(f"{wrong.removeprefix(': ')}. {advice}", *path)
            own = self.name if separate else ""
            yield Unknown(
                named(name, own),
                variable.unit,
                low,
                high,
                start,
                keys.scale == "log",
                member,
                inner,
                variable.display_unit,
                self.location(*path),
                own,
            )

    def alone(self, unknowns: list[Unknown]) -> None:
        """A parameter set has one value for all members of a component."""
        case = self.full_case
        first_uses: dict[tuple[str, str], str] = {}
        for unknown in unknowns:
            if unknown.member not in case.members or unknown.recording:
                continue
            component = case.members[unknown.member].component
            other = first_uses.setdefault((component, unknown.variable), unknown.name)
            if other != unknown.name:
                self.add_problem(
                    f"{other} is of component {component}, too, and a parameter set has one value for both. Look for one "
                    f"of them, and set the other.",
                    "fit",
                    unknown.name,
                )
            elif others := [
                name for name, spec in case.members.items() if spec.component == component and name != unknown.member
            ]:
                self.notes.append(f"{unknown.name}: the parameter set holds for {' and '.join(others)}, too.")

    def reduce(self) -> None:
        """Let the inputs drive the case, and leave out what has no influence then."""
        try:
            driven_case = replay.with_recorded_inputs(
                self.full_case, self.catalog, [variable.signal for variable in self.keys.inputs.values()]
            )
        except TwinError as error:
            self.add_problem(error, "inputs")
            self.stop_if_wrong()
        self.reduced = replay.with_influence(driven_case, [output.signal for output in self.keys.outputs.values()])

    @property
    def suffix(self) -> str:
        """` of NAME` for messages, if there are several recordings."""
        return f" of {self.name}" if self.name else ""

    def timed(
        self, case: Case, outputs: list[Output], inputs: list[tuple[str, InputKeys, Column]], unknowns: list[Unknown]
    ) -> tuple[Case, list[Output]]:
        """The case over the time that is needed, and the measured values that lie in it, whatever their delay is."""
        step = case.step_ns
        start = case.start_ns
        if self.keys.component:
            first = max((column.time[0] for *_, column in inputs), default=0.0)
            start = -int(-round(first * clock.NANOSECONDS) // step) * step
        begin = clock.seconds(start)
        end = min([clock.seconds(case.stop_ns), *(column.time[-1] for *_, column in inputs)])
        columns_without_start = [column for *_, column in inputs if column.time[0] > begin + clock.seconds(step)]
        self.notes += [
            f"{signal.name}: its first value, at {signal.time[0]:.4g} s, is held from {begin:.4g} s on."
            for signal in columns_without_start
        ]
        first = -np.inf if self.keys.start is None else clock.seconds(self.keys.start)
        last = np.inf if self.keys.stop is None else clock.seconds(self.keys.stop)
        delays = {unknown.name: (unknown.low, unknown.high) for unknown in unknowns}
        trimmed_outputs, needed = [], begin
        for output in outputs:
            low, high = delays[output.delay] if isinstance(output.delay, str) else (output.delay, output.delay)
            inside = (output.time >= max(first, begin + high) - 1e-9) & (output.time <= min(last, end + low) + 1e-9)
            if not inside.any():
                self.add_problem(
                    f"no value lies between {max(first, begin + high):.4g} s and {min(last, end + low):.4g} s of the run{self.suffix}: "
                    f"the file has {output.time[0]:.4g} s to {output.time[-1]:.4g} s. Change from, to or the start of its data.",
                    "outputs",
                    output.column,
                )
                continue
            trimmed_outputs.append(replace(output, time=output.time[inside], values=output.values[inside]))
            needed = max(needed, float(trimmed_outputs[-1].time[-1]) - low)
        stop = start + max(1, int(-((start - round(needed * clock.NANOSECONDS)) // step))) * step
        return replace(case, start_ns=start, stop_ns=stop), trimmed_outputs

    def played(self, case: Case, inputs: list[tuple[str, InputKeys, Column]]) -> list[Input]:
        """The inputs at every communication point."""
        begin, step, per_second = clock.to_ticks(case.start_ns, case.step_ns, case.stop_ns)
        times = (begin + np.arange((case.stop_ns - case.start_ns) // case.step_ns + 1) * step) / per_second
        gaps = {item.file: item.gap for item in self.keys.data}
        replays = []
        for name, keys, column in inputs:
            try:
                column.refuse_gaps(gaps.get(column.file), float(times[0]), float(times[-1]))
            except TwinError as error:
                self.problems.append(str(error))
            values = np.ascontiguousarray(np.interp(times, column.time, column.values))
            replays.append(Input(name, column.file, keys.signal, values))
        self.stop_if_wrong()
        return replays


def owner(name: str, loaders: Sequence[Loader]) -> Loader:
    """The recording that says what is looked for in all: the first that has the member."""
    sharing = [loader for loader in loaders if name not in loader.separate]
    return next((loader for loader in sharing if name.partition(".")[0] in loader.catalog), sharing[0])
