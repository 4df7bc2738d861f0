"""Object dictionaries as EDS files: there and back, and readable for canopen."""

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
