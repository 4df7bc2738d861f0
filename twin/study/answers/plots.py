"""Pictures of a study: points over a factor, parallel coordinates, histograms, quantile bands over time, what drives a metric, a tuning's way."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.results import dimension, figure_files, format_value, plotting, si_conversion
from twin.study.answers.statistics import resolved_part
from twin.study.design import SAMPLED
from twin.study.execution.case_engine import DONE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from twin.study.answers.sensitivity import Change, MetricSensitivity
    from twin.study.design import Study
    from twin.study.execution.case_table import CaseTable
    from twin.study.execution.tuning import Tuned

    Array = np.ndarray[Any, Any]

WIDTH, WIDE = 4.4, 9.2  # of a plot that is legible on a phone, and of one with many axes [inch]
FEW = 20  # cases: with fewer, a distribution shows each as a point
LINES = 400  # of parallel coordinates: more are one area
BAD, GOOD = "#b42335", "#0b62a4"
LIMIT_LINE: dict[str, Any] = {"color": BAD, "linewidth": 1.2, "linestyle": (0, (6, 3))}
LIMIT_NAME: dict[str, Any] = {"loc": "right", "color": BAD, "fontsize": 10}  # above the plot: it covers no point
BANDS = (0.0, 0.05, 0.25, 0.75, 0.95, 1.0)


def tint(color: str, part: float) -> str:
    """Mix a color with white: opaque, so that it stays legible where dark mode inverts the plot."""
    channels = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(255 + part * (channel - 255)):02x}" for channel in channels)


def parallel(cases: CaseTable, metric: str, variant: str, unit: str) -> str:
    """Each case a line through its factors to a metric; those that fail, and the worst, in red."""
    study = cases.study
    case_indices = cases.where(SAMPLED, variant)
    every = max(1, -(-len(case_indices) // LINES))
    is_bad = failing(cases)
    failed = [i for i in case_indices if is_bad[i]]
    shown = sorted(set(case_indices[::every]) | set(failed[:LINES]))
    own = cases.values
    columns = [factor.in_shown_unit(own[shown, k]) for k, factor in enumerate(study.factors)]
    scale, offset = si_conversion(unit, study.metrics[metric].is_difference)
    columns.append((cases.metric(metric)[shown] - offset) / scale)
    labels = [(factor.name, factor.shown_unit) for factor in study.factors] + [(metric, unit)]
    bad = set(failed)

    def paint(grid: Any) -> None:
        axis = grid[0, 0]
        spans = [(np.nanmin(c), np.nanmax(c)) if np.isfinite(c).any() else (0.0, 1.0) for c in columns]
        scaled = np.array([(c - low) / ((high - low) or 1.0) for c, (low, high) in zip(columns, spans, strict=True)])
        for of_bad in (False, True):
            lines = [k for k, i in enumerate(shown) if (i in bad) is of_bad]
            if lines:
                tone = BAD if of_bad else tint(GOOD, min(0.8, max(0.25, 40 / len(lines))))
                artists = axis.plot(scaled[:, lines], linewidth=0.9, color=tone)
                for line, k in zip(artists, lines, strict=True):
                    line.set_url(f"#case-{cases.requests[shown[k]].number}")
        for k, (low, high) in enumerate(spans):
            axis.axvline(k, color="#52606d", linewidth=0.8)
            for y, value in ((-0.03, low), (1.03, high)):
                axis.text(k, y, f"{value:.3g}", ha="center", va="top" if y < 0 else "bottom")
        axis.set_xticks(
            range(len(labels)),
            [plotting.axis_label(name, axis_unit) for name, axis_unit in labels],
            rotation=25,
            ha="right",
        )
        axis.set_yticks([])
        axis.set_ylim(-0.12, 1.12)
        axis.grid(visible=False)

    return figure_files.render_svg((WIDE, 4.2), f"parallel {metric} {variant}", paint)


def scatter(cases: CaseTable, metric: str, variant: str, factor: int, unit: str) -> str:
    """Each case a point, linked to it: a metric over a factor, by its number; those that fail in red."""
    study, own, varied = cases.study, cases.where(SAMPLED, variant), cases.study.factors[factor]
    is_bad = failing(cases)
    scale, offset = si_conversion(unit, study.metrics[metric].is_difference)
    values = (cases.metric(metric) - offset) / scale
    cases_by_verdict = {
        kind: [i for i in own if is_bad[i] is kind and np.isfinite(values[i])] for kind in (False, True)
    }

    def paint(grid: Any) -> None:
        axis = grid[0, 0]
        for kind, every in cases_by_verdict.items():
            case_indices = every[:: max(1, -(-len(every) // LINES))]
            inputs = varied.in_shown_unit(cases.values[case_indices, factor])
            points = axis.scatter(
                inputs, values[case_indices], s=26, color=BAD if kind else GOOD, edgecolors="#fff", linewidths=0.5
            )
            points.set_urls([f"#case-{cases.requests[i].number}" for i in case_indices])
        for limit in limits_of(study, variant, metric):
            axis.axhline((limit - offset) / scale, **LIMIT_LINE)
        axis.set_title(limit_text(study, variant, metric, unit), **LIMIT_NAME)
        axis.set_xlabel(plotting.axis_label(varied.name, varied.shown_unit))
        axis.set_ylabel(plotting.axis_label(metric, unit))

    return figure_files.render_svg((WIDTH, 3.0), f"scatter {metric} {variant}", paint)


def failing(cases: CaseTable) -> list[bool]:
    """Whether something of each case is not as expected."""
    return [row.status != DONE or False in holds for row, holds in zip(cases.rows, cases.holds, strict=True)]


def limits_of(study: Study, variant: str, metric: str) -> list[float]:
    """What is expected of a metric of a variant, SI."""
    own = [
        expectation
        for expectation in study.scenario.expectations
        if expectation.metric == metric and not expectation.ordered
    ]
    own = [expectation for expectation in own if variant in (expectation.variants or (variant,))]
    return [limit for expectation in own for limit in (expectation.at_least, expectation.at_most) if limit is not None]


def limit_text(study: Study, variant: str, metric: str, unit: str) -> str:
    """Return `limit 6 mN`, the limits of a metric of a variant; "" without any."""
    is_difference = study.metrics[metric].is_difference
    limits = [format_value(limit, unit, is_difference=is_difference) for limit in limits_of(study, variant, metric)]
    return f"limit {', '.join(limits)}" if limits else ""


def histogram(cases: CaseTable, metric: str, variant: str, unit: str) -> str:
    """Draw the histogram of a metric, of few cases each as a point; red: cases that fail in anything.

    The axis is that of all variants; so are the bins where their ranges overlap.
    """
    study = cases.study
    factor, offset = si_conversion(unit, study.metrics[metric].is_difference)
    values, is_bad = (cases.metric(metric) - offset) / factor, np.array(failing(cases))
    case_indices = {variant: np.array(cases.where(SAMPLED, variant), int) for variant in study.variants}
    own = {variant: at for variant, every in case_indices.items() if len(at := every[np.isfinite(values[every])])}
    if variant not in own:
        return ""
    all_edges = {name: bin_edges(values[at]) for name, at in own.items()}
    if max(values[at].min() for at in own.values()) <= min(values[at].max() for at in own.values()):
        all_edges = dict.fromkeys(own, bin_edges(values[np.concatenate(list(own.values()))]))
    ends = [edge for edges in all_edges.values() for edge in edges]
    ends += [(limit - offset) / factor for name in own for limit in limits_of(study, name, metric)]

    def paint(grid: Any) -> None:
        axis, finite_values, bad = grid[0, 0], values[own[variant]], is_bad[own[variant]]
        edges = all_edges[variant]
        if len(finite_values) < FEW:
            order = np.argsort(finite_values)  # points side by side are at three heights
            colors = [BAD if is_bad_case else GOOD for is_bad_case in bad[order]]
            points = axis.scatter(finite_values[order], np.arange(len(order)) % 3, s=30, c=colors, edgecolors="#fff")
            points.set_urls([f"#case-{cases.requests[i].number}" for i in own[variant][order]])
            axis.set_ylim(-1.0, 3.0)
            axis.set_yticks([])
        else:
            kinds = [np.minimum(part, edges[-1]) for part in (finite_values[~bad], finite_values[bad])]
            axis.hist(kinds, bins=edges, color=[GOOD, BAD], stacked=True)
            axis.yaxis.get_major_locator().set_params(integer=True)
            axis.set_ylabel("cases")
        for limit in limits_of(study, variant, metric):
            axis.axvline((limit - offset) / factor, **LIMIT_LINE)
        axis.set_title(limit_text(study, variant, metric, unit), **LIMIT_NAME)
        for part in study.keys.quantiles:
            axis.axvline(
                np.quantile(finite_values, resolved_part(part, len(finite_values))),
                color="#1f2933",
                linewidth=0.8,
                linestyle=":",
            )
        low, high = min(ends), max(ends)
        axis.set_xlim(low - 0.04 * (high - low), high + 0.04 * (high - low))
        axis.set_xlabel(plotting.axis_label(metric, unit))

    return figure_files.render_svg(
        (WIDTH, 1.8 if len(own[variant]) < FEW else 3.0), f"histogram {metric} {variant}", paint
    )


def bin_edges(values: Array) -> Array:
    """Edges of 10 to 60 bins, more for more values, from the smallest to the 99.5 % quantile: a far value squeezes no others."""
    low, high = float(values.min()), float(np.quantile(values, 0.995))
    bins = min(max(round(2 * np.sqrt(len(values))), 10), 60)
    return np.linspace(low, high if high > low else low + abs(low) + 1e-12, bins + 1)


def bands(folder: Path, cases: CaseTable, name: str, variant: str, index: int) -> str:
    """Median, quarters, 5 to 95 % and ends of a signal over all cases of a variant, over time; one axis for all variants."""
    from pyarrow import parquet

    study = cases.study
    table = parquet.read_table(folder / "bands.parquet", columns=["case", name])
    samples = dict(zip(table["case"].to_pylist(), table[name], strict=True))
    unit = study.band_units.get(name, "")
    factor, offset = si_conversion(unit, dimension.is_difference(study.bands[name]))
    begin, every = study.scenario.start_ns * 1e-9, study.keys.keep.every * 1e-9
    own = {}
    for other in study.variants:
        rows = [
            samples[cases.requests[i].number]
            for i in cases.where(SAMPLED, other)
            if cases.requests[i].number in samples
        ]
        sampled_rows = [
            np.asarray(row.values.to_numpy(zero_copy_only=False)) for row in rows if row.is_valid and len(row)
        ]
        if sampled_rows:
            shortest = min(map(len, sampled_rows))
            own[other] = (np.stack([row[:shortest] for row in sampled_rows]) - offset) / factor
    if variant not in own:
        return ""

    def paint(grid: Any) -> None:
        axis, curves = grid[0, 0], own[variant]
        ends = [np.quantile(curves, part, axis=0) for part in BANDS]
        time = begin + every * np.arange(curves.shape[1])
        for k, part in ((0, 0.2), (1, 0.4), (2, 0.65)):
            axis.fill_between(time, ends[k], ends[5 - k], color=tint(GOOD, part), linewidth=0)
        axis.plot(time, np.median(curves, axis=0), color="#1f2933", linewidth=0.8)
        heights = [float(min(map(np.nanmin, own.values()))), float(max(map(np.nanmax, own.values())))]
        for limit, sign, inside in expected(study, variant, name, time):
            height, outer = (limit - offset) / factor, ends[5 if sign > 0 else 0]
            axis.plot(time[inside], np.full(inside.sum(), height), **LIMIT_LINE)
            beyond = inside & (sign * (outer - height) > 0.0)
            axis.fill_between(time, height, outer, where=beyond, color=tint(BAD, 0.6), linewidth=0)
            heights.append(height)
        margin = 0.05 * (max(heights) - min(heights))
        if margin > 0.0:
            axis.set_ylim(min(heights) - margin, max(heights) + margin)
        axis.set_ylabel(plotting.axis_label(name, unit))
        axis.set_xlabel("time [s]")

    return figure_files.render_svg((WIDTH, 2.6), f"bands {name} {variant} {index}", paint)


def expected(study: Study, variant: str, name: str, time: Array) -> list[tuple[float, float, Array]]:
    """Limits on a signal over time, SI: value, 1 for an upper and -1 for a lower one, and when it is asked for."""
    signal, limit_lines = ast.dump(study.bands[name].tree), []
    for expectation in study.scenario.expectations:
        if (
            expectation.signal is None
            or ast.dump(expectation.signal.tree) != signal
            or variant not in (expectation.variants or (variant,))
        ):
            continue
        start, stop = expectation.window.start_ns, expectation.window.stop_ns
        inside = time >= (clock.seconds(start) if start is not None else -np.inf)
        inside &= time <= (clock.seconds(stop) if stop is not None else np.inf)
        limits = ((expectation.at_most, 1.0), (expectation.at_least, -1.0))
        limit_lines += [(limit, sign, inside) for limit, sign in limits if limit is not None]
    return limit_lines


def effects(metric_sensitivity: MetricSensitivity, unit: str) -> str:
    """Bars of what drives a metric, with their intervals; `unit`: the metric's."""
    names = [effect.label.replace(", ", ",\n") for effect in metric_sensitivity.effects]
    kinds = {
        "sobol": [("alone (first order)", "first"), ("with interactions (total)", "total")],
        "morris": [("", "first")],
        "rank": [("", "first")],
    }[metric_sensitivity.kind]
    quantity = {
        "sobol": f"share of the variance of {metric_sensitivity.metric}",
        "morris": plotting.axis_label(f"mean absolute effect on {metric_sensitivity.metric}", unit),
        "rank": f"rank correlation with {metric_sensitivity.metric}",
    }[metric_sensitivity.kind]
    factor = si_conversion(unit)[0] if metric_sensitivity.kind == "morris" else 1.0

    def paint(grid: Any) -> None:
        axis = grid[0, 0]
        height = 0.8 / len(kinds)
        for k, (label, value) in enumerate(kinds):
            sizes = np.array([getattr(effect, value) for effect in metric_sensitivity.effects]) / factor
            ends = np.array([getattr(effect, f"{value}_interval") for effect in metric_sensitivity.effects]).T / factor
            errors = np.nan_to_num(np.abs(ends - sizes)).tolist()  # an array of one column warns in matplotlib 3.10
            bar_positions = np.arange(len(names)) + (k - (len(kinds) - 1) / 2) * height
            axis.barh(
                bar_positions,
                sizes,
                xerr=errors,
                height=height,
                label=label,
                color=(GOOD, "#9a6100")[k],
                error_kw={"linewidth": 0.8},
            )
        axis.set_yticks(range(len(names)), names)
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.axvline(0.0, color="#1f2933", linewidth=0.8)
        if len(kinds) > 1:
            axis.legend(frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        axis.set_xlabel(quantity)
        if metric_sensitivity.kind == "rank":
            axis.set_xlim(-1.0, 1.0)

    return figure_files.render_svg(
        (WIDTH, 0.9 + 0.25 * len(names) * len(kinds)),
        f"effects {metric_sensitivity.metric} {metric_sensitivity.variant}",
        paint,
    )


def tornado(changes: Sequence[Change], unit: str, name: str, labels: Sequence[str]) -> str:
    """By how much a metric changes with one factor at a time, the largest change first; `labels`: each change in words."""
    factor, _ = si_conversion(unit)
    order = sorted(range(len(changes)), key=lambda i: -abs(changes[i].now - changes[i].before))
    sizes = [(changes[i].now - changes[i].before) / factor for i in order]

    def paint(grid: Any) -> None:
        axis = grid[0, 0]
        axis.barh(
            range(len(order)), np.nan_to_num(sizes), color=[BAD if size < 0 else GOOD for size in sizes], height=0.7
        )
        axis.set_yticks(range(len(order)), [labels[i] for i in order], fontsize=8)
        axis.invert_yaxis()
        axis.grid(visible=False, axis="y")
        axis.axvline(0.0, color="#1f2933", linewidth=0.8)
        axis.set_xlabel(plotting.axis_label(f"change of {name}", unit))

    return figure_files.render_svg((WIDE, 0.9 + 0.24 * len(order)), f"tornado {name}", paint)


def tuning_history(tuned: Tuned, unit: str, name: str, is_difference: bool = False) -> str:
    """Objective of each trial of a tuning, and the best until then."""
    factor, offset = si_conversion(unit, is_difference)
    values = np.array([trial.objective if np.isfinite(trial.objective) else np.nan for trial in tuned.trials])
    good = np.array([trial.is_feasible for trial in tuned.trials])
    trial_indices = np.array([trial.index for trial in tuned.trials])

    def paint(grid: Any) -> None:
        axis = grid[0, 0]
        shown = (values - offset) / factor
        axis.plot(trial_indices[good], shown[good], "o", color=GOOD, markersize=4, label="keeps the limits")
        axis.plot(trial_indices[~good], shown[~good], "x", color=BAD, markersize=4, label="breaks one")
        axis.axhline(shown[0], color="#52606d", linewidth=0.8, linestyle=":", label="as in the scenario")
        if good.any():
            low, most = np.nanmin(shown), np.nanquantile(shown, 0.9)
            high = max(min(np.nanmax(shown), low + 3.0 * (most - low)), shown[0])  # without far outliers
            margin = 0.1 * ((high - low) or abs(high) or 1.0)
            axis.set_ylim(low - margin, high + margin)
        axis.xaxis.get_major_locator().set_params(integer=True)
        axis.set_xlabel("trial")
        axis.set_ylabel(plotting.axis_label(name, unit))
        axis.legend(frameon=False, fontsize=8)

    return figure_files.render_svg((WIDE, 3.2), f"tuning {name}", paint)
