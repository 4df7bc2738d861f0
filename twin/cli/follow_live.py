"""`twin follow --rig`: follow a running rig, with a line on the terminal that shows the present estimates."""

from __future__ import annotations

import sys
import time
from collections import deque
from dataclasses import asdict
from typing import TYPE_CHECKING, Self

from twin.cli.follow import show
from twin.cli.follow_page import FollowPage
from twin.cli.terminal import open_console, say
from twin.errors import SimulationError, printable

if TYPE_CHECKING:
    from pathlib import Path

    from twin import clock
    from twin.cli.follow_page import PageOptions
    from twin.follow import Estimate, EstimateRecording, FollowStatus, LiveProblem

REFRESH = 0.1  # between two updates of the line [s]
TAIL = 2000  # estimates from which the final remarks follow


def follow_live(
    file: Path, rig: str | None, duration: clock.Time, runs: Path, build: Path, options: PageOptions | None = None
) -> None:
    """Follow a rig until Ctrl-C, or for a time; write the run and print the result. `options`: of a page in the browser.

    The page stays until Ctrl-C if following ends after its time, and closes with it otherwise.
    """
    from twin.follow import EstimateRecording, LiveFollowing, load_live

    problem = load_live(file, rig)
    recording: EstimateRecording | None = None
    tail: deque[Estimate] = deque(maxlen=TAIL)  # those with measurements
    last: Estimate | None = None
    status, failure, begin, page, is_over = "completed", "", time.perf_counter(), None, False
    end = problem.experiment.case.start_ns + duration if duration else None
    with LiveLine(problem) as line:
        live = LiveFollowing(problem, build, line.say)
        try:
            for estimates in live.revisions():
                line.show(last)
                if not estimates:
                    continue
                recording = recording or EstimateRecording(problem, runs)
                recording.write(estimates)
                if options is not None and page is None:
                    page = FollowPage(recording.folder, options, line.say)
                while tail and tail[-1].time >= estimates[0].time:
                    tail.pop()
                tail.extend(estimate for estimate in estimates if estimate.band[1] > 0.0)
                last, line.fraction = estimates[-1], recording.in_band
                line.warn(recording.status)
                is_over = end is not None and last.time * 1e9 >= end
                if is_over:
                    break
        except KeyboardInterrupt:
            pass
        except SimulationError as error:
            status, failure = "failed", str(error)
    if recording is None or last is None:
        raise SimulationError(failure or f"{file}: ended before anything was measured.")
    if not tail or tail[-1] is not last:
        tail.append(last)
    finish(problem, recording, list(tail), live.messages.summary(), (status, failure, time.perf_counter() - begin))
    if page is not None:
        page.wait() if is_over else page.close()
    if failure:
        say(f"{status}: {failure}", err=True)
        sys.exit(1)


def finish(
    problem: LiveProblem,
    recording: EstimateRecording,
    tail: list[Estimate],
    rig: dict[str, object],
    outcome: tuple[str, str, float],
) -> None:
    """Complete the folder and print the result. `outcome`: status, reason and wall-clock time [s]."""
    from twin.follow import remarks, summary_of
    from twin.results import link_latest

    notes = [*problem.notes, *remarks(problem, tail)]
    follow = {
        **summary_of(problem, tail),
        "measurements": recording.count,
        "nis_in_band": recording.in_band,
        **({"changes": [asdict(alarm) for alarm in recording.status.alarms]} if problem.changes else {}),
        "rig": rig,
    }
    folder = recording.finish(tail[-1], *outcome, {"notes": notes, "follow": follow})
    link_latest(folder)
    show(problem, tail, recording.status.alarms, f"{recording.count} times", recording.in_band, folder)


class LiveLine:
    """A line on stderr, where that is a terminal, with the present estimates; events are printed above it."""

    def __init__(self, problem: LiveProblem) -> None:
        self.problem, self.fraction = problem, float("nan")
        self.is_shown = sys.stderr.isatty()
        self._due = 0.0
        self._represents = True

    def __enter__(self) -> Self:
        if self.is_shown:
            self.write(f"waiting for {', '.join(self.problem.rig.sources)}")
        return self

    def __exit__(self, *_: object) -> None:
        if self.is_shown:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()

    def say(self, text: str) -> None:
        """Print the line of an event."""
        if self.is_shown:
            sys.stderr.write("\r\033[K")
        say(text, err=True)
        self._due = 0.0

    def warn(self, status: FollowStatus) -> None:
        """Print a line when the twin begins not to represent the rig, and when it represents it again."""
        from twin.follow import LOST

        represents = status.since is None
        if represents is not self._represents and status.last is not None:
            self._represents = represents
            text = "The twin represents the rig again." if represents else f"{LOST} {status.reason}"
            self.say(f"{status.last.time:.1f} s: {text}")

    def show(self, estimate: Estimate | None) -> None:
        """Show an estimate, ten times a second."""
        if estimate is None or not self.is_shown or time.monotonic() < self._due:
            return
        from twin.results import format_value, si_conversion

        self._due = time.monotonic() + REFRESH
        parts = [f"{estimate.time:.1f} s"]
        for variable, value, deviation in zip(
            self.problem.estimates, estimate.values, estimate.deviations, strict=True
        ):
            factor, offset = si_conversion(variable.unit)
            unit = variable.display_unit or variable.unit
            number = format_value(value * factor + offset, unit, digits=3)
            spread = format_value(deviation * factor, unit, is_difference=True, digits=2)
            parts.append(f"{variable.name} {number} +- {spread}")
        parts.append(f"NIS in band {100 * self.fraction:.0f} %")
        self.write("  ".join(parts))

    @staticmethod
    def write(text: str) -> None:
        """Replace the line."""
        width = open_console(err=True).width
        sys.stderr.write(f"\r\033[K{printable(text)[: width - 1]}")
        sys.stderr.flush()
