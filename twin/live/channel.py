"""Messages between the process of the loop and the process of the page: JSON lines over a socket pair.

The loop never waits for its peer: droppable messages (`send_droppable`) are discarded while older ones are queued.
"""

from __future__ import annotations

import json
import select
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import socket

MAX_RECEIVED = 16 << 20  # of unprocessed input [byte]: more than the catalog of any system
MAX_QUEUED = 64 << 20  # of queued output [byte]: more than the catalog of any system
CHUNK = 1 << 16


class ClosedError(Exception):
    """The peer has closed the channel."""


class Channel:
    """One end of the socket pair."""

    def __init__(self, end: socket.socket) -> None:
        self.end = end
        end.setblocking(False)
        self._in = b""
        self._out = b""
        self._closed = False  # by the peer; earlier messages are still delivered
        self._lock = threading.Lock()  # one thread receives, others send

    def send(self, **message: Any) -> None:
        """Send a message that must arrive: now, or when the socket accepts it."""
        data = json.dumps(message, ensure_ascii=False).encode() + b"\n"
        with self._lock:
            if len(self._out) > MAX_QUEUED:
                raise ClosedError("the peer does not read its messages")
            self._out += data
        self.flush()

    def send_droppable(self, **message: Any) -> bool:
        """Send a message that a later one replaces; return False if it was dropped."""
        self.flush()
        if self._out:
            return False
        self.send(**message)
        return True

    def flush(self) -> None:
        """Send queued messages as far as the socket accepts them."""
        with self._lock:
            while self._out:
                try:
                    self._out = self._out[self.end.send(self._out) :]
                except BlockingIOError:
                    return
                except OSError:
                    raise ClosedError from None

    def receive(self, timeout: float | None) -> list[dict[str, Any]]:
        """Return the received messages after waiting at most `timeout` [s] for the first; None: without limit."""
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
