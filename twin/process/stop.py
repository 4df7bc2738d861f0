"""Signal handling: the first termination signal stops the run in order; further ones are ignored."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn, Self

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK")
SIGNALS = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
SAME_INSTANT = "ignored due to race condition"  # of Python, for a signal that is ignored since another one was handled
RETRY = 0.01  # period of interrupts after one that Python ignored [s]


class Stop:
    """Context manager: the first signal raises KeyboardInterrupt inside `armed` blocks and is only stored elsewhere.

    On exit, a signal that would have killed the process does so; a surrounding `Stop` takes it over; where a command was
    interrupted (`once`), further signals are ignored. No-op outside of the main thread.

    `notify`: called in the signal handler for each signal, also of a `Stop` inside this one.
    """

    def __init__(self, notify: Callable[[], object] = bool) -> None:
        self.notify = notify
        self.number = 0  # the first signal that came
        self._armed = 0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        self._hook = sys.unraisablehook
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        handler, surrounding = self._before.get(self.number), self._surrounding(self.number)
        for number, previous in self._before.items():
            signal.signal(number, signal.SIG_IGN if handler is once else previous)
        sys.unraisablehook = self._hook
        if surrounding is not None:
            surrounding.number = surrounding.number or self.number
        elif handler is signal.SIG_DFL:
            signal.raise_signal(self.number)

    def _surrounding(self, number: int) -> Stop | None:
        owner = getattr(self._before.get(number), "__self__", None)
        return owner if isinstance(owner, Stop) else None

    def _on_signal(self, number: int, _frame: object) -> None:
        stop: Stop | None = self
        while stop is not None:
            stop.notify()
            stop = stop._surrounding(number)
        first, self.number = not self.number, self.number or number
        if first and self._armed:
            interrupt(self.check)

    def check(self) -> None:
        """Raise KeyboardInterrupt again if native frames or a callback swallowed it."""
        if self.number and self._armed:
            raise KeyboardInterrupt

    @contextmanager
    def armed(self) -> Iterator[None]:
        """Allow interrupts in the block; a signal that came before interrupts at once."""
        self._armed += 1
        try:
            self.check()
            yield
        finally:
            self._armed -= 1


def once(_number: int, _frame: object) -> None:
    """Signal handler: the first signal raises KeyboardInterrupt, further ones are ignored."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    interrupt(once_more)


def once_more() -> NoReturn:
    """Raise an interrupt again that Python ignored."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def is_interrupted() -> bool:
    """Whether `once` has handled a signal."""
    return signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def handle_signals() -> None:
    """Install `once` for the process of a command; signals that are ignored already stay ignored.

    Exceptions are SIGINT and SIGTERM, which a script's background jobs would ignore: a command that may move a machine must
    be stoppable.
    """
    for number in SIGNALS:
        if number in (signal.SIGINT, signal.SIGTERM) or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, once)


def interrupt(retry: Callable[[], object]) -> NoReturn:
    """Raise KeyboardInterrupt in a signal handler.

    Python prints and ignores exceptions in callbacks, such as those of weak references, and in the hook below. In that case
    `retry` is called in a signal handler a moment later. Further signals of the same instant are ignored without a message.
    """
    before = sys.unraisablehook

    def ignored(unraisable: Any) -> None:
        if unraisable.exc_type is OSError and SAME_INSTANT in str(unraisable.exc_value):
            return
        if unraisable.exc_type is not KeyboardInterrupt:
            before(unraisable)
            return
        has_returned, is_done = threading.Event(), threading.Event()

        def again(_number: int, _frame: object) -> None:
            if has_returned.is_set() and not is_done.is_set():
                is_done.set()
                retry()

        signal.signal(signal.SIGINT, again)
        threading.Thread(target=repeat_interrupt, args=(is_done,), daemon=True).start()
        has_returned.set()

    sys.unraisablehook = ignored
    raise KeyboardInterrupt


def repeat_interrupt(is_done: threading.Event) -> None:
    """Interrupt the main thread until `is_done`: a busy machine may still be in the hook when the first one comes."""
    while not is_done.wait(RETRY):
        interrupt_main_thread()


def interrupt_main_thread() -> None:
    """Send SIGINT to the main thread; a real signal, where available, ends blocking calls."""
    if hasattr(signal, "pthread_kill") and (number := threading.main_thread().ident) is not None:
        signal.pthread_kill(number, signal.SIGINT)
    else:
        _thread.interrupt_main()
