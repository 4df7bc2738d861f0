"""Rows on their way from the loop to a file."""

import contextlib
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.coupling.parts import Clock, couple
from twin.coupling import Ring
from twin.errors import CouplingError, SimulationError
from twin.process import SupervisorChannel, shared

MS = 1_000_000


@pytest.fixture
def ring():
    """Makes rings into the file `rows` of a folder, or another; who drains them ends with the test."""
    with contextlib.ExitStack() as links:

        def made(folder, file=None):
            link = links.enter_context(contextlib.closing(SupervisorChannel()))
            return Ring(link, lambda _layout: (file or folder / "rows", folder / "position"))

        yield made


@pytest.mark.parametrize("rows", [4, 5, 64, 1000])
def test_a_ring_gives_what_memory_gives(build, tmp_path, ring, monkeypatch, rows):
    monkeypatch.setattr(shared, "RING", 16 * rows)
    words = []
    for recorder in (None, ring(tmp_path)):
        chain = couple(build, {"clock": Clock()}, [], recorder=recorder)
        chain.initialize(0)
        chain.advance(300 * MS)
        words.append(np.array(chain.recorder.words()))
    assert np.array_equal(*words)
    assert (tmp_path / "rows").stat().st_size == 301 * 16


def test_a_row_that_does_not_fit(build, tmp_path, ring, monkeypatch):
    monkeypatch.setattr(shared, "RING", 48)
    with pytest.raises(CouplingError, match="record: 2 values in a row do not fit into 48 byte"):
        couple(build, {"clock": Clock()}, [], recorder=ring(tmp_path)).initialize(0)


def test_a_full_disk(build, tmp_path, ring):
    chain = couple(build, {"clock": Clock()}, [], recorder=ring(tmp_path, Path("/dev/full")))
    chain.initialize(0)
    with pytest.raises(SimulationError, match=r"the recording /dev/full cannot go on .No space left on device"):
        chain.advance(10**15)


def test_a_folder_that_disappears(build, tmp_path, ring):
    folder = tmp_path / "run"
    folder.mkdir()
    chain = couple(build, {"clock": Clock()}, [], recorder=ring(folder))
    chain.initialize(0)
    chain.advance(10 * MS)
    shutil.rmtree(folder)
    with pytest.raises(SimulationError, match=r"cannot go on .its folder has disappeared"):
        chain.advance(10**15)
