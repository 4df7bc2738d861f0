"""Progress of a command: a bar on a terminal, occasional lines elsewhere."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Self

from twin.cli.terminal import make_bar

if TYPE_CHECKING:
    from rich.progress import Progress


class ProgressBar:
    """A bar on stderr where that is a terminal; nothing elsewhere. It appears with the first progress after `delay` [s]: not before an error."""

    def __init__(self, title: str, *, enabled: bool = True, delay: float = 0.0) -> None:
        self.title, self.enabled = title, enabled
        self.begin = time.monotonic() + delay
        self.bar: Progress | None = None

    def __enter__(self) -> Self:
        if self.enabled and sys.stderr.isatty():
            self.bar = make_bar(err=True)
            self.task = self.bar.add_task(self.title, total=1.0)
        return self

    def show(self, text: str, fraction: float) -> None:
        """Update the bar; at the end of a part, before the next one begins, it pulses without a percentage."""
        if self.bar is not None and time.monotonic() >= self.begin:
            self.bar.start()
            self.bar.tasks[0].total = 1.0 if fraction < 1.0 else None
            self.bar.update(self.task, description=text, completed=fraction)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()
