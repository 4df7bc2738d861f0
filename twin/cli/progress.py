"""Progress of a command: a bar on a terminal, occasional lines elsewhere."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Self

from twin.cli.terminal import make_bar

if TYPE_CHECKING:
    from rich.progress import Progress

BAR_DELAY = 1.0  # a `DelayedBar` appears after this time [s]


class ProgressBar:
    """A bar on stderr where that is a terminal; nothing elsewhere. It appears with the first progress: not before an error."""

    def __init__(self, title: str, *, enabled: bool = True) -> None:
        self.title, self.enabled = title, enabled
        self.bar: Progress | None = None

    def __enter__(self) -> Self:
        if self.enabled and sys.stderr.isatty():
            self.bar = make_bar(err=True)
            self.task = self.bar.add_task(self.title, total=1.0)
        return self

    def show(self, text: str, fraction: float) -> None:
        """Update the bar; at the end of a part, before the next one begins, it pulses without a percentage."""
        if self.bar is not None:
            self.bar.start()
            self.bar.tasks[0].total = 1.0 if fraction < 1.0 else None
            self.bar.update(self.task, description=text, completed=fraction)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()


class DelayedBar:
    """A bar on stdout that appears only when a task takes long."""

    def __init__(self, title: str = "simulating") -> None:
        self.title = title
        self.start = time.monotonic()
        self.progress: Progress | None = None

    def __call__(self, fraction: float) -> None:
        """Update the bar."""
        if self.progress is None:
            if time.monotonic() - self.start < BAR_DELAY:
                return
            self.progress = make_bar()
            self.task = self.progress.add_task(self.title, total=1.0)
            self.progress.start()
        self.progress.update(self.task, completed=fraction)

    def close(self) -> None:
        """Remove the bar."""
        if self.progress is not None:
            self.progress.stop()
