"""Archives of FMUs: whatever is wrong with them ends in one line, and nothing is left behind."""

import random
import stat
import struct
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fmi.third_party import NATIVE_XML, archive
from twin.coupling import MemberVariable
from twin.errors import FMUError
from twin.fmi import FMUMember, unpack, values, xml_checks
from twin.fmi import archive as archives
from twin.fmi.fmi_version import FMI3
from twin.fmi.importing.elf import problem

BINARY = "binaries/x86_64-linux/Native.so"
GOOD = {"modelDescription.xml": NATIVE_XML.encode(), BINARY: b"\x7fELF" + bytes(100), "resources/a.txt": b"a" * 5000}


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for temporary files, which must be empty again at the end."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []
    assert {path.name for path in tmp_path.iterdir()} <= {"temporary", "fmu.fmu"}


def refused(path: Path, words: str) -> None:
    with pytest.raises(FMUError, match=words) as caught:
        FMUMember("part", path).close()
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message


def test_unpack(tmp_path: Path, temporary: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    with unpack(path) as unpacked:
        assert (unpacked.folder / "resources/a.txt").read_bytes() == b"a" * 5000
        assert unpacked.binary.is_file()
        assert unpacked.fmi == FMI3
        assert unpacked.folder.is_relative_to(temporary)
    unpacked.close()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../evil.txt", "leads out"),
        ("resources/../../evil.txt", "leads out"),
        ("/tmp/evil.txt", "absolute"),
        ("//evil.txt", "absolute"),
        ("C:/evil.txt", "drive letter"),
        ("resources\\evil.txt", "backslash"),
        ("..\\evil.txt", "backslash"),
        ("a\x1fb", "control"),
        ("a\x7fb", "control"),
        ("ModelDescription.XML", "same file"),
        ("./resources/a.txt", "same file"),
        ("resources/a.txt/b", "cannot be unpacked"),
        ("x" * 300, "cannot be unpacked"),
    ],
)
def test_names(tmp_path: Path, name: str, words: str) -> None:
    refused(archive(tmp_path / "fmu.fmu", {**GOOD, name: b"evil"}), words)


def test_names_may_have_spaces_and_any_letters(tmp_path: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", {**GOOD, "resources/a b\x80é.txt": b"good"})
    with unpack(path) as unpacked:
        assert (unpacked.folder / "resources/a b\x80é.txt").read_bytes() == b"good"


def test_duplicate(tmp_path: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    with zipfile.ZipFile(path, "a") as zipped, pytest.warns(UserWarning, match="Duplicate"):
        zipped.writestr("resources/a.txt", b"other")
    refused(path, "same file")


def test_the_same_file_twice_is_one(tmp_path: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    with zipfile.ZipFile(path, "a") as zipped, pytest.warns(UserWarning, match="Duplicate"):
        zipped.writestr("resources/a.txt", GOOD["resources/a.txt"])
    with unpack(path) as found:
        assert (found.folder / "resources/a.txt").read_bytes() == GOOD["resources/a.txt"]


def elf(machine: int = 0x3E, order: int = 1, length: int = 0x100) -> bytes:
    """A library with one segment of this length."""
    head = struct.pack("<4sBBB9xHHIQQQIHHHHHH", b"\x7fELF", 2, order, 1, 3, machine, 1, 0, 64, 0, 0, 64, 56, 1, 0, 0, 0)
    return head + struct.pack("<IIQQQQQQ", 1, 5, 0, 0, 0, length, length, 4096)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (elf(length=10**6), "is cut off"),  # loading it would end the process
        (elf()[:100], "is cut off"),
        (elf(machine=0xB7), "is for aarch64, this machine is x86_64"),
        (elf(machine=0x28), "is for armv7l"),
        (elf(order=2), "another order of bytes"),
    ],
)
def test_a_library_that_cannot_be_loaded_is_not_tried(tmp_path: Path, content: bytes, words: str) -> None:
    member = FMUMember("part", archive(tmp_path / "fmu.fmu", {**GOOD, BINARY: content}))
    with pytest.raises(FMUError, match=words):
        member.instantiate()
    member.close()


@given(st.binary(max_size=300), st.integers(0, 300))
def test_any_head_of_a_library_is_read(data: bytes, cut: int) -> None:
    with tempfile.NamedTemporaryFile() as file:
        file.write((elf()[: min(cut, 120)] + data)[:300])
        file.flush()
        assert isinstance(problem(Path(file.name)), str)


def test_only_what_a_run_needs_is_unpacked(tmp_path: Path) -> None:
    more = dict.fromkeys(("sources/a.c", "documentation/index.html", "binaries/win64/a.dll", BINARY + ".1"), b"x")
    with unpack(archive(tmp_path / "fmu.fmu", {**GOOD, **more})) as found:
        names = {str(file.relative_to(found.folder)) for file in found.folder.rglob("*") if file.is_file()}
    assert names == {*GOOD, BINARY + ".1"}


def test_many_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xml_checks, "VARIABLES", 2)
    refused(archive(tmp_path / "fmu.fmu", GOOD), "variables, more than 2")


