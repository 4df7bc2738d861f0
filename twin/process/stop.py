"""The one stop path: the first signal that would end this process ends the run instead; more of them change nothing."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from collections.abc import Iterator

ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK")
SIGNALS = [getattr(signal, one) for one in ENDING if hasattr(signal, one)]


class Stop:
    """While it is entered, the first signal raises KeyboardInterrupt where it is `armed`; elsewhere it is only noted.

    A signal that would have killed the process does so at the end. `last`: the process ends after it, and no further signal
    changes how. Outside of the main thread it does nothing.
    """

    def __init__(self, last: bool = False) -> None:
        self._last = last
        self.number = 0  # the first signal that came
        self._armed = 0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for one in SIGNALS:
                if signal.getsignal(one) not in (signal.SIG_IGN, None):
                    self._before[one] = signal.signal(one, self._heard)
        return self

    def __exit__(self, *_: object) -> None:
        for one, handler in self._before.items():
            signal.signal(one, signal.SIG_IGN if self._last and self.number else handler)
        if self.number and not self._last and self._before.get(self.number) is signal.SIG_DFL:
            signal.raise_signal(self.number)

    def _heard(self, number: int, _frame: object) -> None:
        first, self.number = not self.number, self.number or number
        if first and self._armed:
            raise KeyboardInterrupt

    def check(self) -> None:
        """Raise again what native frames or a callback swallowed."""
        if self.number and self._armed:
            raise KeyboardInterrupt

    @contextmanager
    def armed(self) -> Iterator[None]:
        """What is done here may be interrupted; a signal that came before does it at once."""
        self._armed += 1
        try:
            self.check()
            yield
        finally:
            self._armed -= 1


def once(_number: int, _frame: object) -> None:
    """A handler of signals: the first one interrupts, and no other changes how that ends."""
    for one in SIGNALS:
        signal.signal(one, signal.SIG_IGN)
    raise KeyboardInterrupt
