"""Trace files by python-can: ASC, BLF, candump logs, chosen by the file's suffix."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import can

from hw_bridge.wire.adapter import from_message, to_message
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.bus import Frame

READERS: dict[str, Callable[[Any], Iterable[can.Message]]] = {
    ".asc": can.ASCReader,
    ".blf": can.BLFReader,
    ".log": can.CanutilsLogReader,
}
SUFFIXES = tuple(READERS)


class TraceWriter:
    """Writer of the frames of one run. Times [ns] are the bus's own; only a header contains the date.

    `aside`: in a thread of its own, where a loop on the wall clock must not wait for compression or a disk. A disk that
    takes no more ends the trace, not the run: `close` returns why.
    """

    def __init__(self, path: Path, channel: str, aside: bool = False) -> None:
        self.path, self._problem, self._last = path, "", 0  # time of the last frame [ns]
        if path.suffix.lower() not in SUFFIXES:
            raise SimulationError(f"{path}: no trace format {path.suffix!r}. Use {', '.join(SUFFIXES)}.")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = can.Logger(path)
        except OSError as error:
            raise SimulationError(f"{path}: cannot be written: {error.strerror}. Choose another place.") from error
        if isinstance(self._writer, can.ASCWriter):
            self._writer.log_event("times count from 0", 0.0)  # else they count from the first frame
        if isinstance(self._writer, can.BLFWriter):
            self._writer.start_timestamp = 0.0
        if isinstance(self._writer, can.CanutilsLogWriter):
            self._writer.channel = channel
        self._queue: SimpleQueue[tuple[int, Frame | None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, name=f"trace {path.name}", daemon=True) if aside else None
        if self._thread is not None:
            self._thread.start()

    def write(self, time: int, frame: Frame | None) -> None:
        """Write a frame at a time; None is an error frame."""
        if self._thread is not None:
            self._queue.put((time, frame))
        else:
            self._write(time, frame)

    def _serve(self) -> None:
        while (item := self._queue.get()) is not None:
            self._write(*item)

    def _write(self, time: int, frame: Frame | None) -> None:
        if self._problem:
            return
        message = can.Message(is_error_frame=True) if frame is None else to_message(frame)
        message.timestamp, self._last = time / 1e9, time
        self._attempt(partial(self._writer.on_message_received, message))

    def _attempt(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # of the disk, or of what python-can's writer meets
            self._problem = self._problem or (
                f"{self.path}: cannot be written: {getattr(error, 'strerror', None) or error}. The trace is incomplete: it "
                f"ends before {self._last / 1e9:.3f} s."
            )

    def close(self) -> str:
        """Complete the file; return why it is incomplete, or an empty string."""
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join()
        self._attempt(self._writer.stop)
        return self._problem


def read(path: Path) -> Iterator[tuple[int, Frame | None, str]]:
    """Yield time [ns], frame, and a reason where there is none. SimulationError in one line for a broken file."""
    if not path.is_file():
        raise SimulationError(f"{path}: no such file. Name a trace ({', '.join(SUFFIXES)}).")
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise SimulationError(f"{path}: no trace format {path.suffix!r}. Use {', '.join(SUFFIXES)}.")
    if path.stat().st_size == 0:
        raise SimulationError(f"{path}: is empty. Record it anew.")
    count = 0
    try:
        with path.open("rb" if suffix == ".blf" else "r") as file:  # its readers do not close what they cannot parse
            messages = READERS[suffix](file)
            for message in messages:
                count += 1
                yield round(message.timestamp * 1e9), from_message(message), _why(message)
            _check_length(messages, path)
    except SimulationError:
        raise
    except Exception as error:  # python-can's readers raise whatever their parsing meets
        what = str(error) or type(error).__name__
        raise SimulationError(f"{path}: broken after {count} frames: {what}. Record it anew.") from error
    if not count:
        raise SimulationError(f"{path}: holds no frames, or is no {suffix} file. Record it anew.")


def _check_length(reader: object, path: Path) -> None:
    """Compare the size of a BLF file with its header; python-can reads to the end in any case."""
    if isinstance(reader, can.BLFReader) and reader.file_size > path.stat().st_size:
        raise EOFError("the file is shorter than its header says")


def _why(message: can.Message) -> str:
    """Name a message that CANopen does not use."""
    if message.is_error_frame:
        return "error frame"
    return "29-bit identifier" if message.is_extended_id else "CAN FD" if message.is_fd else "no CAN frame"
