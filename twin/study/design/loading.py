"""From a study file to a study; every mistake is told at once, with its line.

Over 400 lines: all checks of one file.
"""

from __future__ import annotations

import re
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import CouplingError, ScenarioError
from twin.identify import ValueReader, read_estimate
from twin.results import dimension, expression
from twin.run import resolve_catalogs
from twin.scenario import (
    ScenarioSpec,
    check_events,
    event_problems,
    load_scenario,
    nearest,
    number,
    read,
    scenario_paths,
    validate,
)
from twin.study.design.factor import Assignment, Factor, limit_in_si, unit_of
from twin.study.design.keys import FactorKeys, StudyKeys
from twin.study.design.sampling import INDEPENDENT, LISTED, Distribution, design, wrong_numbers
from twin.study.design.study import Knob, Limit, Study, is_cut

if TYPE_CHECKING:
    from twin.coupling import Catalog

DISTRIBUTIONS = ("uniform", "log_uniform", "normal", "log_normal", "values", "grid")
EXAMPLE = "uniform: [50 /min, 100 /min]"
LARGEST = 1_000_000  # samples
DIGITS = re.compile(r"^\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?")


def load_study(path: str | Path) -> Study:
    """Read and check a study file; ScenarioError lists all problems."""
    return StudyLoader(scenario_paths.located(path, "study")).study()


