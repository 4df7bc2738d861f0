"""The report of a validation: figures beside those of the baselines, and plots of measured and predicted values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results import figure_files, plotting
from twin.validation.frozen import read_frozen
from twin.web import report_templates

if TYPE_CHECKING:
    from twin.validation.model import Quantity
    from twin.validation.runner import Prediction, ValidationFile

    Array = np.ndarray[Any, Any]

ZOOM = 1 / 20  # part of the time about the largest error that is drawn larger
MEASURED, PREDICTED, REZEROED = plotting.COLORS[7], plotting.COLORS[0], plotting.COLORS[4]


def html(own: ValidationFile, predictions: list[Prediction]) -> str:
    """The page as text; one file, nothing is loaded."""
    environment = report_templates("twin.validation")
    frozen = read_frozen(own.path)
    rows = [row for prediction in predictions for row in prediction.rows]
    used = list(dict.fromkeys(row["set"] for row in rows))
    text: str = environment.get_template("validate.html").render(
        own=own,
        rows=rows,
        baselines=list(dict.fromkeys(name for row in rows for name in row["baselines"])),
        frozen={name: frozen[name] for name in used},
        figures=[figure_of(prediction, number) for prediction in predictions for number in range(len(prediction.rows))],
        is_seen={name for current in frozen.values() for name in current.files},
    )
    return text


def figure_of(prediction: Prediction, number: int) -> dict[str, Any]:
    """Plots of one file and quantity: the whole run, and about its largest error."""
    row, quantity = prediction.rows[number], prediction.set.quantities[number]
    error = quantity.error(prediction.predicted, prediction.data.measured)
    time = prediction.data.time
    worst = int(np.argmax(np.abs(error)))
    half = ZOOM / 2 * float(time[-1] - time[0])
    near = np.abs(time - time[worst]) <= half
    return {
        "row": row,
        "whole": svg(prediction, quantity, row, np.ones(len(time), bool)),
        "near": svg(prediction, quantity, row, near) if near.sum() > 2 else "",
        "worst": f"{time[worst]:.4g} s",
    }


def svg(prediction: Prediction, quantity: Quantity, row: dict[str, Any], rows: Array) -> str:
    """Draw measured and predicted values of each output with the band, and the error below."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    data, half = prediction.data, row["band"]
    time, count = data.time[rows], len(quantity.indices)
    error = quantity.error(prediction.predicted, data.measured)[rows]
    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": f"{row['file']} {row['quantity']} {len(time)}"}):
        figure: Any = Figure((plotting.WIDTH, 1.5 + 1.6 * count), layout="constrained")
        axes = figure.subplots(count + 1, 1, sharex=True)
        curves = [quantity.shown(values[rows]) for values in (data.measured, prediction.predicted, prediction.rezeroed)]
        for k, i in enumerate(quantity.indices):
            axis, (*values, rezeroed) = axes[k], [curve[:, k] for curve in curves]
            if half is not None and not quantity.is_distance:
                fill(axis, time, values[1] - half, values[1] + half, color=PREDICTED, alpha=0.15, linewidth=0)
            draw(axis, time, values[0], MEASURED, "measured")
            draw(axis, time, values[1], PREDICTED, "predicted")
            if row["disagreements"]:
                draw(axis, time, rezeroed, REZEROED, "predicted, offset corrected with the first third")
            axis.set_ylabel(plotting.axis_label(prediction.set.outputs[i], row["unit"]))
        axes[0].legend(loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0, ncols=3)
        draw(axes[-1], time, error, plotting.COLORS[1], "error")
        if half is not None:
            axes[-1].axhspan(0 if quantity.is_distance else -half, half, color=PREDICTED, alpha=0.15, linewidth=0)
        for failure in row["disagreements"]:
            for axis in axes:
                if time[0] <= failure["time"] <= time[-1]:
                    axis.axvline(failure["time"], color=plotting.COLORS[1], linestyle="--")
        axes[-1].set_ylabel(plotting.axis_label("error", row["unit"]))
        axes[-1].set_xlabel("time [s]")
        return figure_files.figure_to_svg(figure)


def draw(axis: Any, time: Array, values: Array, color: str, label: str) -> None:
    """Draw a curve, reduced to what is visible."""
    axis.plot(*plotting.envelope(time, values), color=color, label=label)


def fill(axis: Any, time: Array, low: Array, high: Array, **options: Any) -> None:
    """Fill between two curves, reduced to what is visible."""
    stride = max(1, len(time) // plotting.MAX_POINTS)
    axis.fill_between(time[::stride], low[::stride], high[::stride], **options)
