"""identify.html: values with their intervals, how the model fits, and what the data tell of the unknowns together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results import Plot, PlotCurve, Signals, Window, expression, format_value, plotting
from twin.results import si_conversion as to_si
from twin.web import report_templates

if TYPE_CHECKING:
    from twin.identify.problem import Output, Unknown
    from twin.identify.result import Result

    Array = np.ndarray[Any, Any]


PART = 1 / 20  # of the time, about the largest residual, that is drawn larger


def html(result: Result) -> str:
    """The page as text; one file, nothing is loaded."""
    environment = report_templates("twin.identify")
    problem = result.problem
    names = [one.name for one in problem.unknowns]
    text: str = environment.get_template("identify.html").render(
        result=result,
        problem=problem,
        unknowns=rows(result),
        names=names,
        correlation=matrix(result),
        outputs=[measured(result, i) for i in range(len(problem.outputs))],
        profiles=[profile(result, i) for i in sorted(result.knowledge.profiles)],
        starts=starts(result),
        files=result.identified()["files"],
        versions=result.identified()["versions"],
    )
    return text


def rows(result: Result) -> list[dict[str, Any]]:
    """The unknowns as the table shows them."""
    table_rows = []
    for i, one in enumerate(result.problem.unknowns):
        deviation = float(np.sqrt(result.covariance[i, i]))
        table_rows.append(
            {
                "name": one.name,
                "value": one.shown(result.values[i]),
                "deviation": difference(deviation, one) if result.knowledge.effect[i] else "-",
                "interval": result.interval_text(i),
                "bounds": f"{one.shown(one.low)} to {one.shown(one.high)}",
                "verdicts": result.verdicts[i],
            }
        )
    return table_rows


def matrix(result: Result) -> list[list[dict[str, str]]]:
    """Correlations with a color: red where two unknowns can hardly be told apart."""
    table = []
    for i, row in enumerate(result.knowledge.correlation):
        cells = []
        for k, value in enumerate(row):
            is_identifiable = bool(result.knowledge.effect[i] and result.knowledge.effect[k])
            strong = float(abs(value)) ** 4 if i != k else 0.0  # what is below 0.7 hardly matters
            color = f"rgba(180, 35, 53, {0.55 * strong:.2f})" if i != k else "#f5f7fa"
            cells.append(
                {
                    "text": f"{value:.3f}" if is_identifiable else "-",
                    "color": color if is_identifiable else "transparent",
                }
            )
        table.append(cells)
    return table


def measured(result: Result, i: int) -> dict[str, str]:
    """Plots of an output: model and measurement, what is left, and how often."""
    one, predicted = result.problem.outputs[i], result.predicted[i]
    unit = one.display_unit or one.unit
    signals = Signals(
        one.time,
        {"o.model": predicted, "o.measured": one.values, "o.residual": one.values - predicted},
        dict.fromkeys(("o.model", "o.measured", "o.residual"), one.unit),
    )
    tables = {("", 0): signals}
    fit = Plot("", (curve("o.measured", "measured"), curve("o.model", "model")), unit=unit, label=one.signal)
    left = Plot("", (curve("o.residual - 0 * o.model", "measured minus model"),), unit=unit)
    worst = float(one.time[np.argmax(np.abs(one.values - predicted))])
    half = PART / 2 * float(one.time[-1] - one.time[0])
    near = Window(*(round(max(end, 0.0) * 1e9) for end in (worst - half, worst + half)))
    rms = float(np.sqrt(np.mean((one.values - predicted) ** 2)))
    return {
        "title": one.label,
        "signal": one.signal,
        "file": one.file,
        "rms": difference(rms, one),
        "noise": difference(result.found.sigmas[i], one),
        "count": f"{len(one.values):,}",
        "span": f"{one.time[0]:.4g} to {one.time[-1]:.4g} s",
        "fit": plotting.plot_svg(fit, tables, salt=f"fit {i}"),
        "near": plotting.plot_svg(replace(fit, window=near), tables, salt=f"near {i}"),
        "left": plotting.plot_svg(left, tables, salt=f"left {i}"),
    }


def curve(name: str, label: str) -> PlotCurve:
    """A curve of a plot."""
    return PlotCurve(expression.parse(name), label)


def difference(value: float, of: Output | Unknown) -> str:
    """A difference in the display unit; degrees Celsius have no offset in it."""
    return format_value(value * to_si(of.unit, is_difference=True)[0], of.display_unit or of.unit, is_difference=True)


def profile(result: Result, i: int) -> dict[str, str]:
    """A profile as a plot: how much worse the fit is where an unknown is held elsewhere."""
    one, own = result.problem.unknowns[i], result.knowledge.profiles[i]
    values = np.array([one.value(float(position)) for position in own.positions])
    tables = {("", 0): Signals(values, {"p.above": own.above, "p.value": values}, {"p.value": one.unit})}
    plot = Plot(
        "",
        (PlotCurve(expression.parse("p.above"), "cost above the best", expression.parse("p.value")),),
        label="cost above the best / limit",
        x_label=one.name,
        x_unit=one.display_unit or one.unit,
    )
    return {"name": one.name, "svg": plotting.plot_svg(plot, tables, salt=f"profile {i}")}


def starts(result: Result) -> list[dict[str, str]]:
    """Where the searches ended, the best first."""
    best = min((one.cost for one in result.found.starts), default=1.0) or 1.0
    return [
        {
            "cost": f"{one.cost / best:.4g}",
            "ends": ", ".join(
                u.shown(u.value(float(x))) for u, x in zip(result.problem.unknowns, one.end, strict=True)
            ),
        }
        for one in sorted(result.found.starts, key=lambda one: one.cost)
    ]
