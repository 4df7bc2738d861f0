"""What checks of all rules share: requests of a master, and process data of one PDO alone."""

import struct

import pytest

from tests.hw_bridge.bench import AbortedError

SAVE, LOAD = 0x65766173, 0x64616F6C
ERROR = {
    "faulhaber_v3": 0x7300,
    "mclm": 0x4310,
    "epos4": 0x7320,
}  # of the sensor, of temperature: does not end by itself
INVALID = 1 << 31


def abort(act, *arguments):
    """The code with which a request is refused."""
    with pytest.raises(AbortedError) as found:
        act(*arguments)
    return found.value.code


def silent(bench, identifier, data, answer):
    """Whether a frame has no answer."""
    bench.frames(answer)
    bench.send(identifier, data)
    bench.go(5)
    return bench.frames(answer) == []


def alone(bench, kind, number):
    """PDO 1, 2 ... alone and invalid, with nothing mapped: all others are off."""
    start = {"rpdo": 0x1400, "tpdo": 0x1800}[kind]
    for one in range(4):
        identifier = bench.read(start + one, 1)
        bench.write(start + one, identifier | INVALID, 1)
    bench.write(start + 0x200 + number - 1, 0)
    return start + number - 1, bench.read(start + number - 1, 1)


def mapped(bench, kind, number, words, transmission):
    """A PDO with these objects and this transmission type, in use; its identifier."""
    index, identifier = alone(bench, kind, number)
    for place, word in enumerate(words, 1):
        bench.write(index + 0x200, word, place)
    bench.write(index + 0x200, len(words))
    bench.write(index, transmission, 2)
    bench.write(index, identifier & ~INVALID, 1)
    return identifier & 0x7FF


def valued(bench, index):
    """A value of an object of the application that differs from its default."""
    entry = bench.drive.dictionary.entry(index)
    return entry.default + 1 if entry.high is None or entry.default < entry.high else entry.default - 1


def segmented(bench, index, sub=0):
    """Text by a segmented upload."""
    answer = bench.sdo(struct.pack("<BHB", 0x40, index, sub))
    if answer[0] & 2:
        return answer[4 : 8 - (answer[0] >> 2 & 3)]
    size, data, toggle = struct.unpack_from("<I", answer, 4)[0], b"", 0
    while True:
        answer = bench.sdo(bytes([0x60 | toggle]))
        assert answer[0] & 0xF0 == toggle
        data += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 0x10
        if answer[0] & 1:
            assert len(data) == size
            return data
