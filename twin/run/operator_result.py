"""Result of an operator's session: score at reaching targets, warnings that were shown, and the verdict.

The console shows the score while the session runs; the end of the run stores it in summary.json, section `operation`.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit
from twin.coupling import find
from twin.errors import CouplingError
from twin.results import ExpectationResult
from twin.run.recorded_views import scene_data, targets_and_warnings

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from twin.coupling import Catalog, MemberVariable
    from twin.results import Signals
    from twin.scenario import ScenarioSpec

NOTICEABLE = 0.01  # share of the time of a run from which a warning is noted
WARNING = "warning: "  # begins a note
MOVED = 0.1  # of the tolerance of targets, from which a tip has moved


@dataclass(frozen=True)
class Score:
    """Targets reached so far with their times [s], the length of the path, and the duration until the last target or until now.

    The duration counts from the first motion of a tip [s], 0 before it; `path` is in the unit of the signal. `end`: time of the last target [s].
    """

    reached: Mapping[str, float]
    path: float = 0.0
    duration: float = 0.0
    end: float = np.inf


def score(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    targets: Mapping[str, Any],
    begin: float | None,
    path: NDArray[np.float64] | None = None,
) -> Score:
    """Score rows of the signal of `targets`: `time` of shape (rows,) [s], `values` of shape (rows, ...), from `begin` [s].

    `path`: rows of the signal whose travel is the path; None: that of `targets`, which may be a projection of the motion.
    """
    if begin is None or not len(time) or time[-1] <= begin:
        return Score({})
    is_scored = time >= begin
    time, rows = time[is_scored], values.reshape(len(time), -1)[is_scored]
    reached = {}
    for name, point in targets["points"].items():
        hits = np.flatnonzero(np.linalg.norm(rows - point, axis=1) <= targets["tolerance"])
        if len(hits):
            reached[name] = float(time[hits[0]])
    is_complete = len(reached) == len(targets["points"])
    end = max(reached.values()) if is_complete else float(time[-1])
    travel = rows if path is None else path.reshape(len(is_scored), -1)[is_scored]
    return Score(
        dict(sorted(reached.items(), key=lambda entry: entry[1])),
        float(np.linalg.norm(np.diff(travel[time <= end], axis=0), axis=1).sum()),
        end - begin,
        end if is_complete else np.inf,
    )


def first_motion(time: NDArray[np.float64], tips: Iterable[NDArray[Any]], tolerance: float) -> float | None:
    """Return the time of the last row before a tip moves [s]; None before it. `tips`: rows of each; `tolerance`: of targets."""
    rows = [np.asarray(values, np.float64).reshape(len(time), -1) for values in tips]
    moved = np.any([np.linalg.norm(each - each[0], axis=1) > MOVED * tolerance for each in rows], axis=0)
    return float(time[np.argmax(moved) - 1]) if moved.any() else None


def tip_signals(scenes: Iterable[Mapping[str, Any]], targets: Mapping[str, Any], recorded: Container[str]) -> list[str]:
    """Return the signals of all tips: the points of scenes that are recorded, and what reaches the targets."""
    points = [point["signal"] for scene in scenes for point in scene["points"] if point["signal"] in recorded]
    return list(dict.fromkeys([targets["signal"], *points]))


def score_text(
    now: Score, targets: Mapping[str, Any], factor: float, shown_unit: str, label: str = "", has_ended: bool = False
) -> str:
    """Return a score in words, the length of the path, forth and back, in the display unit. `label`: of what reaches them."""
    names = list(targets["points"])
    left = [name for name in names if name not in now.reached]
    figures = f"{now.duration:.1f} s since the first motion, path length {factor * now.path:.0f} {shown_unit}"
    owner = f"{label[0].upper()}{label[1:]}: " if label else ""
    if not left:
        return f"{owner}{'all' if owner else 'All'} {len(names)} targets reached in {figures}{'' if has_ended else '; scoring has ended'}"
    state = f"{owner}{len(now.reached)} of {len(names)} targets"
    if has_ended:
        return f"{state}; {figures}"
    state += f", next: {left[0]}"
    hint = f"{targets['hint']}; " if targets.get("hint") and not now.reached else ""
    return f"{state}; {hint}{figures if now.duration else 'time starts with your first motion'}"


def point_label(scenes: Iterable[Mapping[str, Any]], signal: str) -> str:
    """Return the label of the point that a signal moves in the scenes, or nothing."""
    points = [point for scene in scenes for point in scene["points"]]
    return next((str(point["label"]) for point in points if point["signal"] == signal), "")


def warning_signals(warning: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the signals of a warning: that with the limit, and what is subtracted from it."""
    return warning["signal"], *([warning["minus"]] if "minus" in warning else [])


