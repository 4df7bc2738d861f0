"""Result tables of the pages in Markdown: of one scenario, and of the rig's experiments together."""

from __future__ import annotations

import csv
import re
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.run import RunResult

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"


def span(values: Iterable[float], digits: str) -> str:
    """Least to largest, or one number where both are written alike."""
    ordered = sorted(values)
    return " to ".join(dict.fromkeys((format(ordered[0], digits), format(ordered[-1], digits))))


def table(summary: Mapping[str, Any]) -> str:
    """Metrics with a published figure and a tolerance, as a table in Markdown: least to largest of the seeds."""
    count = len(
        {seed for one in summary["metrics"].values() for row in one["variants"].values() for seed in row["values"]}
    )
    seeds = f", {count} seeds" if count > 1 else ""
    rows = [f"| metric | variant | paper | twin{seeds} | twin / paper |", "|---|---|---|---|---|"]
    for metric in summary["metrics"].values():
        if metric["tolerance"] is None:
            continue
        unit, label = metric["unit"], metric["description"]
        for variant, one in metric["variants"].items():
            values, paper = one["values"].values(), one["paper"]
            known = f"{paper:#.3g} {unit}" if paper is not None else ""
            ratio = span((value / paper for value in values), ".2f") if paper else ""
            rows.append(f"| {label} | {variant} | {known} | {span(values, '#.3g')} {unit} | {ratio} |")
            label = ""
    return "\n".join(rows)


def pivot(summary: Mapping[str, Any], names: tuple[str, ...]) -> str:
    """Some metrics as columns, least to largest of the seeds; one row for each variant."""
    metrics = [summary["metrics"][name] for name in names]
    rows = [f"| variant | {' | '.join(one['description'] for one in metrics)} |", "|---" * (len(names) + 1) + "|"]
    for variant in metrics[0]["variants"]:
        values = [
            f"{span(one['variants'][variant]['values'].values(), '#.3g').removesuffix('.')} {one['unit']}".rstrip()
            for one in metrics
        ]
        rows.append(f"| {variant} | {' | '.join(values)} |")
    return "\n".join(rows)


def write_table(page: str | Path, name: str, text: str) -> None:
    """Replace the text between the comments `NAME` and `end` of a page; its path is relative to the repository's root.

    A name of one word stands for `results NAME`.
    """
    path = ROOT / page
    comment = name if " " in name else f"results {name}"
    marks = re.compile(rf"(<!-- {comment} -->\n).*?(<!-- end -->)", re.DOTALL)
    old = path.read_text()
    if not marks.search(old):
        raise ValueError(f"{path}: no comment `{comment}`. Put it where the table is to stand")
    path.write_text(marks.sub(lambda match: match[1] + text + "\n" + match[2], old))


def write_data(name: str, text: str) -> None:
    """Write a table in Markdown as docs/data/NAME.csv; the site shows it in an appendix of each page that links to it.

    An empty first cell gets the text above it, which pages leave out.
    """
    rows = cells(text)
    for above, row in pairwise(rows):
        row[0] = row[0] or above[0]
    with (DATA / f"{name}.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def cells(text: str) -> list[list[str]]:
    """Cells of a table in Markdown, its head first."""
    head, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in text.splitlines())
    return [head, *rows]


def select(text: str, rows: Sequence[str] | None = None, columns: Sequence[int] | None = None) -> str:
    """Rows of a table in Markdown, by the text of their first cell, and columns, by number; all where None."""
    head, *body = cells(text)
    if rows is not None:
        if missing := set(rows) - {row[0] for row in body}:
            raise ValueError(
                f"no rows {', '.join(sorted(missing))} in the table. Correct the names of the rows to select"
            )
        body = [row for row in body if row[0] in rows]
    kept = range(len(head)) if columns is None else columns
    return markdown([[row[column] for column in kept] for row in (head, *body)])


def published(text: str) -> str:
    """Rows of a result table in Markdown that have a figure of the paper."""
    head, *body = cells(text)
    paper = head.index("paper")
    return markdown([head, *(row for row in body if row[paper])])


