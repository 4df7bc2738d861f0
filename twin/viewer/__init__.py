"""Recorded runs in the browser, and as one page of a file: signals, overlays, differences, spectra, what failed where."""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.viewer.chosen import chosen_cases, chosen_signals
    from twin.viewer.page import Written, of_samples
    from twin.viewer.runs import Curve, Runs, opened
    from twin.viewer.server import serve

__getattr__ = late.names(
    __name__,
    {
        "Curve": "runs",
        "Runs": "runs",
        "Written": "page",
        "chosen_cases": "chosen",
        "chosen_signals": "chosen",
        "of_samples": "page",
        "opened": "runs",
        "serve": "server",
    },
)

__all__ = ["Curve", "Runs", "Written", "chosen_cases", "chosen_signals", "of_samples", "opened", "serve"]
