"""Headers of Linux libraries: for which processor they are, and whether the file is as long as what is mapped of it."""

import platform
import struct

import pytest

from twin.fmi.importing import elf


def library(machine=0x3E, order=1, bits=2, segments=((1, 0, 100),), size=300, table=64, entry=56):
    """A library with segments (type, offset, length)."""
    head = b"\x7fELF" + bytes([bits, order]) + bytes(12) + struct.pack("<H", machine) + bytes(12)
    head += struct.pack("<Q", table) + bytes(14) + struct.pack("<HH", entry, len(segments)) + bytes(6)
    rows = b"".join(
        struct.pack("<IIQQQQ", kind, 0, offset, 0, 0, length) + bytes(16) for kind, offset, length in segments
    )
    return (head + rows).ljust(size, b"\0")


@pytest.fixture
def problem(tmp_path, monkeypatch):
    """What is wrong with a file on a machine."""

    def of(content, here="x86_64"):
        monkeypatch.setattr(platform, "machine", lambda: here)
        (tmp_path / "a.so").write_bytes(content)
        return elf.problem(tmp_path / "a.so")

    return of


# from the ELF specifications of the processors
MACHINES = {0x03: "i386", 0x28: "armv7l", 0x3E: "x86_64", 0xB7: "aarch64", 0xF3: "riscv64"}


@pytest.mark.parametrize("machine", MACHINES)
def test_processors(problem, machine):
    own = MACHINES[machine]
    assert problem(library(machine), own) == ""
    here = "x86_64" if own != "x86_64" else "aarch64"
    assert problem(library(machine), here) == f"is for {own}, this machine is {here}. Export the FMU for this machine."


def test_what_is_left_to_the_loader(problem):
    assert problem(library(0x1234)) == ""
    assert problem(b"MZ" + bytes(100)) == ""
    assert problem(library()[:63]) == ""
    assert problem(library(0x03, bits=1, segments=((1, 0, 9999),)), "i686") == ""  # tables of 32 bits are others
    assert problem(library(0x28), "armv6l") == ""


def test_another_order_of_bytes(problem):
    assert problem(library(order=2)) == "is for a processor with another order of bytes. Export the FMU for this one."


@pytest.mark.parametrize(
    ("options", "is_cut"),
    [
        ({"segments": ((1, 0, 300),)}, False),
        ({"segments": ((1, 0, 301),)}, True),
        ({"segments": ((1, 200, 101), (1, 0, 10))}, True),
        ({"segments": ((2, 0, 9999),)}, False),  # not mapped
        ({"segments": (), "table": 300}, False),
        ({"segments": (), "table": 301}, True),
        ({"segments": ((1, 0, 10),), "table": 245}, True),  # the table itself
    ],
)
def test_files_that_are_cut_off(problem, options, is_cut):
    assert problem(library(**options)) == ("is cut off. Get or build the FMU once more." if is_cut else "")
