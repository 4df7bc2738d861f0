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
    names = [unknown.name for unknown in problem.unknowns]
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
    for i, unknown in enumerate(result.problem.unknowns):
        deviation = float(np.sqrt(result.covariance[i, i]))
        table_rows.append(
            {
                "name": unknown.name,
                "value": unknown.shown(result.values[i]),
                "deviation": difference(deviation, unknown) if result.knowledge.effect[i] else "-",
                "interval": result.interval_text(i),
                "bounds": f"{unknown.shown(unknown.low)} to {unknown.shown(unknown.high)}",
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
    output, predicted = result.problem.outputs[i], result.predicted[i]
    unit = output.display_unit or output.unit
    signals = Signals(
        output.time,
        {"o.model": predicted, "o.measured": output.values, "o.residual": output.values - predicted},
        dict.fromkeys(("o.model", "o.measured", "o.residual"), output.unit),
    )
    tables = {("", 0): signals}
    fit = Plot("", (curve("o.measured", "measured"), curve("o.model", "model")), unit=unit, label=output.signal)
    left = Plot("", (curve("o.residual - 0 * o.model", "measured minus model"),), unit=unit)
    worst = float(output.time[np.argmax(np.abs(output.values - predicted))])
    half = PART / 2 * float(output.time[-1] - output.time[0])
    near = Window(*(round(max(end, 0.0) * 1e9) for end in (worst - half, worst + half)))
    rms = float(np.sqrt(np.mean((output.values - predicted) ** 2)))
    return {
        "title": output.label,
        "signal": output.signal,
        "file": output.file,
        "rms": difference(rms, output),
        "noise": difference(result.fit.sigmas[i], output),
        "count": f"{len(output.values):,}",
        "span": f"{output.time[0]:.4g} to {output.time[-1]:.4g} s",
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
    unknown, own = result.problem.unknowns[i], result.knowledge.profiles[i]
    values = np.array([unknown.value(float(position)) for position in own.positions])
    tables = {("", 0): Signals(values, {"p.above": own.above, "p.value": values}, {"p.value": unknown.unit})}
    plot = Plot(
        "",
        (PlotCurve(expression.parse("p.above"), "cost above the best", expression.parse("p.value")),),
        label="cost above the best / limit",
        x_label=unknown.name,
        x_unit=unknown.display_unit or unknown.unit,
    )
    return {"name": unknown.name, "svg": plotting.plot_svg(plot, tables, salt=f"profile {i}")}


def starts(result: Result) -> list[dict[str, str]]:
    """Where the searches ended, the best first."""
    best = min((start.cost for start in result.fit.starts), default=1.0) or 1.0
    return [
        {
            "cost": f"{start.cost / best:.4g}",
            "ends": ", ".join(
                u.shown(u.value(float(x))) for u, x in zip(result.problem.unknowns, start.end, strict=True)
            ),
        }
        for start in sorted(result.fit.starts, key=lambda item: item.cost)
    ]