def warning_result(
    time: NDArray[np.float64],
    values: Sequence[NDArray[Any]],
    warning: Mapping[str, Any],
    scale: tuple[str, float, float],
    end: float = np.inf,
) -> dict[str, Any]:
    """Return for how long a warning was shown [s], and the largest value of its signal, or magnitude if it has a limit `below`.

    `values`: rows of its signals. `scale`: display unit, factor, offset. `end`: of the score [s]; what is shown later is in `afterwards` alone, and not judged.
    """
    rows, *others = (np.asarray(value, np.float64).reshape(len(time)) for value in values)
    rows = rows - sum(others)
    if "below" in warning:
        rows = np.abs(rows)
    every = float(time[1] - time[0]) if len(time) > 1 else 0.0
    shown_unit, factor, offset = scale
    limit = factor * warning["above"] + offset

    def judged(part: NDArray[np.float64]) -> tuple[float, float, str, str]:
        duration = every * int((part > warning["above"]).sum())
        peak = factor * float(part.max(initial=-np.inf)) + offset
        text = f"for {duration:.1f} s" if duration else "never"
        return duration, peak, text, f"largest {peak:.4g} {shown_unit}".rstrip()

    limit_text = "" if f"{limit:.4g} " in warning["text"] else f", limit {limit:.4g} {shown_unit}".rstrip()
    duration, peak, text, peak_text = judged(rows[time <= end])
    later, _, later_text, later_peak = judged(rows[time > end])
    return {
        "text": warning["text"],
        "signal": " - ".join(warning_signals(warning)),
        "unit": shown_unit,
        "limit": limit,
        "maximum": peak,
        "duration": duration,
        "detail": f"{text}; {peak_text}{limit_text}" if limit else text,
        "end": float(end) if later else None,
        "afterwards": (
            f"; after the last target, not judged: {later_text}{f', {later_peak}' * bool(limit)}" if later else ""
        ),
    }


def session_verdict(verdicts: Iterable[str], all_reached: bool, has_ended: bool) -> str:
    """Return the verdict of a session from those of its requirements and warnings; empty if nothing is judged.

    It passes only if all targets are reached and it did not end early.
    """
    judged = [verdict for verdict in verdicts if verdict in ("pass", "fail")]
    if "fail" in judged:
        return "failed"
    if not all_reached:
        return "targets left"
    return "ended early" if not has_ended else "passed" if judged else ""


def display_conversion(variable: MemberVariable) -> tuple[str, float, float]:
    """Return display unit, factor and offset of a variable."""
    if variable.display_unit and variable.unit:
        with suppress(CouplingError):  # an FMU may have any text for a unit
            return variable.display_unit, *unit.conversion(variable.unit, variable.display_unit, variable.name)
    return variable.unit, 1.0, 0.0


