"""Scenarios broken on purpose: which expectation notices what, and which never notices anything.

    python -m benchmarks.mutations                       all scenarios of mutations.yaml, half an hour; tables into the docs
    python -m benchmarks.mutations injection_sequence    that one
    python -m benchmarks.mutations --generic 12 needle   and twelve mutations of its own connections and parameters
    python -m benchmarks.mutations --first racs          end a mutation with the first variant that notices it

A mutation is a patch of the scenario, as a variant is. Those of `mutations.yaml` are central: what they break is what the
scenario is about, and somebody must notice. Its `others` need not be noticed: a sound machine bears them. Generic ones break
one connection (the other sign, cut, 50 ms late) or one parameter (three times, a third, zero) wherever the file has one;
nobody need notice each of them. The first seed is run, or `all_seeds`; `seeds` says how many that the scenario does not list must hold too.
`stop_time`: an earlier end of all runs, where the scenario is long and what is noticed is noticed before.
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from benchmarks.mutation_lines import Patch, labeled, late, patch_of_line
from hw_bridge.bridge.entry import load as load_hardware
from twin.errors import ScenarioError, TwinError
from twin.results import Signals, evaluate
from twin.run import (
    RunOptions,
    apply_analyses,
    build_simulation,
    noop,
    recorded_signals,
    resolve_catalogs,
    run_case,
    run_scenario,
)
from twin.scenario import Backend, Case, ScenarioSpec, load_scenario, parse_scenario

if TYPE_CHECKING:
    from twin.coupling import Catalog
    from twin.scenario.spec import MemberSpec

BUILD = Path("build")
SCENARIOS = Path("scenarios")
TABLE = Path(__file__).parent / "mutations.yaml"
LINES = Path(__file__).parent / "mutation_sets.yaml"
PAGE = Path("docs/explanation/verdicts.md")
SCORES = Path("docs/data/mutations.csv")
HARDWARE = {"drive_faults": Path("hw_bridge/benches/simulated_force.yaml")}  # scenarios that need simulated drives
WORSE = ("skipped", "pass", "fail")
FIRST_SEED = 101  # of those that no scenario lists
SEEDS = 5  # as many of them
FACTORS = {"three times": 3.0, "a third": 1 / 3, "zero": 0.0}
NUMBER = re.compile(r"^(-?[\d.]+(?:e-?\d+)?)( .*)?$")


@dataclass(frozen=True)
class Verdicts:
    """What a run said: expectation -> pass, fail or skipped. `failure`: of a run that did not come to its end.

    `refusal`: what `twin check` says of a mutation; there is nothing to notice then.
    """

    outcomes: dict[str, str]
    failure: str = ""
    refusal: str = ""

    @property
    def noticed(self) -> list[str]:
        """The expectations that failed."""
        return [name for name, verdict in self.outcomes.items() if verdict == "fail"]

    def noticed_beside(self, sound: Sound) -> list[str]:
        """The expectations that failed and that the sound scenario passes."""
        return [name for name in self.noticed if name in sound.judged or name.endswith("is a number")]


def patched(name: str, patch: Patch) -> ScenarioSpec:
    """The scenario with a patch over it; what the patch says below `variants` holds for these alone."""
    text = json.dumps({"extends": f"{name}.yaml", "plots": [], **patch})
    return parse_scenario(text, SCENARIOS / f"{name} mutated.yaml")


Tables = dict[tuple[str, int], Signals]


@dataclass(frozen=True)
class Sound:
    """The scenario without a mutation: its cases, what they recorded, and the expectations that it passes."""

    cases: dict[tuple[str, int], Case]
    tables: Tables
    verdicts: Verdicts

    @property
    def judged(self) -> set[str]:
        """The expectations that hold."""
        return {name for name, verdict in self.verdicts.outcomes.items() if verdict == "pass"}


def tables_of(
    scenario: ScenarioSpec, variants: tuple[str, ...], seeds: tuple[int, ...], sound: Sound | None = None
) -> tuple[Tables, str]:
    """What each variant and seed records, with its analyses, and the first failure of a run."""
    *_, last = growing_tables(scenario, variants, seeds, sound)
    return last


def growing_tables(
    scenario: ScenarioSpec, variants: tuple[str, ...], seeds: tuple[int, ...], sound: Sound | None = None
) -> Iterator[tuple[Tables, str]]:
    """The tables after each variant, the shortest first, and the first failure of a run.

    A case that the mutation does not change is not run again: it has the tables of the sound scenario.
    """
    tables: Tables = {}
    failure = ""
    catalogs = resolve_catalogs(scenario)
    changed: dict[str, list[Case]] = {}
    for case in scenario.cases(variants, seeds):
        key = case.variant, case.seed
        if sound and key in sound.tables and sound.cases[key] == case:
            tables[key] = sound.tables[key]
        else:
            changed.setdefault(case.variant, []).append(case)
    for cases in sorted(changed.values(), key=lambda cases: cases[0].stop_ns - cases[0].start_ns):
        for case in cases:
            simulated = build_simulation(case, catalogs[case.variant], Backend.compiled, BUILD)
            try:
                run_case(case, simulated, noop)
                tables[case.variant, case.seed] = recorded = recorded_signals(simulated, complete=True)
                tables[case.variant, case.seed] = apply_analyses(scenario, case.variant, recorded)
            except (TwinError, ValueError, ArithmeticError) as error:  # an analysis may have nothing to work on
                failure = failure or f"{case.name}: {str(error).splitlines()[0]}"
            finally:
                simulated.terminate()
        yield tables, failure
    if not changed:
        yield tables, failure


def outcomes_of(scenario: ScenarioSpec, tables: Tables, is_complete: bool = True) -> dict[str, str]:
    """The verdict of each expectation and published figure. Of some of the variants: without means over all of them."""
    expectations = [one for one in scenario.expectations if is_complete or not one.mean]
    result = evaluate(scenario.metrics, expectations, tables)
    found = {one.name: one.verdict for one in result.expectation_results}
    for figure in result.metric_results:
        if figure.verdict in ("pass", "fail"):
            key = f"{figure.metric.name} as published"
            found[key] = "fail" if "fail" in (figure.verdict, found.get(key)) else "pass"
        elif figure.verdict == "none":
            found[f"{figure.metric.name} is a number"] = "fail"
    return found


def verdicts(
    name: str,
    patch: Patch,
    variants: tuple[str, ...] = (),
    seeds: tuple[int, ...] = (),
    sound: Sound | None = None,
    ends_early: bool = False,
) -> Verdicts:
    """Run the scenario with a patch and judge it, published figures as if the settings were the paper's.

    `ends_early`: after the first variant with which an expectation fails that the sound scenario passes.
    """
    try:
        scenario = patched(name, patch)
        resolve_catalogs(scenario)
    except ScenarioError as error:
        return Verdicts({}, refusal=str(error).splitlines()[0])
    seeds = seeds or scenario.seeds[:1]
    if name in HARDWARE:
        return verdicts_on_drives(scenario, variants, seeds, HARDWARE[name], sound if ends_early else None)
    tables: Tables = {}
    failure = ""
    for tables, failure in growing_tables(scenario, variants, seeds, sound):
        if ends_early and sound:
            result = Verdicts(outcomes_of(scenario, tables, is_complete=False), failure)
            if failure or result.noticed_beside(sound):
                return result
    return Verdicts(outcomes_of(scenario, tables), failure)


def verdicts_on_drives(
    scenario: ScenarioSpec, variants: tuple[str, ...], seeds: tuple[int, ...], bench: Path, sound: Sound | None
) -> Verdicts:
    """Run each variant on simulated drives; with `sound` until one is noticed. An expectation fails if it does in any variant."""
    found: dict[str, str] = {}
    failure = ""
    with tempfile.TemporaryDirectory() as folder:
        for case in scenario.cases(variants, seeds[:1]):
            try:
                outcome = run_scenario(
                    scenario,
                    RunOptions(
                        backend=Backend.compiled,
                        variants=[case.variant],
                        seeds=seeds,
                        root=Path(folder),
                        build=BUILD,
                        report=False,
                    ),
                    hardware=load_hardware(bench, build=BUILD),
                )
            except TwinError as error:
                failure = failure or f"{case.variant}: {str(error).splitlines()[0]}"
                continue
            if outcome.run.status != "completed":
                failure = failure or f"{case.variant}: {outcome.run.reason.splitlines()[0]}"
            for one in outcome.evaluation.expectation_results:
                found[one.name] = max(one.verdict, found.get(one.name, "skipped"), key=WORSE.index)
            if sound and (failure or Verdicts(found).noticed_beside(sound)):
                break
    return Verdicts(found, failure)


def run_sound(name: str, variants: tuple[str, ...], seeds: tuple[int, ...], shorter: Patch | None = None) -> Sound:
    """Run the scenario as it is, or to an earlier end."""
    if name in HARDWARE:
        return Sound({}, {}, verdicts(name, {}, variants, seeds))
    scenario = patched(name, shorter or {})
    cases = {(case.variant, case.seed): case for case in scenario.cases(variants, seeds or scenario.seeds[:1])}
    tables, failure = tables_of(scenario, variants, seeds or scenario.seeds[:1])
    return Sound(cases, tables, Verdicts(outcomes_of(scenario, tables), failure))


def generic(name: str) -> Iterator[tuple[str, Patch]]:
    """Mutations of what the file says: its connections between single real numbers, and its members' numbers."""
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    case = scenario.variants[0]
    catalog = resolve_catalogs(scenario)[case.variant]
    for one in case.connections:
        kinds = [endpoint(catalog, path) for path in (one.source, one.target)]
        if None in kinds or any(kind.shape or kind.type != "Float64" for kind in kinds if kind):
            continue
        way = f"{one.source} -> {one.target}"
        whole = {"from": one.source, "to": one.target, "offset": one.offset, "convert": one.convert}
        yield f"{way}: other sign", {"connections": [{**whole, "factor": -one.factor}]}
        yield f"{way}: cut", {"connections": [{"from": None, "to": one.target}]}
        yield f"{way}: 50 ms late", late(one.source, one.target)
    for member, spec in case.members.items():
        for parameter, raw in spec.parameters.items():
            found = NUMBER.match(str(raw)) if not isinstance(raw, (bool, list, dict)) else None
            for label, factor in FACTORS.items() if found and "seed" not in parameter else ():
                changed = f"{float(found[1]) * factor:g}{found[2] or ''}" if found else ""
                if found and is_other_value(spec, member, catalog, parameter, changed):
                    patch = {"members": {member: {"parameters": {parameter: number(changed)}}}}
                    yield f"{member}.{parameter}: {label}", patch


