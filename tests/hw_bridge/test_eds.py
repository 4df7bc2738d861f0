"""Object dictionaries as EDS files: there and back, and readable for canopen."""

import os
import re

import pytest
from canopen.objectdictionary import import_od
from click.testing import CliRunner

from hw_bridge import eds
from hw_bridge.command import drive
from hw_bridge.dictionary import OCTETS, NodeId, State
from hw_bridge.plant import plant
from hw_bridge.profiles import DRIVE_PROFILES, profile
from tests.every_case import every_case
from tests.hw_bridge.axis import Rig, wire_other_drive
from tests.hw_bridge.bridge.test_bridge import NODES
from twin.errors import DeclarationError


def place(entry):
    return entry.index, entry.sub


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_round_trip(name, tmp_path):
    path = tmp_path / "drive.eds"
    path.write_text(eds.export(profile(name)))
    loaded = sorted(eds.load(path), key=place)
    assert loaded == sorted(profile(name).objects, key=place)
    assert any(isinstance(entry.default, NodeId) for entry in loaded)
    theirs = import_od(str(path), 5)
    assert theirs[0x1400][1].default == 0x205
    assert theirs["Controlword"].index == 0x6040


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_tables_are_sound(name):
    """Defaults lie in their ranges, default mappings name objects that can be mapped, subindex 0 tells the highest."""
    objects = profile(name).objects
    by_place = {place(entry): entry for entry in objects}
    assert len(by_place) == len(objects)
    for entry in objects:
        entry.encode(entry.default)
        entry.check(entry.default)
        if entry.title and entry.sub == 0 and not 0x1600 <= entry.index < 0x1C00 and entry.index != 0x1003:
            assert entry.default == max(other.sub for other in objects if other.index == entry.index)
        if 0x1600 <= entry.index < 0x1C00 and not 0x1800 <= entry.index < 0x1A00 and entry.sub and entry.default:
            mapped = by_place[entry.default >> 16, entry.default >> 8 & 0xFF]
            assert mapped.mappable
            assert mapped.type.size * 8 == entry.default & 0xFF


def test_a_file_that_is_none(tmp_path):
    path = tmp_path / "not.eds"
    path.write_text("nonsense")
    with pytest.raises(DeclarationError, match="is not an EDS file"):
        eds.load(path)


def test_baud_rates_stand_in_order():
    """The same profile gives the same file, whether canopen's bytecode is cached or not."""
    found = [int(rate) for rate in re.findall(r"^BaudRate_(\d+)=", GOOD, re.MULTILINE)]
    assert found == [10, 20, 50, 125, 250, 500, 800, 1000]


def test_an_unknown_profile():
    with pytest.raises(DeclarationError, match="Did you mean 'epos2' or 'epos4'"):
        profile("epos5")


def without(text, title):
    """The file without some of its sections."""
    return re.sub(rf"(?ms)^\[{title}\].*?(?=^\[|\Z)", "", text)


def section(text, name, **changes):
    """The file with other lines in one section; none: the line is left out."""
    begin = text.index(f"[{name}]\n")
    end = text.find("\n[", begin)
    part = text[begin : end if end >= 0 else None]
    for key, value in changes.items():
        part = re.sub(rf"(?m)^{key}=.*\n?", f"{key}={value}\n" if value is not None else "", part)
    return text[:begin] + part + text[begin + len(text[begin : end if end >= 0 else None]) :]


GOOD = eds.export(profile("epos4"))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is not an EDS file: it is empty"),
        (bytes(1000), "is not an EDS file: "),
        (GOOD[: GOOD.index("[6041]") + 3].encode(), "is not an EDS file: "),
        (GOOD.encode("utf-16"), "is not an EDS file: "),
        (GOOD.replace("DefaultValue=0\n", "DefaultValue=zz\n").encode(), "1001h.0: the default zz is no UNSIGNED8"),
        (GOOD.replace("DefaultValue=0\n", "DefaultValue=999\n").encode(), "1001h.0: the default 999 is no UNSIGNED8"),
        (
            GOOD.replace("AccessType=rw\n", "AccessType=maybe\n").encode(),
            "the access maybe is none of ro, wo, rw, const",
        ),
        (
            section(GOOD, "1400sub1", DataType="0x9").encode(),
            "1400h.1: is VISIBLE_STRING, parameters of PDOs are numbers",
        ),
        (without(GOOD, "3001(sub\\w)?").encode(), "does not state the scale of maxon EPOS4"),
        (eds.export(profile("mclm")).encode(), "does not state the scale of maxon EPOS4"),
    ],
    ids=["empty", "zeros", "cut", "UTF-16", "default", "range", "access", "type", "scale", "another profile"],
)
def test_files_of_others_and_broken_ones(tmp_path, data, message):
    path = tmp_path / "drive.eds"
    path.write_bytes(data)
    with pytest.raises(DeclarationError, match=re.escape(message)) as caught:
        eds.adopt(profile("epos4"), path)
    assert "\n" not in str(caught.value)


