"""The HTML page of the viewer, with a server or with embedded samples."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from string import ascii_uppercase
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from twin.errors import TwinError
from twin.viewer.curve_data import over_time
from twin.viewer.live_run import RUNNING
from twin.viewer.page_data import about
from twin.viewer.requests import head
from twin.viewer.runs import ViewedCurve
from twin.viewer.scene_data import Scenes
from twin.viewer.selection import failed_signals, suggest_signals
from twin.viewer.verdicts import normalize
from twin.web import STATIC, PackedArrays, chart_script

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.viewer.runs import RunCollection
    from twin.viewer.study_cases import StudyCases

HERE = Path(__file__).parent
OWN = ("spectrum.js", "sources.js", "state.js", "view.js", "scene.js", "tables.js", "completion.js", "panels.js")
REPORT = "report.html"
STYLE_SPACE = re.compile(r"/\*.*?\*/|\s*([{};,])\s*|(?<=[a-z]:) ", re.DOTALL)  # comments and blanks of a style sheet
MAX_SAMPLES = 50_000  # of an embedded curve; longer ones are reduced to their extremes
MAX_INSTANTS = 600  # of an embedded picture
MAX_LETTERS = 60_000_000  # characters of a page
MAX_TOTAL = 3_000_000  # samples of a page that has all seeds, or more signals than the plots
MAX_CHANGED = 3  # overridden values in the heading


def html(
    content: dict[str, Any],
    arrays: Sequence[str] = (),
    note: str = "",
    reports: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Return the page; `arrays`: its embedded samples, `reports`: links to reports, by their text."""
    import jinja2
    import markupsafe

    script = chart_script((HERE / file for file in (*["server_source.js"] * (not arrays), *OWN)), views=True)
    style = "".join(file.read_text("utf-8") for file in (STATIC / "style.css", STATIC / "views.css", HERE / "view.css"))
    # escape `<`: data must not close the script or begin a comment in it
    data = json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined).from_string(
        re.sub("^ +", "", (HERE / "page.html").read_text(encoding="utf-8"), flags=re.MULTILINE)
    )
    safe = markupsafe.Markup
    return template.render(
        title=content["title"],
        note=note,
        icon=quote((STATIC / "favicon.svg").read_text(encoding="utf-8")),
        style=safe(STYLE_SPACE.sub(r"\1", style).replace(";}", "}")),
        about=safe(data),
        followed=content["following"] is not None,
        arrays=arrays,
        reports=reports,
        script=safe(script),
    )


def served_page(
    runs: RunCollection, signals: Sequence[str] = (), cases: Sequence[int] = (), study: StudyCases | None = None
) -> str:
    """Return the page that requests samples from a server; initially with these signals and cases. `study`: linked cases."""
    content = about(runs) | {"study": study.plain() if study else None}
    content |= {"title": title(content), "embedded": None, "shown": list(cases), "shown_signals": list(signals)}
    case = f"case {study.current} of {study.name}; " if study else ""
    return html(content, note=case + description(content), reports=report_links(runs, study))


def report_links(runs: RunCollection, study: StudyCases | None) -> dict[str, str]:
    """Return the addresses of the reports that exist, by the text of their links."""
    case = f"&case={study.current}" if study else ""
    return {
        f"Report {ascii_uppercase[number]}" if len(runs.runs) > 1 else "Report": f"report?run={number}{case}"
        for number, run in enumerate(runs.runs)
        if (run.folder / REPORT).exists()
    }


@dataclass(frozen=True)
class EmbeddedPage:
    """A self-contained page with samples. `thinned`: number of curves reduced to their extremes.

    `added`: how many of the signals are there because their requirements failed, although others were chosen.
    """

    text: str
    signals: int
    added: int
    curves: int
    samples: int
    thinned: int


