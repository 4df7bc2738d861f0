"""Whether a run lasts to the end of the window that a metric or an acceptance criterion evaluates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin import clock

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from twin.results.evaluation.metrics import Expectation, Metric
    from twin.results.recording.signals import Signals


def ends_before(time: np.ndarray[Any, Any], stop: float) -> bool:
    """Return whether recorded times [s] end an interval or more before a window that ends at `stop` [s]."""
    interval = float(time[-1] - time[-2]) if len(time) > 1 else 0.0
    return bool(stop - time[-1] > (1.0 + 1e-6) * interval)


def describe_cut(
    expectation: Expectation, metrics: Mapping[str, Metric], tables: Mapping[tuple[str, int], Signals]
) -> str:
    """Return a sentence on the first judged run that ends before the window; empty if all last long enough."""
    metric = metrics.get(expectation.metric or "")
    window, signal = (metric.window, metric.signal) if metric else (expectation.window, expectation.signal)
    if window.stop_ns is None or signal is None:
        return ""
    judged = expectation.ordered or expectation.variants or (metric.variants if metric else ())
    for (variant, seed), signals in tables.items():
        is_judged = (not judged or variant in judged) and signals.has(signal)
        if is_judged and ends_before(signals.time[-2:], clock.seconds(window.stop_ns)):
            end = clock.text(round(float(signals.time[-1]) * clock.NANOSECONDS))
            return f"Not judged: {variant}, seed {seed}, ends at {end}, and the window at {clock.text(window.stop_ns)}."
    return ""
