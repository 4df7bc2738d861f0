"""Recorded runs in the browser, and as one page of a file: signals, overlays, differences, spectra, what failed where."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.viewer.page import Written, of_samples
    from twin.viewer.runs import Curve, Runs, opened
    from twin.viewer.selection import chosen_cases, chosen_signals
    from twin.viewer.server import serve

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "page": ["Written", "of_samples"],
        "runs": ["Curve", "Runs", "opened"],
        "selection": ["chosen_cases", "chosen_signals"],
        "server": ["serve"],
    },
)

__all__ = ["Curve", "Runs", "Written", "chosen_cases", "chosen_signals", "of_samples", "opened", "serve"]
