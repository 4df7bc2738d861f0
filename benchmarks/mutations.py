"""Scenarios broken on purpose: which expectation notices what, and which never notices anything.

    python -m benchmarks.mutations                       all scenarios of mutations.yaml, half an hour; tables into the docs
    python -m benchmarks.mutations injection_sequence    that one
    python -m benchmarks.mutations --generic 12 needle   and twelve mutations of its own connections and parameters

A mutation is a patch of the scenario, as a variant is. Those of `mutations.yaml` are central: what they break is what the
scenario is about, and somebody must notice. Its `others` need not be noticed: a sound machine bears them. Generic ones break
one connection (the other sign, cut, 50 ms late) or one parameter (three times, a third, zero) wherever the file has one;
nobody need notice each of them. The first seed is run, or `all_seeds`; `seeds` says how many that the scenario does not list must hold too.
"""

from __future__ import annotations

import argparse
import json
import random
import re
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from twin.dataclass import dataclass
from twin.errors import ScenarioError, TwinError
from twin.results import Signals, evaluate
from twin.run import analyzed, prepare, run_case, signals, silent, simulation
from twin.scenario import Form, Scenario, load_scenario, parse_scenario

BUILD = Path("build")
SCENARIOS = Path("scenarios")
TABLE = Path(__file__).parent / "mutations.yaml"
PAGE = Path("docs/explanation/verdicts.md")
FIRST_SEED = 101  # of those that no scenario lists
LATE = "benchmarks.parts:Late"
FACTORS = {"three times": 3.0, "a third": 1 / 3, "zero": 0.0}
NUMBER = re.compile(r"^(-?[\d.]+(?:e-?\d+)?)( .*)?$")

Patch = dict[str, Any]


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


def patched(name: str, patch: Patch) -> Scenario:
    """The scenario with a patch over it; what the patch says below `variants` holds for these alone."""
    text = json.dumps({"extends": f"{name}.yaml", **patch})
    return parse_scenario(text, SCENARIOS / f"{name} mutated.yaml")


def verdicts(name: str, patch: Patch, variants: tuple[str, ...] = (), seeds: tuple[int, ...] = ()) -> Verdicts:
    """Run the scenario with a patch and judge it, published figures as if the settings were the paper's."""
    tables: dict[tuple[str, int], Signals] = {}
    failure = ""
    try:
        scenario = patched(name, patch)
        catalogs = prepare(scenario)
    except ScenarioError as error:
        return Verdicts({}, refusal=str(error).splitlines()[0])
    for case in scenario.cases(variants, seeds or scenario.seeds[:1]):
        simulated = simulation(case, catalogs[case.variant], Form.compiled, BUILD)
        try:
            run_case(case, simulated, silent)
            tables[case.variant, case.seed] = recorded = signals(simulated, complete=True)
            tables[case.variant, case.seed] = analyzed(scenario, case.variant, recorded)
        except (TwinError, ValueError, ArithmeticError) as error:  # an analysis may have nothing to work on
            failure = failure or f"{case.name}: {str(error).splitlines()[0]}"
        finally:
            simulated.terminate()
    result = evaluate(scenario.metrics, scenario.expectations, tables)
    found = {one.name: one.verdict for one in result.outcomes}
    for figure in result.figures:
        if figure.verdict in ("pass", "fail"):
            key = f"{figure.metric.name} as published"
            found[key] = "fail" if "fail" in (figure.verdict, found.get(key)) else "pass"
        elif figure.verdict == "none":
            found[f"{figure.metric.name} is a number"] = "fail"
    return Verdicts(found, failure)


def generic(name: str) -> Iterator[tuple[str, Patch]]:
    """Mutations of what the file says: its connections between single real numbers, and its members' numbers."""
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    case = scenario.variants[0]
    catalog = prepare(scenario)[case.variant]
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
                if found and float(found[1]) * factor != float(found[1]):
                    patch = {"members": {member: {"parameters": {parameter: number(changed)}}}}
                    yield f"{member}.{parameter}: {label}", patch


def endpoint(catalog: Any, path: str) -> Any:
    """The variable at an end of a connection; None if it is a terminal or an element."""
    member, _, variable = path.partition(".")
    return catalog.get(member, {}).get(variable)


