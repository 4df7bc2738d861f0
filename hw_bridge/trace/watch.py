"""What was on the bus of a run: the last of it is kept for the report, all of it goes to a trace if one is wanted."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia301
from hw_bridge.trace.decoder import Decoder, Line

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.bus import Frame, Network
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.wire import TraceWriter

KEPT = 20_000  # frames of the daily exchange that are kept: some 20 s of two drives at 5 ms
SHOWN = 30  # events of a run in its report


class Watch:
    """Hears a network with everything that this program sends. Decoding waits until the run is over."""

    def __init__(self, keys: HardwareKeys, network: Network, path: Path | None = None) -> None:
        self.keys = keys
        self.daily: deque[tuple[int, int, Frame | None]] = deque(maxlen=KEPT)  # time [ns], count, frame
        self.rare: deque[tuple[int, int, Frame | None]] = deque(maxlen=KEPT)
        self.count = 0
        self.writer: TraceWriter | None = None
        if path is not None:
            from hw_bridge.wire import TraceWriter

            self.writer = TraceWriter(path, keys.channel or "can0", aside=network.wall_clock)
        network.observe(self.hear)

    def hear(self, time: int, frame: Frame | None) -> None:
        """A frame, or an error frame, at a time [ns]."""
        self.count += 1
        often = frame is not None and (
            0x180 <= frame.id < 0x580 or frame.id == 0x080 or frame.id > cia301.ERROR_CONTROL
        )
        (self.daily if often else self.rare).append((time, self.count, frame))
        if self.writer is not None:
            self.writer.write(time, frame)

    def close(self) -> None:
        """Complete the trace."""
        if self.writer is not None:
            self.writer.close()

    def lines(self) -> list[Line]:
        """What is kept, with its meaning where it is more than the daily exchange."""
        decoder = Decoder.of_bench(self.keys, brief=True)
        kept = sorted((*self.daily, *self.rare), key=lambda one: one[:2])
        return [decoder.decode(time, sample) if sample is not None else decoder.error(time) for time, _, sample in kept]

    def seen(self, since: int) -> list[str]:
        """Events since a time [ns], counted from it in seconds; many error frames in a row are one line."""
        found: list[str] = []
        last, times = "", 0
        for line in self.lines():
            if line.time < since or not line.notable:
                continue
            text = f"{line.service} {line.text}"
            times = times + 1 if text == last else 1
            if times == 1:
                found.append(f"{(line.time - since) / 1e9:.6f} s: {text}")
            elif times == 2:
                found[-1] += " (again and again)"
            last = text
        if (earlier := len(found) - SHOWN) > 0:  # what ended the run is among the last
            return [f"before: {earlier} more", *found[-SHOWN:]]
        return found