def means_over_speeds(summary: Mapping[str, Any], metric: str, instrument: str) -> list[float]:
    """Mean over the five speeds, for each seed."""
    variants = summary["metrics"][metric]["variants"]
    rows = [list(one["values"].values()) for name, one in variants.items() if name.startswith(instrument)]
    return [float(value) for value in np.mean(rows, axis=0)]


SPEED = 21e-3  # mean of the five speeds of regripping [m/s]
FILTER = 187.5  # how late a mean over 16 samples at 40 Hz is [ms]
SAMPLE_AGE = (25.0, 50.0)  # of a tracker's sample, an estimate [ms]
REGRIPPING = {"catheter": 10.9, "guidewire": 15.8}  # the paper's largest tracking errors, means over the speeds [mm]


def regripping(summary: Mapping[str, Any]) -> str:
    """Means over the speeds of the errors of signals that are filtered alike, and what a late measurement would add."""
    alike = {one: means_over_speeds(summary, "aligned_error_max", one) for one in REGRIPPING}
    printed = [f"{one} mm" for one in REGRIPPING.values()]
    added, *ages = (SPEED * one for one in (FILTER, *SAMPLE_AGE))
    differences = [wire - catheter for catheter, wire in zip(*alike.values(), strict=True)]
    late = [
        ["", *REGRIPPING],
        ["twin, both filtered alike", *(f"{span(one, '.1f')} mm" for one in alike.values())],
        ["the paper's filter over 16 samples on the tip alone, 187.5 ms", *[f"+ {added:.1f} mm"] * 2],
        [
            "age of a tracker's sample, one or two of its periods of 25 ms (estimate; the twin's has none)",
            *[f"+ {span(ages, '.1f')} mm"] * 2,
        ],
        ["sum", *(f"{span([one + added + age for one in each for age in ages], '.1f')} mm" for each in alike.values())],
        ["paper", *printed],
        [
            "guidewire minus catheter, where every lag cancels",
            f"paper {REGRIPPING['guidewire'] - REGRIPPING['catheter']:.1f} mm",
            f"twin {span(differences, '.1f')} mm",
        ],
    ]
    return markdown(late)


def rig(outcomes: Mapping[str, RunResult]) -> str:
    """What comes out of the rig's experiments, in short."""
    metrics = {name: outcomes[name].summary["metrics"] for name in ("linear_grip", "rotational_grip", "rotation")}

    def cell(name: str, metric: str, variants: Sequence[str], kind: str) -> str:
        found = [metrics[name][metric]["variants"][variant] for variant in variants]
        texts = [span(one["values"].values(), "#.3g") if kind == "twin" else f"{one['paper']:.3g}" for one in found]
        return f"{', '.join(texts)} {metrics[name][metric]['unit']}"

    grips = {
        f"slip load of a {one} in gripper 1, gripper 2": (
            "linear_grip",
            "slip_load",
            [f"{one}, gripper {k}" for k in (1, 2)],
        )
        for one in REGRIPPING
    }
    grips["slip torque, catheter and guidewire"] = (
        "rotational_grip",
        "slip_torque",
        [f"{one}, gripper 1" for one in REGRIPPING],
    )
    rows = [["experiment", "paper", "twin"]]
    rows += [[label, cell(*one, "paper"), cell(*one, "twin")] for label, one in grips.items()]
    summary = outcomes["dynamic_regripping"].summary
    plain, alike = (
        ", ".join(span(means_over_speeds(summary, metric, one), ".1f") for one in REGRIPPING)
        for metric in ("error_max", "aligned_error_max")
    )
    rows += [
        [
            "largest tracking error over 500 mm with regripping, mean over speeds, catheter and guidewire",
            f"{', '.join(map(str, REGRIPPING.values()))} mm",
            f"{plain} mm; {alike} mm if both positions are filtered alike",
        ]
    ]
    turned = metrics["rotation"]["error"]["variants"].values()
    found = [value for one in turned for value in one["values"].values()]
    rows += [["rotation error, at 14.4 to 72 deg/s", "25 deg", f"{span(found, '.1f')} deg"]]
    return markdown(rows)


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """A table; the first row is its head."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|---" * len(rows[0]) + "|", *lines[1:]])