def test_a_file_of_equal_size_and_time_is_read_anew(tmp_path):
    path = tmp_path / "drive.eds"
    text = eds.export(profile("epos4"))
    path.write_text(text)
    before, times = eds.load_profile("epos4", str(path)), path.stat()
    path.write_text(text.replace("Controlword", "Controlwyrd"))
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    names = {entry.name for entry in eds.load_profile("epos4", str(path)).objects}
    assert "Controlwyrd" in names
    assert "Controlwyrd" not in {entry.name for entry in before.objects}


def test_what_windows_writes_is_read(tmp_path):
    path = tmp_path / "drive.eds"
    for data in (
        GOOD.replace("\n", "\r\n").encode("utf-8-sig"),
        GOOD.replace("Controlword", "Contrôle").encode("cp1252"),
    ):
        path.write_bytes(data)
        assert len(eds.adopt(profile("epos4"), path)[0].objects) == len(profile("epos4").objects)


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(DeclarationError, match="cannot be read: Is a directory"):
        eds.load(tmp_path)


def as_vendors_write(name, types):
    """Other types of some objects, no defaults for what a drive has in its memory, objects that no profile has."""
    text = eds.export(profile(name))
    for place in ("1000", "1018sub1", "1018sub2", "1018sub3", "1018sub4", "6502"):
        text = section(text, place, DefaultValue=None)
    for place, kind in types.items():
        text = section(text, place, DataType=kind)
    text = re.sub(r"(?m)^(SupportedObjects=)(\d+)\n((?:\d+=0x[2-5].*\n)+)", longer, text, count=1)
    return text + (
        "\n[5FFE]\nParameterName=Program\nObjectType=0x7\nDataType=0xA\nAccessType=wo\nPDOMapping=0\n"
        "\n[5FFF]\nParameterName=Trim\nObjectType=0x7\nDataType=0x3\nAccessType=rww\nDefaultValue=0xFFFE\nPDOMapping=0\n"
    )


def longer(match):
    """The list of a vendor's objects with two more."""
    count = int(match[2])
    return f"{match[1]}{count + 2}\n{match[3]}{count + 1}=0x5FFE\n{count + 2}=0x5FFF\n"


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "types", "named"),
    [
        ("mclm", {"2331sub1": "0x7", "2350sub4": "0x6"}, ["2331h.1", "2350h.4"]),
        ("epos4", {"2001": "0x6", "3002sub2": "0x7", "6041": "0x9"}, ["2001h.0", "3002h.2", "6041h.0"]),
        ("faulhaber_v3", {"2344sub1": "0x9"}, ["2344h.1"]),
    ],
)
def test_a_vendors_file_is_taken_as_it_is(tmp_path, build, name, types, named, monkeypatch):
    """What contradicts the profile is a warning that names the object; the drive runs with it."""
    path = tmp_path / "vendor.eds"
    path.write_text(as_vendors_write(name, types))
    changed, warnings = eds.adopt(profile(name), path)
    assert [next(one for one in named if one in line) for line in warnings] == named
    found = {place(one): one for one in changed.objects}
    own = {place(one): one for one in profile(name).objects}
    assert found[0x1018, 2].default == own[0x1018, 2].default
    assert found[0x1000, 0].default & 0xFFFF == 402
    assert found[0x5FFF, 0].default == -2
    assert found[0x5FFE, 0].type is OCTETS
    assert found[0x6041, 0].type is own[0x6041, 0].type  # the drive computes with it
    wire_other_drive(monkeypatch, plant, changed)
    rig = Rig(build, {"servomotor": NODES[name]})
    rig.set(target_velocity=0.02)
    rig.go(100)
    assert rig.drive.state is State.ENABLED


@pytest.mark.slow
def test_the_command_warns(tmp_path, monkeypatch):
    path = tmp_path / "vendor.eds"
    path.write_text(as_vendors_write("epos4", {"2001": "0x6"}))
    served = []
    monkeypatch.setattr(drive, "serve", lambda chosen, *_: served.append(chosen))
    done = CliRunner().invoke(drive.command, ["-p", "epos4", "--eds", str(path), "-i", "virtual", "-c", "x"])
    assert done.exit_code == 0, done.output
    assert "warning: " in done.output
    assert "2001h.0 CAN bit rate is UNSIGNED16, maxon EPOS4 has UNSIGNED8 here. The file counts." in done.output
    assert len(served) == 1


@every_case(
    "index",
    [
        0x3012,
        0x301A,
        0x3150,
        0x3151,
        0x3158,
        0x3202,
        *range(0x324B, 0x3251),
        *range(0x31E0, 0x31E3),
        *range(0x31E4, 0x31EA),
        0x607B,
        0x60E4,
        0x60E5,
    ],
)
def test_the_epos4_has_what_its_users_need(index):
    assert any(one.index == index for one in profile("epos4").objects)