@pytest.mark.parametrize("value", ["", "[]", [], np.zeros(0)])
def test_an_array_may_be_empty(value: object) -> None:
    variable = MemberVariable("u", "input", "continuous", "Float64", np.dtype(float), (0,))
    assert values.array(variable, value, {}, "x").shape == (0,)


@pytest.mark.parametrize(("mode", "words"), [(stat.S_IFLNK, "symbolic link"), (stat.S_IFIFO, "not a plain file")])
def test_links(tmp_path: Path, mode: int, words: str) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    info = zipfile.ZipInfo("resources/link")
    info.external_attr = (mode | 0o777) << 16
    with zipfile.ZipFile(path, "a") as zipped:
        zipped.writestr(info, "/etc/passwd")
    refused(path, words)


def test_compression(tmp_path: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_BZIP2) as zipped:
        zipped.writestr("resources/b.txt", b"b")
    refused(path, "deflate")


def test_encrypted(tmp_path: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    content = bytearray(path.read_bytes())
    content[content.rindex(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(content)
    refused(path, "encrypted")


def test_bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = archive(tmp_path / "fmu.fmu", {**GOOD, "resources/zeros": bytes(8 << 20)})
    monkeypatch.setattr(archives, "HARMLESS", 1 << 20)
    refused(path, "unpacks to more than")


def test_claimed_size(tmp_path: Path) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    content = bytearray(path.read_bytes())
    struct.pack_into("<I", content, content.rindex(b"PK\x01\x02") + 24, 3 << 30)
    path.write_bytes(content)
    refused(path, "unpacks to 3072 MiB")


def test_many_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archives, "FILES", 2)
    refused(archive(tmp_path / "fmu.fmu", GOOD), "3 files")


def test_large_description(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archives, "DESCRIPTION", 100)
    refused(archive(tmp_path / "fmu.fmu", GOOD), "is larger than")


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({}, "no modelDescription"),
        ({"model/modelDescription.xml": b""}, "zip the content of that folder"),
        ({"modelDescription.xml": NATIVE_XML.encode()}, "no binaries, none for x86_64-linux"),
        (
            {
                "modelDescription.xml": NATIVE_XML.encode(),
                "binaries/x86_64-windows/Native.dll": b"",
                "sources/a.c": b"",
            },
            "has no sources/buildDescription.xml",
        ),
        ({"modelDescription.xml": NATIVE_XML.encode(), "binaries/x86_64-linux/Other.so": b""}, "is missing"),
    ],
)
def test_content(tmp_path: Path, files: dict[str, bytes], words: str) -> None:
    refused(archive(tmp_path / "fmu.fmu", files), words)


def test_no_archive(tmp_path: Path) -> None:
    path = tmp_path / "fmu.fmu"
    refused(path, "is not there")
    refused(tmp_path, "is a folder")
    refused(Path("/dev/null"), "is a pipe, a socket or a device")
    path.write_text("no zip")
    refused(path, "not a zip")
    path.write_bytes(b"")
    refused(path, "not a zip")


LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
FILE = '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
HEAD = "<fmiModelDescription"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("</ModelVariables>", "", "not well-formed"),
        (HEAD, LAUGHS + HEAD, "document type"),
        (HEAD, FILE + HEAD, "document type"),
        (HEAD, "<!DOCTYPE fmiModelDescription>" + HEAD, "document type"),
        ("fmiModelDescription", "modelDescription", "root <modelDescription>"),
        ('fmiVersion="3.0"', 'fmiVersion="1.0"', "is of FMI 1.0 and for Model Exchange only"),
        ('fmiVersion="3.0"', 'fmiVersion="3.1"', "is for FMI 3.1"),
        ('fmiVersion="3.0"', "", "does not say for which"),
        ("<CoSimulation", "<Other", "names no interface"),
        ('modelIdentifier="Native"', "", "modelIdentifier ''"),
        ('modelIdentifier="Native"', 'modelIdentifier="../../etc/x"', "not the name of a library"),
        (' instantiationToken="native"', "", "no instantiationToken"),
        ("ModelVariables>", "Variables>", "no <ModelVariables>"),
        ('name="limit"', "", "line 15: a variable has no name"),
        ('name="limit"', 'name="x"', "'x' is there twice, first in line 8"),
        ('name="limit"', 'name="y_seen"', "'y_seen' is there twice"),
        ('valueReference="4"', 'valueReference="four"', "value reference 'four'"),
        ('valueReference="4"', 'valueReference="4294967296"', "value reference '4294967296'"),
        ('valueReference="4"', "", "value reference None"),
        ('valueReference="4"', 'valueReference="3"', "of another variable"),
        ('<Int32 name="mode"', '<Complex name="mode"', "'mode' has no known type"),
        ('start="2"', 'start="two"', "'n', which starts with no whole number"),
        ('start="2"', "", "'n', which starts with no whole number"),
        ('start="2"', 'start="999999999999"', "999999999999 elements"),
        ('<Dimension valueReference="1"/>', '<Dimension valueReference="77"/>', "refers to no variable"),
        ('<Dimension valueReference="1"/>', '<Dimension start="-3"/>', "dimension '-3'"),
        ('<Dimension valueReference="1"/>', "<Dimension/>", "refers to no variable"),
        ('<Output valueReference="3"/>', '<Output valueReference="99"/>', "cannot be read"),
        ('<Output valueReference="3"/>', "<Output/>", "cannot be read"),
        ('dependencies="5"', 'dependencies="5 x"', "cannot be read"),
        ('causality="input"', 'causality="nonsense"', "cannot be read"),
        ('start="1 2"', 'start="1 two"', "x is a number, not 'two'"),
        (
            '<Int32 name="mode" valueReference="7" causality="input" start="0"',
            '<Int32 name="mode" valueReference="7" causality="input" start="99999999999"',
            "out of range",
        ),
        ('value="00ff"', 'value="xyz"', "is Binary"),
        ('stepSize="0.1"', 'stepSize="fast"', "stepSize='fast'"),
        ('<Int32 name="mode"', '<Int32 declaredType="Gone" name="mode"', "declaredType=.Gone."),
        (
            '<Float64 name="limit" valueReference="4" causality="parameter" variability="fixed" start="1e9"/>',
            '<Clock name="limit" valueReference="4" causality="input" intervalVariability="triggered" shiftDecimal="x"/>',
            "clock 'limit'",
        ),
        (
            '<Float64 name="limit" valueReference="4" causality="parameter" variability="fixed" start="1e9"/>',
            '<Clock name="limit" valueReference="4"/><Int32 name="i" valueReference="8" clocks="9"/>',
            "there is no clock 9",
        ),
    ],
)
def test_description(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in NATIVE_XML
    xml = NATIVE_XML.replace(old, new)
    if old == "<CoSimulation":
        xml = xml.replace(' canHandleVariableCommunicationStepSize="true"', "")
    refused(archive(tmp_path / "fmu.fmu", {**GOOD, "modelDescription.xml": xml.encode()}), words)


def test_blanks_in_lists(tmp_path: Path) -> None:
    xml = NATIVE_XML.replace('dependencies="5"', 'dependencies=" 5  7\n"')
    member = FMUMember("part", archive(tmp_path / "fmu.fmu", {**GOOD, "modelDescription.xml": xml.encode()}))
    member.close()
    assert member.variables["echo"].dependencies == ("data", "mode")
    assert member.variables["y"].dependencies is None


def test_no_library(tmp_path: Path) -> None:
    member = FMUMember("part", archive(tmp_path / "fmu.fmu", GOOD))
    with pytest.raises(FMUError, match="Failed to load shared library"):
        member.instantiate()
    member.close()
    member.close()


def opened_or_refused(path: Path) -> None:
    message = ""
    try:
        FMUMember("part", path).close()
    except FMUError as error:
        message = str(error)
    assert "\n" not in message


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), flips=st.integers(0, 20), cut=st.one_of(st.none(), st.floats(0, 1)))
def test_damaged(tmp_path: Path, temporary: Path, seed: int, flips: int, cut: float | None) -> None:
    path = archive(tmp_path / "fmu.fmu", GOOD)
    content = bytearray(path.read_bytes())
    chance = random.Random(seed)
    for _ in range(flips):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content if cut is None else content[: int(cut * len(content))])
    opened_or_refused(path)
    assert list(temporary.iterdir()) == []


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), count=st.integers(1, 6))
def test_damaged_description(tmp_path: Path, seed: int, count: int) -> None:
    chance = random.Random(seed)
    xml = bytearray(NATIVE_XML.encode())
    for _ in range(count):
        xml[chance.randrange(len(xml))] = chance.choice(b'<>"/ =0129azAZ&;\x00\xff')
    path = archive(tmp_path / "fmu.fmu", {**GOOD, "modelDescription.xml": bytes(xml)})
    opened_or_refused(path)


def test_what_a_server_loads_is_unpacked_too(tmp_path: Path) -> None:
    served = {
        **GOOD,
        "binaries/x86_64-windows/Native.dll": b"theirs",
        "binaries/x86_64-windows/server_tcp.exe": b"server",
        "binaries/aarch64-linux/Native.so": b"nobody's",
        "documentation/index.html": b"long",
    }
    with unpack(archive(tmp_path / "fmu.fmu", served)) as unpacked:
        found = {path.relative_to(unpacked.folder).as_posix() for path in unpacked.folder.rglob("*") if path.is_file()}
        assert found == served.keys() - {"binaries/aarch64-linux/Native.so", "documentation/index.html"}
        assert (unpacked.folder / "binaries/x86_64-windows/server_tcp.exe").stat().st_mode & stat.S_IXUSR
