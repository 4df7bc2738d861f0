"""FMUs of ours are kept unpacked: a run opens no archive, and what is damaged or of another engine is made anew."""

import gc
import shutil
import sys
import weakref
import zipfile

import numpy as np
import pytest

from tests.fmi.third_party import native_fmu
from twin.component import catalog
from twin.errors import FMUError
from twin.fmi import FMUMember, built, unpacked


@pytest.fixture
def fmu(tmp_path, build):
    """An FMU in a build folder of its own."""
    path = built.build(catalog.component("sheath"), "3.0", build)
    place = tmp_path / "build" / "3.0"
    place.mkdir(parents=True)
    for one in (path, path.with_suffix(".hash")):
        shutil.copy(one, place)
    return place / path.name


@pytest.fixture
def sealed(monkeypatch):
    """From here on no archive may be opened."""

    def seal():
        def refuse(*_):
            raise AssertionError("opened")

        monkeypatch.setattr(zipfile, "ZipFile", refuse)

    return seal


def outlines(fmu):
    return sorted(fmu.parents[1].rglob(f"*.{sys.implementation.cache_tag}"))


def course(fmu):
    """What a member says of itself and computes."""
    member = FMUMember("sheath", fmu, {"gripper_position": 1e-3}, ours=True)
    try:
        member.instantiate()
        member.enter_initialization(0.0, 1.0)
        member.exit_initialization()
        values = {
            name: np.array(member.get(name)) for name, one in member.variables.items() if one.causality == "output"
        }
        return repr(dict(member.variables)), member.capabilities, member.identity, values
    finally:
        member.close()


def test_what_is_kept_is_what_the_archive_holds(fmu, sealed):
    first = course(fmu)
    assert len(outlines(fmu)) == 1
    sealed()
    np.testing.assert_equal(course(fmu), first)


@pytest.mark.parametrize("name", ["servomotor", "instrument", "fiber_shape"])
def test_every_field_survives(build, name):
    for version in ("2.0", "3.0"):
        with unpacked.share(built.build(catalog.component(name), version, build)) as one:
            assert unpacked.restored(unpacked.packed(one.description)) == one.description
            assert unpacked.restored(unpacked.packed(dict(one.terminals))) == one.terminals


@pytest.mark.parametrize("damage", ["outline cut", "outline changed", "library changed", "library gone", "no outline"])
def test_what_is_damaged_is_made_anew(fmu, damage):
    first = course(fmu)
    (outline,) = outlines(fmu)
    library = next(outline.parent.rglob("*.so"))
    whole, code = outline.read_bytes(), library.read_bytes()
    if damage.startswith("outline"):
        outline.write_bytes(whole[:-7] if damage.endswith("cut") else whole.replace(b"gripper", b"grabber"))
        assert outline.read_bytes() != whole
    elif damage == "no outline":
        outline.unlink()
    elif damage == "library gone":
        library.unlink()
    else:
        library.write_bytes(code[:-1] + bytes([code[-1] ^ 1]))
    np.testing.assert_equal(course(fmu), first)
    assert outline.read_bytes() == whole
    assert library.read_bytes() == code


def test_of_another_engine(fmu, sealed):
    """The same FMU, which a new engine would build to the byte, described as that engine does."""
    course(fmu)
    note = fmu.with_suffix(".hash")
    key, rest = note.read_text().split(" ", 1)
    note.write_text(f"{key[::-1]} {rest}")
    sealed()
    with pytest.raises(FMUError, match="opened"):
        course(fmu)


def test_of_anyone_else_nothing_is_kept(tmp_path):
    (tmp_path / "3.0").mkdir()
    path = native_fmu(tmp_path / "3.0")
    with unpacked.share(path, ours=True) as one:
        folder = one.folder
        assert folder.is_dir()
        assert not folder.is_relative_to(tmp_path)
    assert not folder.exists()
    assert not (tmp_path / "unpacked").exists()


def test_replaced_by_another(fmu, tmp_path):
    """Its note is that of another file: then it is anyone's."""
    course(fmu)
    shutil.copy(native_fmu(tmp_path), fmu)
    with unpacked.share(fmu, ours=True) as one:
        assert "sheath" not in one.description.identifier
        assert not one.folder.is_relative_to(tmp_path)


def test_no_place_to_keep_it(fmu):
    (fmu.parents[1] / "unpacked").write_text("a file")
    np.testing.assert_equal(course(fmu), course(fmu))


@pytest.mark.parametrize("ours", [True, False])
def test_what_nobody_uses_any_more_is_forgotten(fmu, ours):
    with unpacked.share(fmu, ours=ours) as first, unpacked.share(fmu, ours=ours) as second:
        assert first is second
        seen = weakref.ref(first)
    del first, second
    gc.collect()
    assert seen() is None
