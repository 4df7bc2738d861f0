"""A run that goes on: what is there until now is what the finished run has too; then it is a run as any other."""

import json
import os
import shutil

import numpy as np
import pytest

from tests.viewer.recorded import BEATS, BUILD
from twin.errors import TwinError
from twin.results.recording import stream
from twin.run import RunCallbacks, RunOptions, run_scenario
from twin.scenario import Backend, load_scenario
from twin.viewer import RunCollection, ViewedCurve, embedded_page, open_recorded_run, select_cases
from twin.viewer.page import description
from twin.viewer.page_data import about

ORDER = [("slow", 1), ("slow", 2), ("fast", 1), ("fast", 2)]
SIGNALS = ("heart.position", "abs(heart.velocity)", "heart.beats")


def values(runs, number):
    """What a case has of each signal."""
    found = {"cases": [(one.key, one.samples > 0) for one in runs.cases], "span": vars(runs.cases[number])}
    return found | {
        one: [np.array(own) for own in vars(runs.samples(ViewedCurve(one, number))).values()][:2] for one in SIGNALS
    }


def cut(recording):
    """A recording as it was in its second case, with 1000 rows of it and a part of the next."""
    journal = recording / "journal.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    (last,) = (k for k, line in enumerate(lines) if line.startswith('{"rows": 1,'))
    journal.write_text("".join(lines[: last + 1]))
    os.truncate(recording / "1.rows", 1000 * 8 * json.loads(lines[last])["words"] + 5)


@pytest.fixture(scope="module")
def looked(tmp_path_factory):
    """A run that was looked at in its second case and in the third: what the second had, the viewer's runs, the folder."""
    place = tmp_path_factory.mktemp("growing")
    (place / "beats.yaml").write_text(BEATS.replace("stop_time: 2 s", "stop_time: 20 s"))
    here, seen = place / "here", {}

    def progress(case, _):
        if case != "fast, seed 1" or seen:
            return
        (folder,) = (place / "runs").glob("*/2*")
        shutil.copytree(folder, here)
        cut(here / stream.FOLDER)
        seen["runs"] = runs = RunCollection([open_recorded_run(here)])
        seen["first"] = values(runs, 1) | {
            "about": about(runs),
            "page": embedded_page(runs, ["heart.position"], [0, 1, 2]),
        }
        shutil.copytree(folder, here, dirs_exist_ok=True)
        seen["until"] = runs.progress()["cases"]
        seen["second"] = values(runs, 1)

    outcome = run_scenario(
        load_scenario(place / "beats.yaml"),
        RunOptions(backend=Backend.compiled, root=place / "runs", build=BUILD),
        callbacks=RunCallbacks(progress=progress),
    )
    shutil.rmtree(here / stream.FOLDER)
    shutil.copytree(outcome.folder, here, dirs_exist_ok=True)
    return seen, outcome.folder


@pytest.mark.slow
def test_what_is_there_until_now(looked):
    seen, folder = looked
    whole = RunCollection([open_recorded_run(folder)])
    assert not whole.growing
    for one in ("first", "second"):
        count = seen[one]["span"]["samples"]
        for name in SIGNALS:
            samples, (time, y) = whole.samples(ViewedCurve(name, 1)), seen[one][name]
            assert len(time) == len(y) == count
            np.testing.assert_array_equal(time, samples.time[:count])
            np.testing.assert_array_equal(y, samples.y[:count])
        assert (seen[one]["span"]["begin"], seen[one]["span"]["end"]) == (0.0, time[-1])
    assert seen["first"]["span"]["samples"] == 1000
    assert seen["until"][1][2] == count == whole.cases[1].samples


def test_cases_that_have_not_begun_are_there_and_empty(looked):
    first = looked[0]["first"]
    assert first["cases"] == [(case, k < 2) for k, case in enumerate(ORDER)]
    assert first["page"].curves == 2
    told = first["about"]
    assert (told["growing"], description(told)[-13:]) == (True, ", in progress")
    assert [(one["name"], one["verdict"], one["high"]) for one in told["expectations"]] == [
        ("it stays near", "open", 4.0),
        ("it never stops", "open", None),
    ]


def test_at_the_end_it_is_a_run_as_any_other(looked):
    seen, folder = looked
    runs = seen["runs"]
    told = runs.progress()
    assert (told["over"], runs.growing, runs.progress()["over"]) == (True, [], False)
    assert [one[2] for one in told["cases"]] == [
        one.samples for one in RunCollection([open_recorded_run(folder)]).cases
    ]
    assert [one["verdict"] for one in about(runs)["expectations"]] == ["fail", "pass"]
    assert select_cases(runs, "", None) == [0, 2]


def test_a_run_whose_process_is_gone(tmp_path):
    journal = stream.Journal(tmp_path)
    journal.create({"name": "gone"}, "1:0")
    with pytest.raises(TwinError, match=r"its process has ended\. Recover its results with: twin recover"):
        open_recorded_run(tmp_path)
