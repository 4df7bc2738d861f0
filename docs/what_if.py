"""Write what scenarios give with other parameters into the pages: tables, and single figures in sentences.

python docs/what_if.py                    all of docs/what_if.yaml
python docs/what_if.py force ten          those whose name begins so

A table stands between `<!-- results NAME -->` and `<!-- end -->`, a figure of a sentence between `<!-- figure NAME -->` and
`<!-- end -->`; a table without a page is written to docs/data/NAME.csv. Each value is the least to the largest of the scenario's seeds, or of those that the entry names.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from tables import write_data, write_table

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.mutation_lines import patch_of_line
from twin.component import unit
from twin.run import RunOptions, resolve_catalogs, run_scenario
from twin.scenario import load_scenario, parse_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.results import MetricResult
    from twin.scenario import ScenarioSpec

ROOT = Path(__file__).parents[1]
ENTRIES = Path(__file__).with_suffix(".yaml")

Entry = dict[str, Any]


def entries() -> dict[str, Entry]:
    """Tables and figures by name; docs/what_if.yaml says how they are written."""
    found: dict[str, Entry] = yaml.safe_load(ENTRIES.read_text())
    return found


def merged(*patches: Mapping[str, Any]) -> dict[str, Any]:
    """Patches over each other."""
    whole: dict[str, Any] = {}
    for patch in patches:
        for key, value in patch.items():
            whole[key] = merged(whole.get(key) or {}, value) if isinstance(value, dict) else value
    return whole


def changed_scenario(name: str, change: Iterable[str], keys: Mapping[str, Any]) -> ScenarioSpec:
    """A scenario of scenarios/ with other parameters, and other keys, such as seeds; nothing is expected of it."""
    path = ROOT / "scenarios" / f"{name}.yaml"
    scenario = load_scenario(path)
    catalogs = resolve_catalogs(scenario)
    patches = [patch_of_line(line, scenario, catalogs) for line in change]
    text = {"extends": path.name, **merged(*patches, keys), "expect": [], "plots": []}
    return parse_scenario(json.dumps(text), path.with_name("what_if.yaml"))


@cache
def figures(name: str, change: tuple[str, ...], keys: str, variants: tuple[str, ...]) -> tuple[MetricResult, ...]:
    """Metrics of some variants. `keys`: other keys of the scenario, as JSON."""
    scenario = changed_scenario(name, change, json.loads(keys))
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_scenario(
            scenario, RunOptions(variants=variants, root=Path(folder), build=ROOT / "build", report=False)
        )
    if outcome.run.status != "completed":
        raise SystemExit(f"{name} with {', '.join(change)}: {outcome.run.reason}")
    return outcome.evaluation.metric_results


def values(entry: Entry, change: Sequence[str], variants: Iterable[str]) -> list[float]:
    """A metric of one variant for each seed [SI]; `variants` are run together with it."""
    keys = json.dumps({key: entry[key] for key in ("seeds", "metrics") if key in entry})
    for figure in figures(entry["scenario"], tuple(change), keys, tuple(variants)):
        if (figure.metric.name, figure.variant) == (entry["metric"], entry["variant"]):
            return [value for value in figure.values.values() if value is not None]
    raise SystemExit(f"{entry['scenario']}: no metric {entry['metric']} of {entry['variant']}.")


def span(found: Iterable[float], entry: Entry) -> str:
    """Least to largest in the entry's unit, or one number where both are written alike."""
    symbol = entry.get("unit", "")
    ordered = sorted(value / unit.describe(symbol).factor for value in found)
    ends = dict.fromkeys(format(end, entry["digits"]) for end in (ordered[0], ordered[-1]))
    return f"{' to '.join(ends)} {symbol}".rstrip()


def table(entry: Entry) -> str:
    """A table in Markdown: a row for each change or variant, a column for each variant or metric."""
    columns = entry["columns"]
    rows = [f"| {entry['head']} | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for label, row in entry["rows"].items():
        own = row if isinstance(row, dict) else {"change": row}
        cells = [{**entry, **column, **own} for column in columns.values()]
        together = tuple(dict.fromkeys(cell["variant"] for cell in cells))
        rows.append(f"| {label} | {' | '.join(shown(cell, together) for cell in cells)} |")
    return "\n".join(rows)


def shown(entry: Entry, together: Sequence[str]) -> str:
    """What one cell or figure says; the changes of several lists are taken together."""
    change = entry.get("change", [])
    several = change if change and isinstance(change[0], list) else [change]
    return span([value for one in several for value in values(entry, one, together)], entry)


def write(name: str, entry: Entry) -> None:
    """Write a table or a figure made now into its page, or a table without a page into its file."""
    if "columns" in entry:
        if "page" in entry:
            write_table(entry["page"], name, table(entry))
        else:
            write_data(name, table(entry))
        return
    marks, text = rf"(<!-- figure {name} -->).*?(<!-- end -->)", shown(entry, [entry["variant"]])
    path = ROOT / entry["page"]
    whole, count = re.subn(marks, lambda match: f"{match[1]}{text}{match[2]}", path.read_text(), flags=re.DOTALL)
    if not count:
        raise SystemExit(f"{entry['page']} has no comment for `{name}`.")
    path.write_text(whole)


def main(asked: Sequence[str]) -> None:
    """Those that were asked for, or all."""
    for name, entry in entries().items():
        if not asked or name.startswith(tuple(asked)):
            write(name, entry)
            print(name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
