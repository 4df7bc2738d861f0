"""HTML representations of scenarios and runs for notebooks, in the colors of their surroundings."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from twin.face import arrays
from twin.results import (
    common_format,
    count_not_judged,
    count_verdicts,
    display_units,
    figure_files,
    format_value,
    requirements_text,
    si_conversion,
)
from twin.structure import picture, short_name

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.scenario import ScenarioSpec

STYLE = """<style>
.twin { max-width: 900px; container-type: inline-size; }
.twin .wide { overflow-x: auto; }
.twin .plot svg { display: block; max-width: 100%; height: auto; fill: currentColor; }
.twin a:any-link { color: inherit; text-decoration: underline; }
.twin h4 { margin: 0 0 4px; font-size: 1.1em; }
.twin p { margin: 2px 0 8px; opacity: .75; }
.twin table { border-collapse: collapse; margin: 8px 0; font-variant-numeric: tabular-nums; }
.twin th, .twin td { padding: 3px 10px 3px 0; text-align: left; vertical-align: top; border: 0; border-bottom: 1px solid #8884;
  background: none; }
.twin .number, .twin .ratio { text-align: right; white-space: nowrap; }
@container (max-width: 560px) {
  .twin table { font-size: .85em; } .twin th, .twin td { padding-right: 6px; } .twin th.ratio, .twin td.ratio { display: none; }
  .twin td.detail { overflow-wrap: anywhere; }
}
.twin b.pass { color: #2a9d6f; } .twin b.fail, .twin b.none { color: #e0525f; } .twin b.other, .twin b.cut { color: #d08a1d; }
.twin b.skipped, .twin b.info { opacity: .6; font-weight: 400; }
.twin summary { cursor: pointer; margin: 8px 0; }
</style>"""
PLOT_COLORS = {  # of a plot on white -> of one on any background
    "#ffffff": "none",
    **dict.fromkeys(("#1f2933", "#3e4c59", "#7b8794", "#9aa5b1"), "currentColor"),
    "#e4e7eb": "#8884",
    "#0072b2": "#2f86c9",
    "#8a5a00": "#c08419",
    "#c81e1e": "#e0525f",
}
CASES = 12  # variants, seeds and rows that are listed
FAILED = ("fail", "none")  # verdicts
WORDS = {"pass": "✓ pass", "fail": "✗ fail", "info": "-", "skipped": "not judged", **arrays.VERDICTS}
NOTES = {
    "other": "Other settings than the paper's: not comparable.",
    "cut": "Run too short: it ends before the window of the metric.",
}


def page(*parts: str) -> str:
    """Return parts below each other."""
    return f'<div class="twin">{STYLE}{"".join(part for part in parts if part)}</div>'


def system(members: Mapping[str, str], connections: Iterable[tuple[str, str]]) -> str:
    """Return the diagram of a system: member -> component, and (source, target) as `member.variable`."""
    between: dict[tuple[str, str], list[str]] = {}
    for source, target in connections:
        between.setdefault((source.partition(".")[0], target.partition(".")[0]), []).append(f"{source} → {target}")
    return picture.draw({name: short_name(component) for name, component in members.items()}, between)


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
    return f"<div class=wide><table>{line('th', titles.items())}{''.join(body)}</table></div>" if body else ""


def plot(svg: str) -> str:
    """Return a plot in the colors of its surroundings, as wide as the notebook allows; nothing without one."""

    def recolor(tag: re.Match[str]) -> str:
        return re.sub(r"#[0-9a-f]{6}\b", lambda color: PLOT_COLORS.get(color[0], color[0]), tag[0])

    return f"<div class=plot>{figure_files.TAG.sub(recolor, svg)}</div>" if svg else ""


def figure(matplotlib_figure: Any) -> str:
    """Return a figure of matplotlib for a notebook: in the colors of its surroundings, so also on a dark page."""
    return page(plot(matplotlib_figure._repr_svg_()))


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


def metric_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the texts of each metric and variant, in one unit a metric: failures first, then metrics of the paper.

    `rank`: 0 of a metric that fails, 1 of one with figures of the paper, else 2.
    """
    rows = []
    units = display_units({name: metric["unit"] for name, metric in summary["metrics"].items()})
    for name, metric in summary["metrics"].items():
        unit, variants = metric["unit"], metric["variants"]
        numbers = [figures[key] for figures in variants.values() for key in ("paper", "mean")]
        style = common_format([si(number, unit) for number in numbers if number is not None], units[name])
        fails = any(figures["verdict"] in FAILED for figures in variants.values())
        is_compared = any(figures["paper"] is not None for figures in variants.values())
        common = {"metric": name, "description": metric["description"], "unit": style.label}
        common["rank"] = "0" if fails else "1" if is_compared else "2"
        for variant, figures in variants.items():
            texts = {
                key: style.number(None if figures[key] is None else si(figures[key], unit)) for key in ("mean", "paper")
            }
            ratio = figures.get("ratio")
            texts |= {"ratio": "-" if ratio is None else f"{ratio:.2f}", "verdict": figures["verdict"]}
            rows.append({**common, "variant": variant, **texts})
    return sorted(
        rows, key=lambda row: (row["rank"], list(summary["metrics"]).index(row["metric"]), not is_failed(row))
    )


def is_failed(row: Mapping[str, str]) -> bool:
    """Return whether a metric of a variant fails."""
    return row["verdict"] in FAILED


def verdicts(summary: Mapping[str, Any]) -> str:
    """Return the table of metrics with figures of the paper; metrics without any are folded if there are others."""
    rows = metric_rows(summary)
    first = [row for row in rows if row["rank"] < "2"] or rows[:CASES]
    count = len({row["metric"] for row in rows[len(first) :]})
    notes = " ".join(note for word, note in NOTES.items() if any(row["verdict"] == word for row in rows))
    more = folded(f"{count} more metric{'s' * (count > 1)}", metric_table(rows[len(first) :]))
    return metric_table(first) + paragraph(notes) + more


def metric_table(rows: Iterable[Mapping[str, str]]) -> str:
    """Return a table of metrics, each named once."""
    rows = list(rows)
    keys = ("mean", "paper", "ratio") if any(row["paper"] != "-" for row in rows) else ("mean",)
    cells, last = [], ""
    for row in rows:
        unit = f" [{row['unit']}]" * bool(row["unit"])
        title = f'<span title="{escape(row["description"])}">{escape(row["metric"] + unit)}</span>'
        texts = [title * (row["metric"] != last), escape(row["variant"]), *(escape(row[key]) for key in keys)]
        cells.append([*texts, verdict(row["verdict"])])
        last = row["metric"]
    kinds = {"mean": "number", "paper": "number", "ratio": "ratio"}  # without room, both values suffice
    titles = {"metric": "text", "variant": "text", **{key: kinds[key] for key in keys}, "verdict": "text"}
    return table(titles, cells)


def requirements(outcomes: Iterable[Mapping[str, Any]]) -> str:
    """Return the table of some requirements."""
    rows = [[verdict(outcome["verdict"]), escape(outcome["name"]), escape(outcome["detail"])] for outcome in outcomes]
    return table({"": "text", "requirement": "text", "result": "detail"}, rows)


def outcome(summary: Mapping[str, Any]) -> tuple[str, str]:
    """Return the kind of the outcome of a run and its text: pass, fail, or other if fewer are judged than not, or one not judged is outside."""
    met, judged = count_verdicts(summary)
    skipped, outside = count_not_judged(summary)
    text = requirements_text(met, judged, skipped, outside) or "completed"
    if summary["status"] != "completed":
        return "fail", f"{summary['status']}: {summary['reason']}"
    if not summary["passed"]:
        return "fail", f"✗ {text}"
    return ("pass", f"✓ {text}") if skipped <= judged and not outside else ("other", text)


def unjudged(summary: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the requirements that were not judged."""
    return [each for each in summary["expectations"] if each["verdict"] == "skipped"]


def cases(summary: Mapping[str, Any]) -> str:
    """Return the variants and seeds of a run: `variants PI · PI+FF, replayed; seeds 1 · 2 · 3`, as names may have commas."""
    parts = []
    for kind in ("variant", "seed"):
        names = list(dict.fromkeys(str(case[kind]) for case in summary["cases"]))
        more = f" and {len(names) - CASES} more" if len(names) > CASES else ""
        parts.append(f"{kind}{'s' * (len(names) != 1)} {' · '.join(names[:CASES])}{more}")
    return "; ".join(parts)


def state(summary: Mapping[str, Any]) -> str:
    """Return the outcome and the cases of a run."""
    kind, text = outcome(summary)
    notes = [f"Note: {sentence}" for sentence in summary.get("unjudged", ())]
    if kind == "other":
        ranked = sorted(unjudged(summary), key=lambda each: not each.get("is_outside", False))
        notes.append(" ".join([f"{each['name']}: {each['detail']}" for each in ranked][:1]))
    return f'<b class="{kind}">{escape(text)}</b>{"".join(map(paragraph, notes))}' + paragraph(cases(summary))


def links(folder: Path, command: str = "twin view") -> str:
    """Return links to the report and the viewer's page of a run; without the page, the command that opens the viewer."""
    pages = {"Report": folder / "report.html", "Viewer": folder / "signals.html"}
    parts = [f'<a href="{escape(link(path))}">{name}</a>' for name, path in pages.items() if path.exists()]
    if command and not pages["Viewer"].exists():
        parts.append(f"Curves: type <code>{command} {escape(shown(folder))}</code> in a terminal")
    return f"<p>{' · '.join(parts)}</p>"


def link(path: Path) -> str:
    """Return the address of a file for a notebook: relative to the working folder, or a file URI outside of it."""
    where = shown(path)
    return path.resolve().as_uri() if Path(where).is_absolute() else quote(Path(where).as_posix())


def shown(path: Path) -> str:
    """Return a path relative to the working folder, if it is in it."""
    absolute, here = path.resolve(), Path.cwd()
    return str(absolute.relative_to(here) if absolute.is_relative_to(here) else path)


def failures(summary: Mapping[str, Any]) -> list[str]:
    """Return a line for each requirement that is not met."""
    lines = [
        f"FAIL {result['name']}: {result['detail']}"
        for result in summary["expectations"]
        if result["verdict"] == "fail"
    ]
    for row in filter(is_failed, metric_rows(summary)):
        paper = f" (paper {row['paper']}, ratio {row['ratio']})" if row["paper"] != "-" else ""
        lines.append(f"FAIL {row['metric']}, {row['variant']}: {row['mean']} {row['unit']}".rstrip() + paper)
    return lines


def run_text(summary: Mapping[str, Any], folder: Path) -> str:
    """Return a run in some lines: outcome, sentence, failures, cases, folder."""
    title = f"{summary['scenario']['title']}: {outcome(summary)[1]}"
    return "\n".join(
        filter(None, [title, summary.get("sentence", ""), *failures(summary), cases(summary), shown(folder)])
    )
