"""Cases of a study are linked if their signals were kept."""

import json

import pytest

from tests.viewer.recorded import FORCE, folder_of, runs, wave
from twin.viewer.requests import RequestError
from twin.viewer.server import ServedCases, ViewedRuns
from twin.viewer.study_cases import study_cases


@pytest.fixture
def study(tmp_path):
    """The folder of a study with the runs of two cases."""
    folder = tmp_path / "few" / "2026-11-27_09-00-00"
    (folder / "runs").mkdir(parents=True)
    time, force = wave(100.0, 1.0)
    for number in (3, 8):
        folder_of(folder / "runs" / str(number), {("PI", 1): (time, {"sensor.force": number * force})}, [FORCE])
    (folder / "manifest.json").write_text(json.dumps({"runs": {"3": "runs/3", "8": "runs/8"}}))
    (folder / "cases.parquet").touch()
    return folder


def test_the_page_of_a_case_links_to_the_others(study):
    opened = runs(study / "runs" / "3")
    kept = study_cases(opened)
    assert kept.plain() == {
        "name": "few",
        "current": 3,
        "cases": [{"number": 3, "passed": True}, {"number": 8, "passed": True}],
    }
    served = ServedCases(ViewedRuns(opened, study=kept))
    assert served.find("") is served.find("3") is served.first
    other = served.find("8")
    assert (other.runs.runs[0].folder.name, other.study.current) == ("8", 8)
    assert served.find("8") is other
    for number in ("4", "x", "../8"):
        with pytest.raises(RequestError, match="is not a kept case of a study"):
            served.find(number)


def test_other_runs_have_no_links(study, tmp_path):
    time, force = wave(100.0, 1.0)
    alone = folder_of(tmp_path / "alone", {("PI", 1): (time, {"sensor.force": force})}, [FORCE])
    assert study_cases(runs(alone)) is None
    assert study_cases(runs(study / "runs" / "3", study / "runs" / "8")) is None
