"""Dead-man switch: an input moves while it is held, and goes to rest if the hold is not renewed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# From the last renewal to rest [s]. With a block of the loop, 1/30 s, and what the network takes it stays below 200 ms; a
# page renews every 30 to 40 ms, so three may be lost.
HOLD = 0.14
SIMULATED_HOLD = 0.5  # without drives, where nothing can be damaged and a busy computer must not end each motion [s]
FOREVER = float("inf")
EXPIRED = "expired"  # kind of the executed command of an input that was not renewed in time


@dataclass
class HeldInput:
    """State of an input with a dead-man switch. `until`: end of the hold; `over`: last press that ended without a release."""

    rest: Any
    value: Any
    press: int = -1
    until: float = FOREVER
    over: int = -1

    @property
    def moves(self) -> bool:
        """Whether the input is not at rest."""
        return bool(self.value != self.rest)


class DeadManSwitch:
    """The dead-man switches of all inputs, on a monotonic clock [s]. `longest`: time from a renewal to rest."""

    def __init__(self, longest: float = HOLD) -> None:
        self.longest = longest
        self.inputs: dict[str, HeldInput] = {}

    def hold(self, name: str, value: Any, rest: Any, press: int, age: float, now: float) -> bool:
        """Apply a renewal that is `age` [s] old; return False if it is too old or its press is over."""
        held = self.inputs.setdefault(name, HeldInput(rest, rest))
        if age >= self.longest or press <= held.over:
            return False
        held.value, held.press, held.until = value, press, now - max(age, 0.0) + self.longest
        return True

    def end_press(self, name: str, rest: Any, press: int) -> None:
        """Move an input to rest; this press moves it no more."""
        self.inputs.setdefault(name, HeldInput(rest, rest)).press = press
        self.release_hold(name)

    def release_hold(self, name: str = "") -> None:
        """Move one input, or all, to rest and end the press."""
        for held in [self.inputs[name]] if name in self.inputs else [] if name else self.inputs.values():
            held.over, held.value, held.until = max(held.over, held.press), held.rest, FOREVER

    def expire(self, now: float) -> list[str]:
        """Release holds that were not renewed in time; return the names of inputs that moved."""
        expired = [name for name, held in self.inputs.items() if held.until <= now]
        moved = [name for name in expired if self.inputs[name].moves]
        for name in expired:
            self.release_hold(name)
        return moved

    @property
    def deadline(self) -> float:
        """Earliest end of a hold that is not renewed."""
        return min((held.until for held in self.inputs.values()), default=FOREVER)
