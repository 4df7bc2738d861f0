"""Messages between the process of the loop and the one that shows it: JSON, one line each, over a socket pair.

The loop never waits for who listens: what is only told (`tell`) is dropped while older messages are still on their way.
"""

from __future__ import annotations

import json
import select
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import socket

MAX_RECEIVED = 16 << 20  # of what is taken in at once [byte]: more than the catalog of any system
MAX_QUEUED = 64 << 20  # that waits to be sent [byte]: more than the catalog of any system
CHUNK = 1 << 16


class ClosedError(Exception):
    """The other side is gone."""


class Channel:
    """One end."""

    def __init__(self, end: socket.socket) -> None:
        self.end = end
        end.setblocking(False)
        self._in = b""
        self._out = b""
        self._closed = False  # by the other side; what it said before is still taken in
        self._lock = threading.Lock()  # one thread listens, others send

    def send(self, **message: Any) -> None:
        """Send a message that must arrive, now or when there is room."""
        data = json.dumps(message, ensure_ascii=False).encode() + b"\n"
        with self._lock:
            if len(self._out) > MAX_QUEUED:
                raise ClosedError("nobody takes the messages")
            self._out += data
        self.flush()

    def send_droppable(self, **message: Any) -> bool:
        """Send a message whose successor will do as well; False if it was dropped."""
        self.flush()
        if self._out:
            return False
        self.send(**message)
        return True

    def flush(self) -> None:
        """Send what waits, as far as there is room."""
        with self._lock:
            while self._out:
                try:
                    self._out = self._out[self.end.send(self._out) :]
                except BlockingIOError:
                    return
                except OSError:
                    raise ClosedError from None

    def receive(self, timeout: float | None) -> list[dict[str, Any]]:
        """The messages that have come, after waiting at most `timeout` [s] for the first; None: until one comes."""
        waiting = [self.end] if self._out else []
        if not select.select([self.end], waiting, [], timeout)[0]:
            self.flush()
            return []
        while self._take():
            if len(self._in) > MAX_RECEIVED:
                raise ClosedError("a message is too long")
        *lines, self._in = self._in.split(b"\n")
        if not lines and self._closed:
            raise ClosedError
        return [message for line in lines if isinstance(message := json.loads(line), dict)]

    def _take(self) -> bool:
        """Take a piece of what has come; whether there may be more."""
        try:
            data = self.end.recv(CHUNK)
        except BlockingIOError:
            return False
        except OSError:
            data = b""
        self._in += data
        self._closed = not data
        return bool(data)
