"""HTML representations of scenarios and runs for notebooks, in the colors of their surroundings."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from twin.results import common_format, count_verdicts, format_value, si_conversion
from twin.structure import picture

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from twin.scenario import ScenarioSpec

STYLE = """<style>
.twin { max-width: 900px; }
.twin h4 { margin: 0 0 4px; font-size: 1.1em; }
.twin p { margin: 2px 0 8px; opacity: .75; }
.twin table { border-collapse: collapse; margin: 8px 0; font-variant-numeric: tabular-nums; }
.twin th, .twin td { padding: 3px 12px 3px 0; text-align: left; vertical-align: top; border: 0; border-bottom: 1px solid #8884;
  background: none; }
.twin th.number, .twin td.number { text-align: right; white-space: nowrap; }
.twin b.pass { color: #2a9d6f; } .twin b.fail, .twin b.none { color: #e0525f; } .twin b.other, .twin b.cut { color: #d08a1d; }
.twin b.skipped, .twin b.info { opacity: .6; font-weight: 400; }
.twin summary { cursor: pointer; margin: 8px 0; }
</style>"""
CASES = 12  # that are listed
WORDS = {
    "pass": "✓ pass",
    "fail": "✗ fail",
    "none": "no value",
    "info": "-",
    "other": "not comparable (settings differ from the paper's)",
    "cut": "not comparable (the run ends before the metric's window)",
}


def page(*parts: str) -> str:
    """Return parts below each other."""
    return f'<div class="twin">{STYLE}{"".join(part for part in parts if part)}</div>'


def system(members: Mapping[str, str], connections: Iterable[tuple[str, str]]) -> str:
    """Return the diagram of a system: member -> component, and (source, target) as `member.variable`."""
    between: dict[tuple[str, str], list[str]] = {}
    for source, target in connections:
        between.setdefault((source.partition(".")[0], target.partition(".")[0]), []).append(f"{source} → {target}")
    return picture.draw({name: short(component) for name, component in members.items()}, between)


def short(component: str) -> str:
    """Return a component without the folders of its file: `rig.yaml#rig@fast`."""
    path, mark, part = component.partition("#")
    return f"{path.rpartition('/')[2]}{mark}{part}"


def scenario_system(scenario: ScenarioSpec) -> str:
    """Return the diagram of the first variant of a scenario."""
    case = scenario.variants[0]
    members = {name: spec.component for name, spec in case.members.items()}
    return system(members, [(connection.source, connection.target) for connection in case.connections])


def paragraph(text: str) -> str:
    """Return a paragraph; nothing without text."""
    return f"<p>{escape(text)}</p>" if text else ""


def folded(title: str, content: str) -> str:
    """Return content that opens at a click; nothing without content."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>" if content else ""


def heading(text: str) -> str:
    """Return a title."""
    return f"<h4>{escape(text)}</h4>"


def table(titles: Mapping[str, str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table; `titles`: with the class of their column."""
    body = [line("td", zip(row, titles.values(), strict=True)) for row in rows]
    return f"<table>{line('th', titles.items())}{''.join(body)}</table>" if body else ""


def line(tag: str, cells: Iterable[tuple[str, str]]) -> str:
    """Return a row of cells with their classes."""
    return f"<tr>{''.join(f'<{tag} class={kind}>{text}</{tag}>' for text, kind in cells)}</tr>"


def verdict(word: str) -> str:
    """Return a colored verdict."""
    return f'<b class="{word}">{WORDS.get(word, word)}</b>'


def value(number: float | bool | None, unit: str, display_unit: str = "") -> str:
    """Return a value that is in `unit`, in the unit to display: `36.2 mN`."""
    if isinstance(number, bool):
        return str(number).lower()
    return escape(format_value(None if number is None else si(number, unit), display_unit or unit))


def si(number: float, unit: str) -> float:
    """Convert a number in a unit to SI."""
    factor, offset = si_conversion(unit)
    return number * factor + offset


def verdicts(summary: Mapping[str, Any]) -> str:
    """Return the table of metrics beside reference figures."""
    metrics: Mapping[str, Any] = summary["metrics"]
    compared = any(
        figures["paper"] is not None for metric in metrics.values() for figures in metric["variants"].values()
    )
    rows = []
    for name, metric in metrics.items():
        description, unit = metric["description"], metric["unit"]
        values = [figures[key] for figures in metric["variants"].values() for key in ("paper", "mean")]
        style = common_format([si(number, unit) for number in values if number is not None], unit)
        for number, (variant, figures) in enumerate(metric["variants"].items()):
            title = f'<span title="{escape(description)}">{escape(name)}</span>' if number == 0 else ""
            keys = ("paper", "mean") if compared else ("mean",)
            cells = [escape(style.text(None if figures[key] is None else si(figures[key], unit))) for key in keys]
            rows.append([title, escape(variant), *cells, verdict(figures["verdict"])])
    paper = {"paper": "number"} if compared else {}
    return table({"metric": "text", "variant": "text", **paper, "mean over seeds": "number", "verdict": "text"}, rows)


def expectations(outcomes: Iterable[Mapping[str, Any]]) -> str:
    """Return the table of some expectations."""
    rows = [[verdict(outcome["verdict"]), escape(outcome["name"]), escape(outcome["detail"])] for outcome in outcomes]
    return table({"": "text", "requirement": "text", "result": "text"}, rows)


def state(summary: Mapping[str, Any], folder: Path) -> str:
    """Return the outcome and the folder of a run."""
    met, judged = count_verdicts(summary)
    kind, text = "pass", f"✓ {met} of {judged} requirements met"
    if summary["status"] != "completed":
        kind, text = "fail", f"{summary['status']}: {summary['reason']}"
    elif not summary["passed"]:
        kind, text = "fail", f"✗ {met} of {judged} requirements met"
    elif not judged:
        text = "✓ completed"
    cases = [f"{case['variant']} {case['seed']}" for case in summary["cases"]]
    more = " …" if len(cases) > CASES else ""
    notes = "".join(paragraph(f"Note: {sentence}") for sentence in summary.get("unjudged", ()))
    return f'<b class="{kind}">{escape(text)}</b>{notes}' + paragraph(f"{', '.join(cases[:CASES])}{more}; {folder}")
