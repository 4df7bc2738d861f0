"""Adapter to any python-can interface, and conversion of its messages."""

from __future__ import annotations

import errno
import importlib
import inspect
import logging
import re
import sys
import threading
from collections import deque
from contextlib import suppress
from typing import Any

import can
from can.interfaces import BACKENDS

from hw_bridge.bus import Frame
from twin.errors import SimulationError

# python-can's slcan looks at the time only after each wait for a byte, which is 1 ms long by default
OPTIONS: dict[str, dict[str, Any]] = {
    "slcan": {"timeout": 0.0002},
    # the kernel keeps frames with 29-bit identifiers away, which CANopen has not; others filter in Python: no gain
    "socketcan": {"can_filters": [{"can_id": 0, "can_mask": 0, "extended": False}]},
}
HIGHEST, LONGEST = 0x7FF, 8  # identifier of CAN 2.0A, bytes of a frame
BUS_OFF = 0x40  # CAN_ERR_BUSOFF of linux/can/error.h
CLOSING_TIME = 1.0  # a driver may wait without limit until an adapter has taken what is left to send [s]


def open_bus(interface: str, channel: str, bit_rate: int, options: dict[str, Any]) -> can.BusABC:
    """Open a python-can bus; a failure is a one-line SimulationError."""
    logging.getLogger("can").setLevel(logging.ERROR)  # what a half-opened bus says besides its error
    _check_options(interface, options)
    try:
        bus = can.Bus(
            **{**OPTIONS.get(interface, {}), **options, "channel": channel, "interface": interface, "bitrate": bit_rate}
        )
    except Exception as error:  # drivers of adapters raise whatever they meet
        what = " ".join(str(error).split()).rstrip(".!") or type(error).__name__
        if getattr(error, "errno", None) == errno.EAFNOSUPPORT:
            what = "SocketCAN is missing here. Use -i slcan, pcan or kvaser, or -i udp_multicast with twin drive"
        raise SimulationError(
            f"{interface} {channel}: cannot be opened: {what}. Check the interface's name, its driver and the adapter."
        ) from error
    if interface == "slcan" and sys.platform != "linux":  # there it is read without python-can
        bus.serialPortOrig = BufferedSerial(bus.serialPortOrig)  # type: ignore[attr-defined]
    return bus


def _check_options(interface: str, options: dict[str, Any]) -> None:
    """Refuse options that the interface does not have: python-can ignores them, so a misspelled port opens another bus."""
    if interface not in BACKENDS or not options:
        return
    module, name = BACKENDS[interface]
    try:
        constructor = getattr(importlib.import_module(module), name).__init__
        source = inspect.getsource(constructor)
    except Exception:  # its driver is missing: opening it says so
        return
    option_names = {*inspect.signature(constructor).parameters, "can_filters"}
    option_names.update(
        re.findall(r"""kwargs\W+(?:(?:get|pop)\W+)?["']([a-z]\w+)""", source)
    )  # options without a parameter
    if "timing" in option_names:  # python-can makes it of these
        option_names.update(inspect.signature(can.BitTiming).parameters)
    option_names -= {"self", "args", "kwargs", "channel", "bitrate"}
    for option in options:
        if option not in option_names:
            raise SimulationError(f"{interface}: no option {option!r}. Use one of {', '.join(sorted(option_names))}.")


def shut_down(bus: can.BusABC) -> None:
    """Shut the bus down within `CLOSING_TIME`; errors of an unplugged adapter are ignored."""
    if (
        sys.is_finalizing()
    ):  # no thread can start any more, and waiting for it would never end: the system closes the adapter
        return

    def close() -> None:
        with suppress(Exception):  # its driver raises whatever it meets
            bus.shutdown()

    thread = threading.Thread(target=close, daemon=True)
    thread.start()
    thread.join(CLOSING_TIME)


def cause(error: BaseException) -> str:
    """Describe a driver's error, with the system's error as its cause."""
    texts = [str(item) or type(item).__name__ for item in (error, error.__cause__) if item is not None]
    return ": ".join(dict.fromkeys(texts))


def from_message(message: can.Message) -> Frame | None:
    """Convert a python-can message; None for what CANopen does not use, or what no CAN frame can be."""
    if message.is_error_frame or message.is_extended_id or message.is_fd:
        return None
    if message.arbitration_id > HIGHEST or len(message.data) > LONGEST:  # of a serial line that garbles
        return None
    if message.is_remote_frame:
        return Frame(message.arbitration_id, remote=True, length=message.dlc)
    return Frame(message.arbitration_id, bytes(message.data))


def to_message(frame: Frame) -> can.Message:
    """Convert a frame to a python-can message."""
    dlc = frame.length if frame.remote else len(frame.data)
    return can.Message(
        arbitration_id=frame.id, data=frame.data, dlc=dlc, is_extended_id=False, is_remote_frame=frame.remote
    )


class BufferedSerial:
    """Serial port with a read buffer: single bytes are served from one system call.

    python-can's slcan reads each byte by itself: with a system call for each, three drives fill a cycle of 5 ms.
    """

    def __init__(self, port: Any) -> None:
        self.port = port
        self.bytes: deque[int] = deque()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.port, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("port", "bytes"):
            super().__setattr__(name, value)
        else:
            setattr(self.port, name, value)

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        return len(self.bytes) or self.port.in_waiting

    def read(self, _size: int = 1) -> bytes:
        """The next byte, or none within the port's timeout."""
        if not self.bytes:
            self.bytes.extend(self.port.read(max(self.port.in_waiting, 1)))
        return bytes((self.bytes.popleft(),)) if self.bytes else b""

    def reset_input_buffer(self) -> None:
        """Forget what was not read."""
        self.bytes.clear()
        self.port.reset_input_buffer()
