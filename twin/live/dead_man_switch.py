"""Dead-man switch: an input moves while it is held, and goes to rest if the hold is not renewed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# From the last renewal to rest [s]. With a block of the loop, 1/30 s, and what the network takes it stays below 200 ms; a
# page renews every 30 to 40 ms, so three may be lost.
HOLD = 0.14
FOREVER = float("inf")


@dataclass
class HeldInput:
    """A held input. `until`: wall-clock time of its end; `over`: the press that ended without being let go."""

    rest: Any
    value: Any
    press: int = -1
    until: float = FOREVER
    over: int = -1

    @property
    def moves(self) -> bool:
        """Whether it is not at rest."""
        return bool(self.value != self.rest)


class DeadManSwitch:
    """All inputs that are held. Times are those of a clock that only rises [s]; `longest`: from a renewal to rest."""

    def __init__(self, longest: float = HOLD) -> None:
        self.longest = longest
        self.inputs: dict[str, HeldInput] = {}

    def hold(self, name: str, value: Any, rest: Any, press: int, age: float, now: float) -> bool:
        """A renewal that is `age` [s] old; whether it counts: not if it is too old, nor of a press that is over."""
        one = self.inputs.setdefault(name, HeldInput(rest, rest))
        if age >= self.longest or press <= one.over:
            return False
        one.value, one.press, one.until = value, press, now - max(age, 0.0) + self.longest
        return True

    def release_hold(self, name: str = "") -> None:
        """To rest, one input or all; the press is over."""
        for one in [self.inputs[name]] if name in self.inputs else [] if name else self.inputs.values():
            one.over, one.value, one.until = max(one.over, one.press), one.rest, FOREVER

    def expire(self, now: float) -> list[str]:
        """Let go of what was not renewed in time; its names, those that moved."""
        expired = [name for name, one in self.inputs.items() if one.until <= now]
        moved = [name for name in expired if self.inputs[name].moves]
        for name in expired:
            self.release_hold(name)
        return moved

    @property
    def deadline(self) -> float:
        """When the next one ends that is not renewed."""
        return min((one.until for one in self.inputs.values()), default=FOREVER)
