"""Messages of several sources in one queue, in the order of their arrival: each source is read by a thread of its own."""

from __future__ import annotations

import queue
import threading
from typing import TYPE_CHECKING, Self

from twin.errors import SimulationError
from twin.follow.sources.message import Message, now

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.follow.sources.message import Source

POLL = 0.1  # longest wait of a thread, after which it sees that it has to end [s]


class Inbox:
    """Queue of messages. Use it with `with`: the sources are closed at the end."""

    def __init__(self, sources: Mapping[str, Source]) -> None:
        self.sources = sources
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._end = threading.Event()
        self._threads = [
            threading.Thread(target=self._read, args=item, name=item[0], daemon=True) for item in sources.items()
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        for thread in self._threads:
            thread.join()
        for source in self.sources.values():
            source.close()

    def _read(self, name: str, source: Source) -> None:
        while not self._end.is_set():
            try:
                for message in source.receive(POLL):
                    self._messages.put(message)
            except SimulationError as error:
                self._messages.put(Message(name, now(), problem=str(error)))
                return

    def take(self, timeout: float) -> list[Message]:
        """Return all messages that have arrived; wait up to `timeout` [s] for the first one."""
        return drained(self._messages, timeout)


def drained(messages: queue.SimpleQueue[Message], timeout: float) -> list[Message]:
    """Return all messages of a queue; wait up to `timeout` [s] for the first one."""
    taken: list[Message] = []
    try:
        taken.append(messages.get(timeout=timeout))
        while True:
            taken.append(messages.get_nowait())
    except queue.Empty:
        return taken
