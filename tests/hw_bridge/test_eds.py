"""Object dictionaries as EDS files: there and back, and readable for canopen."""

import re

import pytest
from canopen.objectdictionary import import_od

from hw_bridge import eds
from hw_bridge.dictionary import NodeId
from hw_bridge.profiles import MODULES, profile
from twin.errors import DeclarationError


def place(entry):
    return entry.index, entry.sub


@pytest.mark.parametrize("name", MODULES)
def test_round_trip(name, tmp_path):
    path = tmp_path / "drive.eds"
    path.write_text(eds.export(profile(name)))
    loaded = sorted(eds.load(path), key=place)
    assert loaded == sorted(profile(name).objects, key=place)
    assert any(isinstance(entry.default, NodeId) for entry in loaded)
    theirs = import_od(str(path), 5)
    assert theirs[0x1400][1].default == 0x205
    assert theirs["Controlword"].index == 0x6040


@pytest.mark.parametrize("name", MODULES)
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


def test_an_unknown_profile():
    with pytest.raises(DeclarationError, match="Did you mean 'epos4'"):
        profile("epos5")


def without(text, title):
    """The file without some of its sections."""
    return re.sub(rf"(?ms)^\[{title}\].*?(?=^\[|\Z)", "", text)


GOOD = eds.export(profile("epos4"))


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
        (GOOD.replace("DataType=0x0006", "DataType=0x0009").encode(), "is VISIBLE_STRING, maxon EPOS4 has UNSIGNED16"),
        (without(GOOD, "3001(sub\\w)?").encode(), "says not how maxon EPOS4 scales"),
        (eds.export(profile("mclm")).encode(), "says not how maxon EPOS4 scales"),
    ],
)
def test_files_of_others_and_broken_ones(tmp_path, data, message):
    path = tmp_path / "drive.eds"
    path.write_bytes(data)
    with pytest.raises(DeclarationError, match=re.escape(message)) as caught:
        eds.adopt(profile("epos4"), path)
    assert "\n" not in str(caught.value)


def test_what_windows_writes_is_read(tmp_path):
    path = tmp_path / "drive.eds"
    for data in (
        GOOD.replace("\n", "\r\n").encode("utf-8-sig"),
        GOOD.replace("Controlword", "Contrôle").encode("cp1252"),
    ):
        path.write_bytes(data)
        assert len(eds.adopt(profile("epos4"), path).objects) == len(profile("epos4").objects)


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(DeclarationError, match="cannot be read: Is a directory"):
        eds.load(tmp_path)
