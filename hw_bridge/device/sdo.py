"""SDO server: expedited and segmented transfers; block transfer is answered with an abort, as the vendors do."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from hw_bridge.dictionary import Abort, Code, Dictionary

LARGEST = 889  # longest segmented transfer that is taken [bytes]


class Client(IntEnum):
    """Client commands, bits 7 to 5 of the first byte; 5 and 6 are block transfers."""

    DOWNLOAD_SEGMENT = 0
    DOWNLOAD = 1
    UPLOAD = 2
    UPLOAD_SEGMENT = 3
    ABORT = 4


@dataclass
class Transfer:
    """A segmented transfer under way; `announced` is 0 if the client did not tell the length."""

    index: int
    sub: int
    uploading: bool
    data: bytearray
    announced: int = 0
    toggle: int = 0


class SdoServer:
    """SDO server for one request at a time; a new one ends the current transfer."""

    def __init__(self, dictionary: Dictionary) -> None:
        self.dictionary = dictionary
        self.transfer: Transfer | None = None

    def answer(self, request: bytes) -> bytes | None:
        """Return the response to a request, or None where the protocol has none."""
        if len(request) != 8:
            return None
        command = request[0] >> 5
        if command == Client.ABORT:
            self.transfer = None
            return None
        index, sub = struct.unpack_from("<HB", request, 1)
        if command in (Client.DOWNLOAD_SEGMENT, Client.UPLOAD_SEGMENT):
            index, sub = (self.transfer.index, self.transfer.sub) if self.transfer else (0, 0)
        try:
            return self._carry_out(command, index, sub, request)
        except Abort as abort:
            self.transfer = None
            return struct.pack("<BHBI", 0x80, index, sub, abort.code)

    def _carry_out(self, command: int, index: int, sub: int, request: bytes) -> bytes:
        match command:
            case Client.DOWNLOAD:
                return self._download(index, sub, request)
            case Client.UPLOAD:
                return self._upload(index, sub)
            case Client.DOWNLOAD_SEGMENT:
                return self._download_segment(request)
            case Client.UPLOAD_SEGMENT:
                return self._upload_segment(request)
        raise Abort(Code.COMMAND_UNKNOWN)  # block transfers, and what CiA 301 does not know

    def _download(self, index: int, sub: int, request: bytes) -> bytes:
        self.transfer = None
        expedited, sized = request[0] & 0x02, request[0] & 0x01
        entry = self.dictionary.entry(index, sub)
        self.dictionary.check_writable(entry)
        if expedited:
            size = 4 - (request[0] >> 2 & 3) if sized else entry.type.size or 4
            self.dictionary.download(index, sub, request[4 : 4 + size])
        else:
            announced = struct.unpack_from("<I", request, 4)[0] if sized else 0
            if announced > LARGEST:
                raise Abort(Code.MEMORY)
            if sized and entry.type.size and announced != entry.type.size:
                raise Abort(Code.TOO_LONG if announced > entry.type.size else Code.TOO_SHORT)
            self.transfer = Transfer(index, sub, uploading=False, data=bytearray(), announced=announced)
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def _upload(self, index: int, sub: int) -> bytes:
        self.transfer = None
        data = self.dictionary.upload(index, sub)
        if 1 <= len(data) <= 4:
            return struct.pack("<BHB", 0x43 | (4 - len(data)) << 2, index, sub) + data.ljust(4, b"\0")
        self.transfer = Transfer(index, sub, uploading=True, data=bytearray(data))
        return struct.pack("<BHBI", 0x41, index, sub, len(data))

    def _next(self, request: bytes, uploading: bool) -> Transfer:
        transfer = self.transfer
        if transfer is None or transfer.uploading is not uploading:
            raise Abort(Code.COMMAND_UNKNOWN)
        if request[0] & 0x10 != transfer.toggle:
            raise Abort(Code.TOGGLE)
        transfer.toggle ^= 0x10
        return transfer

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._next(request, uploading=False)
        transfer.data += request[1 : 8 - (request[0] >> 1 & 7)]
        if len(transfer.data) > LARGEST:
            raise Abort(Code.MEMORY)
        if request[0] & 0x01:
            if transfer.announced and len(transfer.data) != transfer.announced:
                raise Abort(Code.TOO_LONG if len(transfer.data) > transfer.announced else Code.TOO_SHORT)
            self.dictionary.download(transfer.index, transfer.sub, bytes(transfer.data))
            self.transfer = None
        return bytes([0x20 | request[0] & 0x10]) + bytes(7)

    def _upload_segment(self, request: bytes) -> bytes:
        transfer = self._next(request, uploading=True)
        part, rest = bytes(transfer.data[:7]), transfer.data[7:]
        transfer.data = rest
        if not rest:
            self.transfer = None
        return bytes([request[0] & 0x10 | (7 - len(part)) << 1 | (not rest)]) + part.ljust(7, b"\0")