class StudyLoader(ValueReader):
    """The keys of a study file with where they stand; `problems` grow on the way."""

    def __init__(self, path: Path) -> None:
        self.path = path
        problems: list[str] = []
        content = read(path, str(path), problems)
        names = content.plain() if isinstance(content.value, dict) else {}
        if "scenario" not in names and {"members", "extends"} & names.keys():
            raise ScenarioError(f"{path}: is a scenario: twin run {path}")
        keys, root, key_problems = validate(content, StudyKeysOrNone)
        super().__init__(root, problems + key_problems)
        if not getattr(keys, "scenario", ""):
            self.add_problem("is missing. Add it, such as `scenario: ../heart_wall_force.yaml`.", "scenario")
            self.stop_if_wrong()
        self.keys: StudyKeys = StudyKeys.model_validate(self.root.plain())

    def study(self) -> Study:
        """The study."""
        keys = self.keys
        self.scenario = self._scenario()
        self.variants = self._variants()
        self.catalog = self._catalog(self.catalogs)
        factors = [self._factor(name, factor_keys) for name, factor_keys in keys.vary.items()]
        factors += self._estimates()
        valid_factors = [factor for factor in factors if factor]
        self._refuse_twice(valid_factors)
        self._refuse_metrics(valid_factors)
        correlation = self._correlation(valid_factors)
        self._refuse_method(valid_factors, correlation)
        self._refuse_times(valid_factors)
        bands = {
            name: self._expression(band.signal, band.unit, "keep", "bands", name)
            for name, band in keys.keep.bands.items()
        }
        knobs, limits = self._knobs(), self._limits()
        self.stop_if_wrong()
        samples = keys.samples
        return Study(
            self.path,
            keys,
            self.scenario,
            self.catalogs,
            self.variants,
            tuple(valid_factors),
            correlation,
            design(samples.method, samples.count, samples.seed, valid_factors, correlation),
            {name: signal for name, signal in bands.items() if signal},
            {k: band.unit for k, band in keys.keep.bands.items()},
            tuple(knobs),
            tuple(limits),
        )

    def _scenario(self) -> ScenarioSpec:
        options = [
            f"{path}={value!r}" if not isinstance(value, str) else f"{path}={value}"
            for path, value in self.keys.set.items()
        ]
        path = self._located()
        try:
            scenario = load_scenario(path, options)
            self.catalogs = resolve_catalogs(scenario)
        except ScenarioError as error:
            own = [self._is_of_set(problem, options) for problem in error.problems]
            if not all(own):
                raise ScenarioError([*self.problems, *error.problems]) from None
            scenario = load_scenario(path)  # for the other checks of the file
            self.catalogs = resolve_catalogs(scenario)
        return scenario

    def _is_of_set(self, problem: str, options: list[str]) -> bool:
        """Whether a problem of the scenario is one of `set`, to whose line it is added."""
        for path, option in zip(self.keys.set, options, strict=True):
            if problem.startswith(f"--set {option}: "):
                self.add_problem(problem.removeprefix(f"--set {option}: "), "set", path)
                return True
        return False

    def _located(self) -> Path:
        """Path of the scenario: as seen from the study's file, or that of a shipped one by its name."""
        path, problem = self.path.parent / self.keys.scenario, ""
        try:
            if not path.exists():
                path = scenario_paths.located(path if path.suffix else self.keys.scenario)
        except ScenarioError as error:
            problem = str(error).replace("There is", "there is", 1)
        if not problem and not path.exists():
            problem = f"{path}: is not there. Give a path as seen from this file, or a name of `twin list`."
        if problem:
            self.add_problem(problem, "scenario")
            self.stop_if_wrong()
        return path

    def _variants(self) -> tuple[str, ...]:
        variant_names = [case.variant for case in self.scenario.variants]
        for i, name in enumerate(self.keys.variants):
            if name not in variant_names:
                self.add_problem(f"there is no variant `{name}`.{nearest(name, variant_names)}", "variants", i)
        return tuple(name for name in self.keys.variants if name in variant_names) or tuple(variant_names)

    def _catalog(self, catalogs: dict[str, Catalog]) -> Catalog:
        """The variables of all variants' members; where they differ, the first variant's."""
        merged: dict[str, Any] = {}
        for name in self.variants:
            for member, variables in catalogs.get(name, {}).items():
                merged[member] = {**variables, **merged.get(member, {})}
        return merged

    def _factor(self, name: str, keys: FactorKeys) -> Factor | None:
        sets = tuple(keys.sets or ([] if keys.scales else [name]))
        symbol = display = ""
        has_unit = True
        for key, paths in (("sets", sets), ("scales", tuple(keys.scales))):
            if not paths:
                continue
            try:
                if key == "scales":
                    for path in paths:
                        unit_of([path], self.catalog)
                else:
                    symbol, display = unit_of(paths, self.catalog)
            except CouplingError as error:
                has_unit = False
                self.add_problem(error, "vary", name)
        if sets and keys.scales:
            self.add_problem("both `sets` and `scales` are given. Make two factors of them.", "vary", name)
        if not keys.source:
            self.add_problem("`source` is missing: where its distribution comes from, or `assumed: why`.", "vary", name)
        member, _, variable = sets[0].partition(".") if sets else ("", "", "")
        own = self.catalog.get(member, {})
        for guess in () if has_unit else get_close_matches(variable, own, 1):  # its values are checked, too
            self._distribution(name, keys, own[guess].unit)
        distribution = self._distribution(name, keys, symbol) if has_unit else None
        where = str(self.root.find(("vary", name)).location)
        if distribution is None:
            return None
        shown_in = keys.stated_unit or display
        return Factor(name, sets, tuple(keys.scales), distribution, symbol, shown_in, keys.source, where, keys.at)

    def _distribution(self, name: str, keys: FactorKeys, symbol: str) -> Distribution | None:
        given = [kind for kind in DISTRIBUTIONS if getattr(keys, kind) is not None]
        if not given and any(f": vary.{name}." in problem for problem in self.problems):
            return None  # what is given is wrong, and reported
        if len(given) != 1:
            what = (
                f"{given[0]} and {given[1]} are given. Keep one" if given else f"has no distribution. Write `{EXAMPLE}`"
            )
            self.add_problem(f"{what}.", "vary", name)
            return None
        kind = given[0]
        raw = getattr(keys, kind)
        spread = kind == "log_normal"  # its second number is a ratio
        before = len(self.problems)
        numbers = [
            self._number(
                value, "" if (spread or kind == "grid") and i == len(raw) - 1 else symbol, "vary", name, kind, i
            )
            for i, value in enumerate(raw)
        ]
        low, high = (
            default if value is None else self._number(value, symbol, "vary", name, key)
            for key, value, default in (("from", keys.low, -np.inf), ("to", keys.high, np.inf))
        )
        if len(self.problems) > before:
            return None
        if kind == "grid":
            numbers, kind = list(np.linspace(numbers[0], numbers[1], max(1, round(numbers[2])))), "values"
        if wrong := wrong_numbers(kind, numbers, low, high, [*raw, keys.low, keys.high]):
            self.add_problem(wrong, "vary", name)
            return None
        return Distribution(kind, tuple(float(value) for value in numbers), low, high)

    def _number(self, raw: Any, symbol: str, *path: str | int) -> float:
        """A number in a unit; what is wrong with it is told."""
        if isinstance(raw, bool):
            return float(raw)
        try:
            if path[2:] == ("normal", 1) and isinstance(raw, str):  # a difference: 2 degC are 2 K
                return number(raw, symbol, "") - number(DIGITS.sub("0", raw), symbol, "")
            return number(raw, symbol, "")
        except CouplingError as error:
            self.add_problem(str(error).removeprefix(": "), *path)
            return 0.0

    def _estimates(self) -> list[Factor | None]:
        """What `twin identify` found: normal with its covariance, between the bounds; what had no effect stays as it is."""
        factors: list[Factor | None] = []
        self._correlations: list[tuple[list[str], Any]] = []
        for i, entry in enumerate(self.keys.estimates):
            try:
                estimate = read_estimate(self.path.parent / entry.file)
            except ScenarioError as error:
                self.add_problem(error, "estimates", i)
                continue
            names = []
            for k, unknown in enumerate(estimate.names):
                path = entry.names.get(unknown, unknown)
                if path.partition(".")[0] not in self.catalog or not estimate.covariance[k, k]:
                    continue  # a delay of a measurement, a member that is not here, or what had no effect there
                try:
                    unit, display = unit_of([path], self.catalog)
                except CouplingError as error:
                    self.add_problem(error, "estimates", i)
                    continue
                deviation = float(np.sqrt(estimate.covariance[k, k]))
                spread = Distribution("normal", (float(estimate.values[k]), deviation), *map(float, estimate.bounds[k]))
                names.append((k, path))
                factors.append(Factor(path, (path,), (), spread, unit, display, f"twin identify: {entry.file}", ""))
            indices = [k for k, _ in names]
            matrix = estimate.covariance[np.ix_(indices, indices)]
            deviations = np.sqrt(np.diag(matrix))
            correlation = matrix / np.outer(deviations, deviations)
            np.fill_diagonal(correlation, 1.0)  # exactly: else rounding makes independent factors correlated ones
            self._correlations.append(([path for _, path in names], correlation))
            if not names:
                self.add_problem(
                    f"nothing of {entry.file} is in this scenario. Say by `names` what is what.", "estimates", i
                )
        return factors

    def _correlation(self, factors: list[Factor]) -> Any:
        """Correlation of the factors' normal scores; None if all are independent."""
        names = [factor.name for factor in factors]
        matrix = np.eye(len(names))
        for own, block in self._correlations:
            indices = [names.index(path) for path in own]
            matrix[np.ix_(indices, indices)] = block
        for i, pair in enumerate(self.keys.correlated):
            named = [*names, *self.keys.vary]  # also factors with mistakes, which are reported
            if unknown := [name for name in pair.factors if name not in named]:
                self.add_problem(f"nothing called `{unknown[0]}` varies.{nearest(unknown[0], named)}", "correlated", i)
            if not set(pair.factors) <= set(names):
                continue
            a, b = (names.index(name) for name in pair.factors)
            matrix[a, b] = matrix[b, a] = pair.coefficient
        if np.array_equal(matrix, np.eye(len(names))):
            return None
        if names and np.linalg.eigvalsh(matrix).min() <= 1e-12:
            self.add_problem(
                "no factors can be correlated like this: three of them contradict each other. Lower one.", "correlated"
            )
        return matrix

    def _refuse_method(self, factors: list[Factor], correlation: Any) -> None:
        method = self.keys.samples.method
        if method in LISTED and (plain := [factor for factor in factors if not factor.distribution.levels]):
            self.add_problem(
                f"{method} needs `values` or `grid`, and {plain[0].name} has neither. Give them.", "samples", "method"
            )
        if method in INDEPENDENT and correlation is not None:
            self.add_problem(
                f"{method} needs independent factors. Leave the correlations out, or sample otherwise.", "samples"
            )
        if method in (*LISTED, *INDEPENDENT) and not factors and not self.keys.vary:
            self.add_problem(f"{method} has nothing to vary. Add `vary`.", "samples", "method")
        if method == "grid" and not self.problems:
            count = int(np.prod([len(factor.distribution.levels) for factor in factors]))
            if count > LARGEST:
                self.add_problem(f"the grid has {count:,} samples. Keep below {LARGEST:,}.", "samples")

    def _refuse_twice(self, factors: list[Factor]) -> None:
        first_uses: dict[tuple[str, Any], str] = {}
        for factor in factors:
            for path in factor.sets:
                if first := first_uses.get((path, factor.at_ns)):
                    self.add_problem(f"{path} is set by `{first}` too. Keep one of them.", "vary", factor.name)
                first_uses[path, factor.at_ns] = factor.name

    def _refuse_times(self, factors: list[Factor]) -> None:
        """Refuse factors that cannot take effect at their time in one of the variants."""
        for case in (case for case in self.scenario.variants if case.variant in self.variants):
            catalog = self.catalogs[case.variant]
            targets = {connection.target for connection in case.system(catalog).single()[0]}
            for factor, time_ns in ((factor, factor.at_ns) for factor in factors if factor.at_ns is not None):
                events = Assignment(case, catalog, [factor]).events(list(factor.distribution.values(np.array([0.5]))))
                problems = check_events(replace(case, events=(*case.events, *events)))
                wrong = (problem for event in events for problem in event_problems(event, catalog, targets))
                problems += [f"{problem} Or leave `at` out." for problem in wrong]
                changed = {event.variable for event in case.actions if event.time_ns <= time_ns}
                if before := changed.intersection(factor.scales):
                    problems.append(f"{min(before)} is changed by an event of the scenario before. Use `sets`.")
                for problem in dict.fromkeys(problems):
                    self.add_problem(problem.removeprefix(f"{factor.where}: "), "vary", factor.name, "at")

    def _expression(self, text: str, unit: str, *path: str | int) -> Any:
        try:
            parsed = expression.parse(text)
        except ScenarioError as error:
            self.add_problem(error, *path)
            return None
        units: dict[str, str | None] = {}
        for signal in parsed.signals:
            member, _, name = signal.name.partition(".")
            if member not in self.catalog:
                self.add_problem(f"there is no member `{member}`.{nearest(member, self.catalog)}", *path)
            elif name not in self.catalog[member]:
                self.add_problem(f"`{member}` has no variable `{name}`.{nearest(name, self.catalog[member])}", *path)
            else:
                units[signal.name] = self.catalog[member][name].unit
        if unit and len(units) == len(parsed.signals):
            try:
                measure = dimension.expression_measure(parsed, units)
            except ScenarioError as error:
                self.add_problem(error, *path)
                return None
            if not measure.is_compatible(dimension.unit_measure(unit)):
                self.add_problem(f"{text} is in {measure.unit or 'no unit'}, which does not convert to {unit}.", *path)
        return parsed

    def _refuse_metrics(self, factors: list[Factor]) -> None:
        """Metrics, expectations and variants that searches name and the scenario lacks."""
        keys, metrics = self.keys, list(self.scenario.metrics)
        for i, name in enumerate(keys.metrics):
            if name not in metrics:
                self.add_problem(f"there is no metric `{name}`.{nearest(name, metrics)}", "metrics", i)
        for key, search in (("worst", keys.worst), ("tune", keys.tune)):
            if not search:
                continue
            own = search.variant or self.variants[0]
            if search.metric not in metrics:
                unknown = f"there is no metric `{search.metric}`.{nearest(search.metric, metrics)}"
                self.add_problem(unknown, key, "metric")
            if own not in self.variants:
                self.add_problem(f"there is no variant `{own}`.{nearest(own, self.variants)}", key, "variant")
            elif search.metric in metrics and (missing := self._why_no_value(search.metric, own)):
                self.add_problem(missing, key, "metric")
        if keys.worst and any(factor.distribution.levels for factor in factors):
            self.add_problem("a factor with `values` cannot be searched. Give it a distribution.", "worst")

    def _why_no_value(self, name: str, variant: str) -> str:
        """Return why a metric has no value in a variant; "" if it can have one."""
        metric = self.scenario.metrics[name]
        if variant not in self.variants:
            return ""  # reported already
        if metric.variants and variant not in metric.variants:
            return f"`{name}` has no value with {variant}, only with {', '.join(metric.variants)}. Choose one of these."
        if is_cut(self.scenario, variant, metric):
            return f"the cases end before the window of `{name}`. Raise stop_time."
        return ""

    def _knobs(self) -> list[Knob]:
        factors = []
        for name, knob in (self.keys.tune.knobs if self.keys.tune else {}).items():
            path = ("tune", "knobs", name)
            sets = tuple(knob.sets or [name])
            try:
                unit, display = unit_of(sets, self.catalog)
            except CouplingError as error:
                self.add_problem(error, *path)
                continue
            if bounds := self.bounds(knob, unit, *path):
                span = Distribution("log_uniform" if knob.scale == "log" else "uniform", bounds)
                factor = Factor(name, sets, (), span, unit, knob.stated_unit or display, "tuned")
                factors.append(Knob(factor, *bounds, knob.scale == "log"))
        return factors

    def _limits(self) -> list[Limit]:
        limits = []
        tune, metrics = self.keys.tune, self.scenario.metrics
        expectations = {expectation.name: expectation for expectation in self.scenario.expectations}
        for i, limit in enumerate(tune.limits if tune else []):
            path = ("tune", "limits", i)
            own = (tune.variant if tune else "") or self.variants[0]
            if bool(limit.metric) == bool(limit.expectation):
                self.add_problem("name a `metric` or an `expectation`, one of them.", *path)
            elif limit.expectation and limit.expectation not in expectations:
                unknown = f"there is no expectation `{limit.expectation}`.{nearest(limit.expectation, expectations)}"
                self.add_problem(unknown, *path)
            elif limit.expectation and expectations[limit.expectation].nominal:
                text = "is judged only with the parameters of its own file (`nominal`). Name another."
                self.add_problem(f"`{limit.expectation}` {text}", *path)
            elif limit.metric and limit.metric not in metrics:
                self.add_problem(f"there is no metric `{limit.metric}`.{nearest(limit.metric, metrics)}", *path)
            elif limit.metric and (missing := self._why_no_value(limit.metric, own)):
                self.add_problem(missing, *path)
            elif limit.at_most is None and limit.at_least is None:
                self.add_problem("has no limit. Add at_most or at_least.", *path)
            else:
                symbol = metrics[limit.metric].unit if limit.metric else ""
                ends = [None if raw is None else limit_in_si(raw, symbol) for raw in (limit.at_most, limit.at_least)]
                what = limit.expectation or f"{limit.of} of {limit.metric}"
                side, value = ("at least", limit.at_least) if limit.at_most is None else ("at most", limit.at_most)
                text = f"{what} {side} {value}"
                limits.append(Limit(limit.metric, limit.expectation, limit.of, limit.quantile, ends[0], ends[1], text))
        return limits


class StudyKeysOrNone(StudyKeys):
    """Keys of a study without a scenario, so that all other problems are reported too."""

    scenario: Any = ""