def is_other_value(spec: MemberSpec, member: str, catalog: Catalog, parameter: str, text: str) -> bool:
    """Whether a parameter may have a value, and has another one now."""
    variables = catalog[member]
    changed, problems = replace(spec, parameters={**spec.parameters, parameter: number(text)}).values(member, variables)
    now, _ = spec.values(member, variables)
    name = parameter.partition("[")[0]
    return not problems and bool((changed[name] != now[name]).any()) and not any(variables[name].outside(changed[name]))


def endpoint(catalog: Catalog, path: str) -> Any:
    """The variable at an end of a connection; None if it is a terminal or an element."""
    member, _, variable = path.partition(".")
    return catalog.get(member, {}).get(variable)


def number(text: str) -> float | str:
    """A number without a unit as such."""
    return text if " " in text else float(text)


def every(items: list[Any], most: int) -> list[Any]:
    """At most so many, by lot, always the same, in their order."""
    chosen = random.Random(0).sample(range(len(items)), min(most, len(items)))
    return [items[place] for place in sorted(chosen)]


def expanded(patch: Patch) -> Patch:
    """A patch of the table; `late: a.y -> b.u` is short for the member that delays."""
    if "late" not in patch:
        return patch
    source, target = patch["late"].split(" -> ")
    return late(source, target)


