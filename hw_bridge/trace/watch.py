"""Bus monitor of a run: the last frames for the report, all of them for a trace file if requested."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia301
from hw_bridge.trace.decoder import DecodedFrame, Decoder

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.bus import Frame, Network
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.wire import TraceWriter

HISTORY_LENGTH = 20_000  # frames of the daily exchange that are kept: some 20 s of two drives at 5 ms
SHOWN = 30  # events of a run in its report


class Watch:
    """Monitor of a network, including frames of this program. Frames are decoded after the run."""

    def __init__(self, keys: HardwareKeys, network: Network, path: Path | None = None) -> None:
        self.keys = keys
        self.daily: deque[tuple[int, int, Frame | None]] = deque(maxlen=HISTORY_LENGTH)  # time [ns], count, frame
        self.rare: deque[tuple[int, int, Frame | None]] = deque(maxlen=HISTORY_LENGTH)
        self.count = 0
        self.writer: TraceWriter | None = None
        if path is not None:
            from hw_bridge.wire import TraceWriter

            self.writer = TraceWriter(path, keys.channel or "can0", aside=network.wall_clock)
        network.observe(self.hear)

    def hear(self, time: int, frame: Frame | None) -> None:
        """Record a frame, or an error frame, at a time [ns]."""
        self.count += 1
        often = frame is not None and (
            0x180 <= frame.id < 0x580 or frame.id == 0x080 or frame.id > cia301.ERROR_CONTROL
        )
        (self.daily if often else self.rare).append((time, self.count, frame))
        if self.writer is not None:
            self.writer.write(time, frame)

    def close(self) -> str:
        """Complete the trace; return why it is incomplete, or an empty string."""
        return self.writer.close() if self.writer is not None else ""

    def lines(self) -> list[DecodedFrame]:
        """Decode the recorded frames."""
        decoder = Decoder.of_bench(self.keys, brief=True)
        frames = sorted((*self.daily, *self.rare), key=lambda item: item[:2])
        return [
            decoder.decode(time, sample) if sample is not None else decoder.error(time) for time, _, sample in frames
        ]

    def events(self, since: int) -> list[str]:
        """Notable events since a time [ns], with seconds since then; repeated error frames are one line."""
        events: list[str] = []
        last, times = "", 0
        for line in self.lines():
            if line.time < since or not line.notable:
                continue
            text = f"{line.service} {line.text}"
            times = times + 1 if text == last else 1
            if times == 1:
                events.append(f"{(line.time - since) / 1e9:.6f} s: {text}")
            elif times == 2:
                events[-1] += " (again and again)"
            last = text
        if (earlier := len(events) - SHOWN) > 0:  # what ended the run is among the last
            return [f"before: {earlier} more", *events[-SHOWN:]]
        return events