def embedded_page(
    runs: RunCollection, signals: Sequence[str], cases: Sequence[int], more: Sequence[int] = ()
) -> EmbeddedPage:
    """Return a self-contained page with signals or expressions of some cases; by default it opens as the page of a server.

    `more`: the same cases with all seeds, embedded instead if that does not make the page too large.
    """
    shown_signals = list(signals)
    chosen = set(map(normalize, signals))
    added = [name for name in dict.fromkeys(failed_signals(runs)) if signals and name not in chosen]
    content = about(runs) | {"study": None}
    size = sum(min(runs.cases[number].samples, MAX_SAMPLES) for number in more or cases)
    signals = [*signals, *added] or with_metrics(suggest_signals(runs), content["metrics"], MAX_TOTAL // max(size, 1))
    cases = more if more and len(signals) * size <= MAX_TOTAL else cases
    arrays = PackedArrays()
    embedded, thinned, samples = [], 0, 0
    recorded = {signal["name"]: signal["cases"] for signal in content["signals"]}
    for signal in signals:
        for number in cases:
            if signal in recorded and recorded[signal] != "all" and number not in recorded[signal]:
                continue
            if not runs.cases[number].samples:  # not started yet
                continue
            curve = ViewedCurve(signal, number)
            line = over_time(runs, curve, (-np.inf, np.inf), MAX_SAMPLES)
            thinned += line.count > len(line.x)
            samples += len(line.x)
            x, y = arrays.index(line.x), arrays.index(line.y)
            embedded.append({"signal": signal, "case": number, "x": x, "y": y, "head": head(line, curve)})
    if not embedded:
        raise TwinError(f"{signals[0]}: none of these cases has recorded it. Choose others with --variant and --seed.")
    content["signals"] = [signal for signal in content["signals"] if signal["name"] in signals]
    content |= {"title": title(content), "embedded": embedded, "shown": list(cases), "shown_signals": shown_signals}
    failed = (number for each in content["expectations"] for number in map(int, each["spans"]) if number in cases)
    content["film"] = film(runs, next(failed, cases[0]), arrays)
    text = html(content, arrays.texts, description(content))
    if len(text) > MAX_LETTERS:
        raise TwinError(
            f"{len(embedded)} curves make a page of {len(text) / 1e6:.0f} MB; browsers support {MAX_LETTERS / 1e6:.0f}. "
            "Choose fewer with --signal, --variant and --seed."
        )
    return EmbeddedPage(text, len(signals), len(added), len(embedded), samples, thinned)


def with_metrics(signals: Sequence[str], metrics: Sequence[Mapping[str, Any]], most: int) -> list[str]:
    """Return signals, and up to so many with those of the metrics, first those that have a published value."""
    ranked = sorted(metrics, key=lambda metric: all(row["reference"] is None for row in metric["rows"]))
    names = dict.fromkeys(
        [*signals, *(name for metric in ranked for name in (*metric["sources"], metric["signal"]) if name)]
    )
    return list(names)[: max(most, len(signals))]


def film(runs: RunCollection, number: int, arrays: PackedArrays) -> dict[str, Any] | None:
    """Return the picture of a case and the indices of the arrays that move it; None if nothing of it is drawn."""
    scenes = Scenes(runs)
    if not (views := scenes.views(number)):
        return None
    samples = scenes.samples(number, (-np.inf, np.inf), MAX_INSTANTS)
    signals = [
        {"name": name, "shape": values.shape[1:], "y": arrays.index(values)} for name, values in samples.values.items()
    ]
    return {"case": number, "views": views, "x": arrays.index(samples.time), "signals": signals}


def title(content: dict[str, Any]) -> str:
    """Return the titles of the runs."""
    return ", ".join(dict.fromkeys(run["title"] for run in content["runs"]))


def description(content: dict[str, Any]) -> str:
    """Return name, start time and changed values of a run; of several, a line of the page has them."""
    run, *others = content["runs"]
    changed = run["overrides"] if len(run["overrides"]) <= MAX_CHANGED else [f"{len(run['overrides'])} changed values"]
    parts = [f"{1 + len(others)} runs"] if others else [run["name"], run["started"][:16].replace("T", " "), *changed]
    return ", ".join([*parts, *["in progress"] * any(each["status"] == RUNNING for each in content["runs"])])
