"""File names that are not text."""

import os
import subprocess
import sys

import pytest


@pytest.mark.slow_repetitions
@pytest.mark.skipif(sys.platform != "linux", reason="file names that are not text")
@pytest.mark.parametrize("words", [["check"], ["run", "--no-report"], ["simulate"]])
def test_a_path_that_is_not_text_is_one_line(tmp_path, words):
    path = os.fsencode(tmp_path) + b"/sc\xe9ne.yaml"
    with open(path, "wb") as file:
        file.write(b"stop_time: 1 s\nmembers: {heart: {component: heart}}\n")
    line = [os.fsencode(sys.executable), b"-c", b"from twin.cli import main; main()", *map(os.fsencode, words), path]
    done = subprocess.run(line, capture_output=True, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert rb"sc\udce9ne.yaml: byte 0xe9 is not UTF-8 text. Rename the file or folder." in done.stderr
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="file names that are not text")
def test_a_folder_that_is_not_text_is_one_line(tmp_path):
    folder = tmp_path / os.fsdecode(b"rig\xe9")
    folder.mkdir()
    line = [sys.executable, "-c", "from twin.cli import main; main()", "run", "heart_wall_force"]
    done = subprocess.run(line, capture_output=True, cwd=folder, check=False)
    assert done.returncode == 2
    assert rb"rig\udce9: byte 0xe9 is not UTF-8 text. Rename the file or folder." in done.stderr
    assert list(folder.iterdir()) == []
