"""A problem and its result without a model: two recordings, three unknowns, and what is known of them."""

from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np

from twin.identify import Fit, IdentifyKeys, Output, Unknown
from twin.identify.intervals import ParameterUncertainty
from twin.identify.problem import Problem, RecordedExperiment
from twin.identify.result import Result
from twin.identify.search import Start

PLAY = Unknown("sheath.play", "m", 0.0, 2e-3, 1e-3, member="sheath", variable="play", display_unit="mm")
DRAG = Unknown("sheath.drag", "N", 0.1, 10.0, 1.0, is_log=True, member="sheath", variable="drag")
OFFSET = Unknown("offset of tip in slow", "m", -0.01, 0.01, 0.0, display_unit="mm")
TIME = np.array([0.0, 0.5, 1.0, 1.5, 2.0])


def output(column="tip [mm]", values=(0, 1, 2, 3, 4), recording="slow", **fields):
    values = 1e-3 * np.array(values, float)
    return Output(
        column, "tip.csv", "sheath.tip", "m", "mm", TIME[: len(values)], values, 0.0, 0.0, recording=recording, **fields
    )


def recording(name, *outputs, members=("sheath",), model="sheath", left_out=(), files=("tip.csv",), own=()):
    case = SimpleNamespace(members=dict.fromkeys(members))
    every = tuple(SimpleNamespace(path=f"/{one}", shown=one, sha256=f"sum of {one}") for one in files)
    return RecordedExperiment(name, case, {}, outputs, (), every, model, left_out, frozenset(own))


def problem(tmp_path, *recordings, unknowns=(PLAY, DRAG, OFFSET), **fields):
    keys = IdentifyKeys.model_validate({"title": "A sheath", "confidence": "90 %"})
    recordings = recordings or (
        recording("slow", output()),
        recording("fast", output(recording="fast", values=(0, 2, 4))),
    )
    return Problem(tmp_path, keys, recordings, tuple(unknowns), **{"components": {"sheath": "sheath"}, **fields})


def known(covariance, positions, *, half=None, method="jacobian", effect=None, singular=(), directions=(), **fields):
    """What is known at positions; `half`: half widths of the intervals."""
    covariance, positions = np.array(covariance, float), np.array(positions, float)
    half = 2 * np.sqrt(np.diag(covariance)) if half is None else np.array(half)
    count = len(positions)
    return ParameterUncertainty(
        method,
        covariance,
        positions - half,
        positions + half,
        np.array(singular, float),
        np.array(directions, float).reshape(-1, count),
        np.array([True] * count if effect is None else effect),
        fields.pop("rough", np.zeros(count, bool)),
        **fields,
    )


COVARIANCE = [[0.0004, 0.0001, 0.0], [0.0001, 0.0001, 0.0], [0.0, 0.0, 0.0009]]
POSITIONS = [0.25, 0.5, 0.75]


def result(tmp_path, *, knowledge=None, fit=None, of=None, errors=(0.0, 0.1, -0.1, 0.3, -0.2)):
    """A result whose model is `errors` [mm] beside each measured value."""
    of = of or problem(tmp_path)
    starts = [
        Start(np.array([0.5] * 3), np.array(POSITIONS), 4.0),
        Start(np.array([0.1] * 3), np.array([0.3] * 3), 6.0),
    ]
    fit = fit or Fit(np.array(POSITIONS), [0.1e-3, 0.2e-3], starts)
    knowledge = knowledge or known(COVARIANCE, POSITIONS)
    predicted = [one.values + 1e-3 * np.array(errors)[: len(one.values)] for one in of.outputs]
    started = datetime(2026, 3, 4, 5, 6, 7, 89, tzinfo=UTC)
    return Result(of, fit, knowledge, predicted, "twin identify a.yaml", started)