def number(text: str) -> float | str:
    """A number without a unit as such."""
    return text if " " in text else float(text)


def late(source: str, target: str) -> Patch:
    """A connection whose values come 50 ms later."""
    return {
        "members": {"late": {"component": LATE}},
        "connections": [
            {"from": source, "to": "late.u", "convert": False},
            {"from": "late.y", "to": target, "convert": False},
        ],
    }


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


def examine(name: str, table: dict[str, Any], most: int, jobs: int) -> list[str]:
    """Run a scenario whole, with seeds of its own and broken; print, and give the rows of its table."""
    variants = tuple(table.get("variants", ()))
    central, others = (
        {label: expanded(patch) for label, patch in (table.get(key) or {}).items()} for key in ("central", "others")
    )
    chosen = [*central.items(), *others.items(), *every(list(generic(name)) if most else [], most)]
    own = load_scenario(SCENARIOS / f"{name}.yaml").seeds if table.get("all_seeds") else ()
    run = partial(verdicts, name, variants=variants, seeds=own)
    whole = run({})
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            results = list(pool.map(run, [patch for _, patch in chosen]))
    else:
        results = [run(patch) for _, patch in chosen]
    judged = [key for key, verdict in whole.outcomes.items() if verdict == "pass"]
    rows = ["| broken on purpose | noticed by |", "|---|---|"]
    caught: set[str] = set()
    for (label, _), result in zip(chosen, results, strict=True):
        if result.refusal and label in central:
            raise ScenarioError(f"{TABLE.name}: {name}, {label}: {result.refusal}")
        if result.refusal:
            continue
        noticed = [one for one in result.noticed if one in judged or one.endswith("is a number")]
        caught.update(noticed)
        who = "; ".join(noticed + ([f"the run ends: {result.failure}"] if result.failure else [])) or "nobody"
        print(f"mutations_{name}_{label}: {who}", flush=True)
        rows.append(f"| {label} | {'**nobody**' if who == 'nobody' and label in central else who} |")
    seeds = tuple(range(FIRST_SEED, FIRST_SEED + table.get("seeds", 0)))
    unlisted = verdicts(name, {}, variants, seeds) if seeds else Verdicts({})
    rows.append("")
    for text in summary(name, whole, judged, caught, seeds, unlisted):
        print(text, flush=True)
        rows.append(text.partition(": ")[2])
    return rows


def summary(
    name: str, whole: Verdicts, judged: list[str], caught: set[str], seeds: tuple[int, ...], unlisted: Verdicts
) -> Iterator[str]:
    """What holds for the table as a whole, as `name: value` lines."""
    silent_ones = [one for one in judged if one not in caught]
    yield (
        f"mutations_{name}_expectations: {len(judged)} expectations, {len(judged) - len(silent_ones)} of them noticed "
        "something."
    )
    if silent_ones:
        yield f"mutations_{name}_never: Never: {'; '.join(silent_ones)}."
    if whole.noticed:
        yield f"mutations_{name}_not_judged: Not judged, as one seed alone does not pass: {'; '.join(whole.noticed)}."
    if seeds:
        failed = "; ".join(unlisted.noticed) or "nothing"
        yield f"mutations_{name}_other_seeds: At {len(seeds)} seeds that it does not list, {failed} fails."


def write(name: str, rows: Iterable[str]) -> None:
    """Put a table into the page, in its place."""
    page = PAGE.read_text() if PAGE.exists() else "# Verdicts\n"
    begin, end = f"<!-- mutations {name} -->\n", "<!-- end -->"
    if begin not in page:
        page += f"\n## {name}\n\n{begin}{end}\n"
    head, _, rest = page.partition(begin)
    PAGE.write_text(f"{head}{begin}" + "\n".join(rows) + f"\n{end}{rest.partition(end)[2]}")


def main() -> None:
    """Run the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations")
    parser.add_argument("scenario", nargs="*")
    parser.add_argument("--generic", type=int, default=0, metavar="N")
    parser.add_argument("--jobs", type=int, default=1, metavar="N")
    asked = parser.parse_args()
    table = yaml.safe_load(TABLE.read_text())
    for name in asked.scenario or table:
        own = table.get(name, {})
        most = asked.generic or own.get("generic", 0)
        write(name, examine(name, own, most, asked.jobs))


if __name__ == "__main__":
    main()