def operator_result(scenario: ScenarioSpec, catalog: Catalog, signals: Signals) -> dict[str, Any]:
    """Return the score and the warnings of a session from its rows, as plain data; empty without targets and warnings."""
    targets, warnings = targets_and_warnings(scenario, catalog)
    time, result, end = np.asarray(signals.time), dict[str, Any](), np.inf
    if not len(time):
        return result
    if targets:
        path = targets.get("path", targets["signal"])
        shown_unit, factor, _ = display_conversion(find(path, catalog).variable)
        scenes = [scene_data(scene) for scene in scenario.scenes]
        tips = [recorded_rows(signals, name) for name in tip_signals(scenes, targets, signals.values)]
        begin = first_motion(time, tips, targets["tolerance"])
        now = score(time, recorded_rows(signals, targets["signal"]), targets, begin, recorded_rows(signals, path))
        end = now.end
        label = point_label(scenes, targets["signal"])
        result["targets"] = {
            "signal": targets["signal"],
            "reached": dict(now.reached),
            "missed": [name for name in targets["points"] if name not in now.reached],
            "duration": now.duration,
            "path": factor * now.path,
            "unit": shown_unit,
            "begin": begin,
            "detail": score_text(now, targets, factor, shown_unit, label, has_ended=True),
        }
    if warnings:
        result["warnings"] = warning_results(warnings, catalog, signals, end)
    return result


def warning_results(
    warnings: Iterable[Mapping[str, Any]], catalog: Catalog, signals: Signals, end: float = np.inf
) -> list[dict[str, Any]]:
    """Return for how long each warning was shown until `end` [s], or would have been without an operator."""
    time = np.asarray(signals.time)
    return [
        warning_result(
            time,
            [recorded_rows(signals, name) for name in warning_signals(warning)],
            warning,
            display_conversion(find(warning["signal"], catalog).variable),
            end,
        )
        for warning in warnings
    ]


def warning_notes(
    scenario: ScenarioSpec, catalogs: Mapping[str, Catalog], tables: Mapping[tuple[str, int], Signals]
) -> list[str]:
    """Return a line for each warning of a case whose signal is above its limit for a noticeable share of the time."""
    notes = []
    for (variant, seed), signals in tables.items():
        catalog = catalogs.get(variant)
        if catalog is None or len(signals.time) < 2:
            continue
        _, warnings = targets_and_warnings(scenario, catalog)
        recorded = [each for each in warnings if all(name in signals.values for name in warning_signals(each))]
        if not recorded:
            continue  # nobody reads the times of a recording that may be larger than memory
        least = NOTICEABLE * float(signals.time[-1] - signals.time[0])
        notes += [
            f"{variant}, seed {seed}: {WARNING}{each['text']} {each['detail']}"
            for each in warning_results(recorded, catalog, signals)
            if each["duration"] > least
        ]
    return notes


def recorded_rows(signals: Signals, name: str) -> NDArray[Any]:
    """Return the rows of a signal or of an element of an array, such as `command.speed[1]`."""
    base, _, index = name.partition("[")
    if name in signals.values or not index:
        return np.asarray(signals.values[name])
    element: tuple[Any, ...] = (slice(None), *(int(i) - 1 for i in index.rstrip("]").split(",")))
    rows: NDArray[Any] = np.asarray(signals.values[base])[element]
    return rows


def operator_requirements(operation: Mapping[str, Any]) -> list[ExpectationResult]:
    """Return what an operator has to meet as requirements: all targets reached; each warning that was shown is one not met."""
    targets = operation.get("targets")
    results = []
    if targets is not None:
        count = len(targets["reached"]) + len(targets["missed"])
        verdict, times = "fail" if targets["missed"] else "pass", reached_text(targets["reached"])
        detail = "; ".join(filter(None, [targets["detail"], times]))
        results.append(ExpectationResult(f"All {count} targets reached", verdict, detail))
    results += [
        ExpectationResult(f"No warning: {warning['text']}", "fail", warning["detail"] + warning["afterwards"])
        for warning in operation.get("warnings", ())
        if warning["duration"]
    ]
    return results


def reached_text(reached: Mapping[str, float]) -> str:
    """Return the times [s] at which targets were reached, in words."""
    return ", ".join(f"{name} at {time:.1f} s" for name, time in reached.items()) + " of the session" * bool(reached)


def operation_text(operation: Mapping[str, Any]) -> str:
    """Return score and shown warnings in a line."""
    targets = [operation["targets"]["detail"]] if "targets" in operation else []
    shown = [
        f"{warning['text']} {warning['detail'].replace(';', ',')}"
        for warning in operation.get("warnings", ())
        if warning["duration"]
    ]
    return "; ".join([*targets, *shown])