def mutations_of(name: str, table: dict[str, Any], lines: list[Any], most: int = 0) -> dict[str, Patch]:
    """All mutations of a scenario by their labels: those of both files, and `most` generic ones."""
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    catalogs = resolve_catalogs(scenario)
    chosen = {
        label: expanded(patch) for key in ("central", "others") for label, patch in (table.get(key) or {}).items()
    }
    chosen |= dict(every(list(generic(name)), most) if most else [])
    for label, written in labeled(lines):
        chosen[label] = patch_of_line(written, scenario, catalogs) if isinstance(written, str) else written
    return chosen


def examine(
    name: str, table: dict[str, Any], lines: list[Any], most: int, only: str = "", ends_early: bool = False
) -> str:
    """Run a scenario whole, with seeds of its own and broken; print, and give its row of the page."""
    variants = tuple(table.get("variants", ()))
    chosen = mutations_of(name, table, lines, most)
    own = load_scenario(SCENARIOS / f"{name}.yaml").seeds if table.get("all_seeds") else ()
    shorter = {"stop_time": table["stop_time"]} if "stop_time" in table else {}
    sound = run_sound(name, variants, own, shorter)
    unnoticed: list[str] = []
    caught: set[str] = set()
    for label, patch in chosen.items():
        if only not in label:
            continue
        result = verdicts(name, {**patch, **shorter}, variants, own, sound, ends_early)
        if result.refusal:
            raise ScenarioError(f"{name}, {label}: {result.refusal}")
        noticed = result.noticed_beside(sound)
        caught.update(noticed)
        who = "; ".join(noticed + ([f"the run ends: {result.failure}"] if result.failure else []))
        print(f"mutations_{name}_{label}: {who or 'not noticed'}", flush=True)
        unnoticed += [] if who else [label]
    seeds = tuple(range(FIRST_SEED, FIRST_SEED + table.get("seeds", SEEDS)))
    unlisted = verdicts(name, shorter, variants, seeds) if not only else Verdicts({})
    idle = [one for one in sound.verdicts.outcomes if one in sound.judged - caught]
    for text, listed in (
        ("noticed nothing", idle if not ends_early else []),
        ("not judged, as one seed alone does not pass", sound.verdicts.noticed),
        (f"fails at {len(seeds)} seeds that are not listed", unlisted.noticed),
    ):
        if listed:
            print(f"mutations_{name}: {text}: {'; '.join(listed)}", flush=True)
    print(f"mutations_{name}_score: {len(chosen) - len(unnoticed)} of {len(chosen)}", flush=True)
    nothing = "not counted" if ends_early else "; ".join(idle) or "-"
    return (
        f"| `{name}` | {len(chosen) - len(unnoticed)} of {len(chosen)} | {'; '.join(unnoticed) or '-'} "
        f"| {nothing} | {'; '.join(unlisted.noticed) or '-'} |"
    )


