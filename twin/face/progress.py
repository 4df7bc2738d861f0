"""Progress of a run: none, a callback, a bar, or a line of text in a notebook without ipywidgets.

By default it appears after some seconds where a person watches: in a terminal or a notebook.
"""

from __future__ import annotations

import sys
import threading
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, TypeAlias

from twin.run import noop

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    ProgressCallback: TypeAlias = Callable[[str, float], object]  # of a case's name and its completed fraction
    Progress: TypeAlias = bool | ProgressCallback | None

DELAY = 3.0  # after which progress is shown by default [s]


class Bar:
    """A bar on stderr or in a notebook, removed at the end."""

    def __init__(self, title: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
        console: Any = Console(stderr=not in_notebook())
        self._bar = Progress(*columns, TimeElapsedColumn(), console=console, transient=True)
        self._task = self._bar.add_task(title, total=1.0)
        self._bar.start()

    def __call__(self, case: str, part: float) -> None:
        """Show the progress of a case."""
        self._bar.update(self._task, description=case, completed=part)

    def close(self) -> None:
        """Remove the bar."""
        self._bar.stop()


class TextLine:
    """A line of text in a notebook that cannot show the bar: one output, which is updated; empty at the end."""

    def __init__(self, title: str) -> None:
        from IPython import display

        show: Any = display.display  # has no types
        self._text = f"{title}  0 %"
        self._handle = show({"text/plain": self._text}, raw=True, display_id=True)

    def __call__(self, case: str, part: float) -> None:
        """Show the progress of a case."""
        self._write(f"{case}  {100 * part:.0f} %")

    def _write(self, text: str) -> None:
        if text != self._text:
            self._text = text
            self._handle.update({"text/plain": text}, raw=True)

    def close(self) -> None:
        """Clear the line."""
        self._write("")


def in_notebook() -> bool:
    """Return whether this process is a notebook kernel."""
    return "ipykernel" in sys.modules


class Delayed:
    """A bar or line that appears after `DELAY`, also while nothing is reported."""

    def __init__(self, title: str) -> None:
        self._bar: Bar | TextLine | None = None
        self._last, self._lock = (title, 0.0), threading.Lock()
        self._timer: threading.Timer | None = threading.Timer(DELAY, self._show)
        self._timer.daemon = True
        self._timer.start()

    def _show(self) -> None:
        with self._lock:
            if self._timer is not None:
                self._bar = shown_progress(self._last[0])
                self._bar(*self._last)

    def __call__(self, case: str, part: float) -> None:
        """Show the progress of a case, if it is time."""
        with self._lock:
            self._last = case, part
            if self._bar is not None:
                self._bar(case, part)

    def close(self) -> None:
        """Remove what is shown."""
        with self._lock:
            timer, self._timer = self._timer, None
            if timer is not None:
                timer.cancel()
            if self._bar is not None:
                self._bar.close()


def shown_progress(title: str) -> Bar | TextLine:
    """Return a bar, or a line of text in a notebook where rich would warn at each update and show nothing."""
    return TextLine(title) if in_notebook() and find_spec("ipywidgets") is None else Bar(title)


@contextmanager
def progress_callback(progress: Progress, title: str) -> Iterator[ProgressCallback]:
    """Yield the callback for a run; what is shown is removed at the end."""
    if callable(progress):
        yield progress
        return
    is_watched = in_notebook() or sys.stderr.isatty()
    bar: Bar | TextLine | Delayed | None = None
    if progress or (progress is None and is_watched):
        bar = shown_progress(title) if progress else Delayed(title)
    try:
        yield bar or noop
    finally:
        if bar:
            bar.close()
