"""An identification from its file to its result."""

from __future__ import annotations

import time
from contextlib import ExitStack, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import ScenarioError
from twin.identify.intervals import METHODS, estimate_uncertainty
from twin.identify.model import Model
from twin.identify.recordings.loading import load
from twin.identify.result import Result
from twin.identify.search import Progress, multistart_search
from twin.process import Stop
from twin.run import noop

if TYPE_CHECKING:
    from twin.identify.problem import Problem


def identify(
    problem: Problem | str | Path,
    *,
    starts: int = 8,
    seed: int = 0,
    intervals: str = "jacobian",
    build: Path = Path("build"),
    progress: Progress = noop,
    command: str = "twin.identify.identify",
) -> Result:
    """Fit a model to recordings. After Ctrl-C: the best until then, with intervals by the Jacobian."""
    problem = problem if not isinstance(problem, str | Path) else load(problem)
    if intervals not in METHODS:
        raise ScenarioError(f"intervals: {intervals} is not known. Use {', '.join(METHODS)}.")
    if starts < 1:
        raise ScenarioError("starts: one at least is needed.")
    started = datetime.now(UTC).astimezone()
    begin = time.perf_counter()
    with Stop() as stop, ExitStack() as stack:
        with stop.armed():
            model = stack.enter_context(Model(problem, build))
            fit = multistart_search(model, starts, seed, progress)

        def report(what: str, part: float) -> None:
            progress(what, part, "")

        try:
            with nullcontext() if fit.interrupted else stop.armed():
                knowledge = estimate_uncertainty(model, fit, "jacobian" if fit.interrupted else intervals, seed, report)
        except KeyboardInterrupt:
            fit.interrupted = True
            knowledge = estimate_uncertainty(model, fit, "jacobian", seed, report)
        predicted = model.predicted(fit.positions)
        fit.simulations, fit.seconds = model.count, time.perf_counter() - begin
    return Result(problem, fit, knowledge, predicted, command, started)
