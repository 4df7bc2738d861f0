"""A CAN bus with the drives of a hardware file: their process data, decoded. Nothing is ever sent to the bus."""

from __future__ import annotations

from pathlib import Path

from twin.follow.sources.messages import Message
from twin.run import load_hardware


class BusSource:
    """Values `MEMBER.object` of a hardware file's drives, such as `servomotor.position_actual_value`, stamped at their arrival."""

    def __init__(self, name: str, file: str) -> None:
        self.name = name
        self.listener = load_hardware(Path(file), False, Path()).listen()

    def receive(self, timeout: float) -> list[Message]:
        """Return the decoded frames that have arrived."""
        return [Message(self.name, arrival, arrival, values) for arrival, values in self.listener.receive(timeout)]

    def close(self) -> None:
        """Leave the bus."""
        self.listener.close()
