"""How well a calibration fits: in words, as rows of tables, as a YAML file, and as a picture of measured over fitted."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from twin.results.figure_files import WIDTH, render_svg

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from twin.results.calibration import Calibration

# RMSE over the range of the motion: steps by which fits are described
SMALL, LARGE = 0.02, 0.05
AT_NOISE = 1.5  # RMSE over the deviation of repeated readings, up to which a better form would not help
TERMS = (
    "Error: RMSE over the range. Noise: deviation of repeated readings. R2: part of the variance that the fit explains, "
    "small for a nearly constant quantity."
)
UNDETERMINED = 0.5  # standard error over the value, above which a parameter is reported


def verdict(fit: Any) -> str:
    """Return in words how large a fit's RMSE is: over the range of the motion, and over the noise."""
    if all(map(math.isnan, fit.errors)):
        return "read off"
    if fit.residual <= SMALL * fit.span:
        return f"within {SMALL:.0%}"
    if fit.residual <= AT_NOISE * fit.noise:
        return "as the noise"
    return f"within {LARGE:.0%}" if fit.residual <= LARGE * fit.span else f"over {LARGE:.0%}"


def fit_cells(fit: Any) -> tuple[str, str, str, str, str, str]:
    """Return verdict, RMSE [mm], range [mm], noise [mm], rows used and R2; `-` for what the readings do not tell."""
    numbers = (fit.residual, fit.span, fit.noise, fit.r_squared)
    residual, span, noise, r_squared = ("-" if math.isnan(number) else f"{number:.3g}" for number in numbers)
    return verdict(fit), residual, span, noise, f"{len(fit.used)} of {fit.rows}", r_squared


def parameter_rows(calibration: Calibration) -> list[tuple[str, str, str]]:
    """Return name, value and standard error of each parameter; an element of a list has its own row."""
    rows = []
    for name, value in calibration.parameters.items():
        error = calibration.errors[name]
        elements = zip(value, error, strict=True) if isinstance(value, list) else [(value, error)]
        for i, (number, deviation) in enumerate(elements):
            label = f"{name}[{i + 1}]" if isinstance(value, list) else name
            rows.append((label, f"{number:.5g}", "-" if not deviation > 0 else f"{deviation:.2g}"))
    return rows


def warnings(calibration: Calibration) -> list[str]:
    """Return a sentence for each doubtful unit, sign and fit, and each undetermined parameter."""
    texts = list(calibration.hints)
    for name, fit in calibration.fits.items():
        is_noisy, is_large = (verdict(fit) == text for text in ("as the noise", f"over {LARGE:.0%}"))
        if is_noisy or is_large:
            cause = "The readings are noisy" if is_noisy else "Check columns, units and order of its rows"
            texts.append(f"{name}: RMSE {fit.residual:.3g} mm, {fit.residual / fit.span:.0%} of the range. {cause}.")
        if fit.r_squared < 0.0:
            texts.append(f"{name}: R2 {fit.r_squared:.2g}: a constant fits better. Check columns and signs.")
    texts += [
        f"{name}: {value:.3g} with standard error {calibration.errors[name]:.2g} is not determined. Take more readings."
        for name, value in calibration.parameters.items()
        if not isinstance(value, list) and calibration.errors[name] > UNDETERMINED * abs(value)
    ]
    return [f"warning: {text}" for text in texts]


def to_yaml(shown: str, files: Mapping[str, Path], calibration: Calibration) -> str:
    """Format as YAML: `parameters` as in a scenario's member; quality of fits and standard errors as comments."""
    lines = [f"# {shown}, calibrated from {', '.join(f'{name}={path.name}' for name, path in files.items())}"]
    for name, fit in calibration.fits.items():
        quality, residual, span, noise, rows, r_squared = fit_cells(fit)
        noise = "not measured" if noise == "-" else f"{noise} mm"
        lines.append(
            f"# {name}: {quality}; RMSE {residual} mm, range {span} mm, noise {noise}, {rows} rows used, R2 {r_squared}"
        )
    lines += [f"# {text}" for text in warnings(calibration)]
    errors = [f"{name} {error}" for name, _, error in parameter_rows(calibration) if error != "-"]
    lines += textwrap.wrap(f"# standard errors: {', '.join(errors)}", 110, subsequent_indent="#   ")
    body = yaml.safe_dump({"parameters": calibration.parameters}, sort_keys=False, default_flow_style=None, width=110)
    return "\n".join(lines) + "\n" + body


def to_svg(calibration: Calibration) -> str:
    """Draw measured over fitted values, and the residuals in the order of the rows; a row of panels for each fit."""
    fits = {name: fit for name, fit in calibration.fits.items() if verdict(fit) != "read off"}

    def draw(axes: Any) -> None:
        for (left, right), (name, fit) in zip(axes, fits.items(), strict=True):
            ends = [min(fit.predicted.min(), fit.measured.min()), max(fit.predicted.max(), fit.measured.max())]
            left.plot(ends, ends, color="#9aa5b1", label="measured = fitted")
            left.plot(fit.predicted, fit.measured, "o", markersize=4, label="readings")
            left.set(title=f"{name}: {verdict(fit)}", xlabel="fitted [mm]", ylabel="measured [mm]")
            left.legend()
            right.axhline(0.0, color="#9aa5b1")
            right.plot(np.asarray(fit.used) + 1, fit.measured - fit.predicted, "o", markersize=4)
            title = f"measured minus fitted, RMSE {fit.residual:.3g} mm"
            right.set(title=title, xlabel="row of the table", ylabel="[mm]")

    return render_svg((WIDTH, 3.0 * len(fits)), "calibration", draw, nrows=len(fits), ncols=2)