def write(name: str, row: str) -> None:
    """Replace a scenario's row of the complete table, and the sum of all rows on the page."""
    with SCORES.open(newline="") as file:
        head, *old = csv.reader(file)
    rows = {cells[0]: cells for cells in old}
    rows[f"`{name}`"] = [cell.strip() for cell in row.strip("|").split("|")]
    with SCORES.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *(rows[key] for key in sorted(rows))])
    noticed, tried = (sum(int(cells[1].split(" of ")[part]) for cells in rows.values()) for part in (0, 1))
    begin, end = "<!-- results mutations -->\n", "<!-- end -->"
    before, _, rest = PAGE.read_text().partition(begin)
    after = rest.partition(end)[2]
    PAGE.write_text(
        f"{before}{begin}In all scenarios {noticed} of {tried} mutations are noticed ({100 * noticed // tried} %).\n{end}{after}"
    )


def main() -> None:
    """Run the mutations of some scenarios or of all."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations")
    parser.add_argument("scenario", nargs="*")
    parser.add_argument("--generic", type=int, default=0, metavar="N")
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="mutations whose label has this; the page stays as it is"
    )
    parser.add_argument(
        "--first", action="store_true", help="end a mutation with the first variant that notices it: the score alone"
    )
    asked = parser.parse_args()
    table, lines = (yaml.safe_load(path.read_text()) for path in (TABLE, LINES))
    for name in asked.scenario or lines:
        own = table.get(name, {})
        row = examine(name, own, lines.get(name, []), asked.generic or own.get("generic", 0), asked.only, asked.first)
        if not (asked.only or asked.generic):
            write(name, row)


if __name__ == "__main__":
    main()
