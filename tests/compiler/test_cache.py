"""What lies in the cache is native code that will be loaded: anything damaged, or another user's, is made again."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.matrix import some
from twin import compiler
from twin.component import Component, output
from twin.coupling import RecordMember
from twin.fmi.exporting import fmu_cache

SUFFIXES = {".c", ".h", ".o", ".so", ".fmu", ""}


class Seven(Component):
    """Shows a number."""

    y = output("", "the number")

    def step(self, t, h):
        self.y = 7.0


def everything(build: Path) -> list[Path]:
    return sorted(build.glob("cache/*-*/*"))


def use(build: Path) -> bytes:
    """Load the component and build its FMU, as a new process would; the FMU's bytes."""
    compiler.reset_fingerprints()
    start, step = compiler.load_component(Seven, build)
    member = RecordMember("seven", Seven(), (start, step))
    member.instantiate()
    member.enter_initialization(0.0, 1.0)
    member.exit_initialization()
    assert member.try_step(0.0, 1e-3, np.zeros(4, np.int64)) == 0
    assert np.float64(member.get("y")) == 7.0
    return fmu_cache.build(Seven, "3.0", build).read_bytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A build folder with everything of the component in it."""
    folder = tmp_path_factory.mktemp("whole")
    use(folder)
    assert {path.suffix for path in everything(folder)} == SUFFIXES
    return folder


@pytest.fixture
def folder(whole, tmp_path):
    copied = tmp_path / "build"
    shutil.copytree(whole, copied)
    return copied


@pytest.mark.slow
@pytest.mark.parametrize("damage", some([b"", b"\xff\xfe\xfa", b"/* other */", None], [b"\xff\xfe\xfa", None]))
def test_damaged_files_are_made_anew(folder, damage):
    intact = {path: path.read_bytes() for path in everything(folder)}
    for path, data in intact.items():
        path.write_bytes(data[: len(data) // 2] if damage is None else damage)
    assert use(folder) in intact.values()
    again = everything(folder)  # what the first use did not need is still damaged
    assert {path: path.read_bytes() for path in again if path.suffix in (".so", ".fmu", ".c")} == {
        path: data for path, data in intact.items() if path.suffix in (".so", ".fmu", ".c")
    }


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="modes of files")
def test_what_others_may_write_is_made_anew(folder):
    for path in everything(folder):
        path.chmod(0o666)
    use(folder)
    assert not [path for path in everything(folder) if path.stat().st_mode & 0o022]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")
def test_what_another_user_owns_is_made_anew(folder):
    for path in everything(folder):
        os.chown(path, 12345, -1)
    use(folder)
    assert {path.stat().st_uid for path in everything(folder)} == {os.geteuid()}
