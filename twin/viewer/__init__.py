"""Viewer of recorded runs, served or as a self-contained page: signals, overlays, differences, spectra, failed expectations."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.viewer.page import embedded_page
    from twin.viewer.runs import RunCollection, ViewedCurve, open_recorded_run
    from twin.viewer.selection import select_cases, select_signals
    from twin.viewer.server import serve

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "page": ["embedded_page"],
        "runs": ["ViewedCurve", "RunCollection", "open_recorded_run"],
        "selection": ["select_cases", "select_signals"],
        "server": ["serve"],
    },
)

__all__ = [
    "RunCollection",
    "ViewedCurve",
    "embedded_page",
    "open_recorded_run",
    "select_cases",
    "select_signals",
    "serve",
]
