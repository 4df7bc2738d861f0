"""How a run on hardware ends: at its stop time, or by a stop of the hardware."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from twin import clock

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.results.evaluation.metrics import Expectation
    from twin.results.recording.signals import Signals


@dataclass(frozen=True)
class HardwareTermination:
    """End of a run on hardware. `time_ns`: of a stop before the end; `unsafe`: axes not known to be at rest."""

    time_ns: clock.Time | None = None
    reason: str = ""
    unsafe: str = ""
    log: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Description: `stopped at 3.06 s: ...`."""
        text = "ran to its end." if self.time_ns is None else f"stopped at {clock.text(self.time_ns)}: {self.reason}"
        return f"{text} Not at rest: {self.unsafe}" if self.unsafe else text


def check_termination(
    expectation: Expectation,
    tables: Mapping[tuple[str, int], Signals],
    recorded_terminations: Mapping[tuple[str, int], HardwareTermination],
) -> tuple[str, str, str]:
    """Check whether hardware stopped every case as expected, or let it run to its end, and came to rest.

    Returns name, verdict and detail of the result.
    """
    low, high = expectation.window.start_ns, expectation.window.stop_ns
    expected = "a run to its end" if expectation.ends == "completed" else "a stop"
    expected += "" if low is None else f" from {clock.text(low)}"
    expected += "" if high is None else f" {'until' if low is None else 'to'} {clock.text(high)}"
    name = expectation.name or f"ends with {expected}"
    terminations = {
        f"{variant}, seed {seed}": recorded_terminations.get((variant, seed), HardwareTermination())
        for variant, seed in tables
        if not expectation.variants or variant in expectation.variants
    }
    if not terminations:
        return (name, "skipped", "None of its variants was run.")
    for case, termination in terminations.items():
        when = termination.time_ns
        stopped = when is not None and (low is None or low <= when) and (high is None or when <= high)
        if termination.unsafe or (when is not None if expectation.ends == "completed" else not stopped):
            return (name, "fail", f"{case} {termination.text} Expected {expected}, everything at rest.")
    times = [termination.time_ns for termination in terminations.values() if termination.time_ns is not None]
    span = " to ".join(dict.fromkeys(clock.text(time) for time in (min(times), max(times)))) if times else ""
    how = f"stopped at {span}" if times else "completed"
    runs = f"{len(terminations)} run{'s' if len(terminations) > 1 else ''}"
    return (name, "pass", f"{runs} {how}, everything at rest; expected {expected}.")
