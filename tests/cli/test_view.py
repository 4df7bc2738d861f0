"""`twin view`: what is written where, and what is told."""

import os
import re
import shutil
from pathlib import Path

import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.scene.drawings import svg
from tests.scene.test_playing import PAD, SCENARIO
from tests.viewer.recorded import FORCE, folder_of, wave
from twin.cli.view import ViewOptions, is_run, view_signals
from twin.errors import TwinError
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a drawing and a run of the swing."""
    place = tmp_path_factory.mktemp("view")
    svg(place, PAD, "moving.svg")
    (place / "swing.yaml").write_text(SCENARIO)
    run_scenario(load_scenario(place / "swing.yaml"), RunOptions(backend=Backend.interpreted, root=place / "runs"))
    return place


@pytest.fixture
def view(folder, monkeypatch, capsys):
    """Run `twin view` there; its exit code, stdout and stderr."""
    monkeypatch.chdir(folder)
    from twin.cli import group, run_command

    def run(*words):
        code = run_command(lambda **options: group.main(["view", *words], **options), "twin")
        told = capsys.readouterr()
        return code, told.out, told.err

    return run


def test_what_is_a_run_and_what_an_environment(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("case:7").touch()
    assert all(map(is_run, ("folder", "somewhere/latest", "runs/swing", "study:7")))
    assert not any(map(is_run, ("drawing.svg", "two_bends", "case:7", "study:best", "7.svg")))


def test_a_missing_folder_names_studies_too(view, folder):
    study = folder / "runs" / "thousand_hearts" / "2026-11-22_21-00-00"
    study.mkdir(parents=True)
    (study / "cases.parquet").touch()
    code, _, error = view("runs/thousand_heart")
    assert (code, error.count("\n"), "Did you mean 'thousand_hearts'?" in error) == (1, 1, True)
    code, _, error = view("runs/thousand_hearts")
    assert (code, "is a folder of studies. Name one of them, or runs/thousand_hearts/latest" in error) == (1, True)


@pytest.mark.parametrize(
    ("variant", "seed", "shown"), [("", None, []), ("PI", None, [0]), ("", 2, [1, 2]), ("PI", 2, [1]), ("", 0, None)]
)
def test_cases_of_a_page_are_those_that_are_named(tmp_path, monkeypatch, variant, seed, shown):
    """Without a name the page chooses."""
    time, force = wave(100.0, 1.0)
    recorded = (time, {"sensor.force": force})
    run = folder_of(tmp_path / "run", dict.fromkeys((("PI", 1), ("PI", 2), ("PI+FF", 2)), recorded), [FORCE])
    served = []
    monkeypatch.setattr("twin.viewer.serve", lambda *_, cases, **__: served.append(list(cases)))
    options = ViewOptions(
        title="", variant=variant, seed=seed, patterns=(), output=None, rate=1.0, speed=1.0, port=None, no_open=True
    )
    if shown is None:
        with pytest.raises(TwinError, match="has no such case"):
            view_signals([run], options, None)
        return
    view_signals([run], options, None)
    assert served == [shown]


@pytest.mark.slow
def test_an_environment_is_drawn_and_described(view, folder):
    told = (
        "Channel\n"
        "path: 160 mm from (0, 0) mm, clearance from center line to nearest wall 4.5 mm\n"
        "wall pad: 4 points, solid, moves with heart\n"
        "wall upper: 2 points, friction 0.2, thickness mm 1\n"
        "wall lower: 2 points, friction 0.2, thickness mm 1\n"
    )
    for name in ("channel.svg", "channel.png", "channel.html"):
        assert view("moving.svg", "--output", name) == (0, f"{told}{name}\n", "")
        assert (folder / name).stat().st_size > 5000
    assert (folder / "channel.svg").read_text().startswith("<svg ")
    assert view("moving.svg", "--output", "channel.svg")[1] == f"{told}channel.svg (replaced)\n"
    assert view("two_bends")[1].endswith("\ntwo_bends.svg\n")


@pytest.mark.slow
def test_a_drawing_is_never_written_over(view, folder):
    before = (folder / "moving.svg").read_text()
    code, _, told = view("moving.svg")
    assert (code, told) == (1, "error: moving.svg: is the environment itself. Name another file with --output.\n")
    assert (folder / "moving.svg").read_text() == before


@pytest.mark.slow
def test_a_run_is_played(view, folder):
    (run,) = (folder / "runs/swing").glob("2*")
    place = os.path.relpath(run, folder)
    assert view("runs/swing/latest", "--scene") == (0, f"{place}/scene.html\n", "")
    assert "In space" in (run / "scene.html").read_text()
    code, _, told = view("runs/swing/latest", "--scene", "-o", "a.gif")
    assert (code, told) == (
        1,
        "error: a.gif: can show one of In the channel, In space. Choose with --title, --variant and --seed.\n",
    )
    for name in ("b.svg", "b.png", "b.gif"):
        assert view(place, "--scene", "--title", "In space", "-o", name, "--rate", "5")[:2] == (0, f"{name}\n")
        assert (folder / name).stat().st_size > 1000


@pytest.mark.slow
def test_signals_become_a_page(view, folder):
    code, told, _ = view(
        "runs/swing/latest", "--signals", "swing.t*", "--signal", "abs(swing.travel)", "--output", "a.html"
    )
    first, second = told.splitlines()
    assert (code, second) == (0, "a.html (replaced)" if "replaced" in second else "a.html")
    names = re.findall(r'"signal":"([^"]+)","case"', (folder / "a.html").read_text())
    assert "swing.travel" in names
    assert "abs(swing.travel)" in names
    assert first.startswith(f"signals: {len(names)}, curves: {len(names)}, 0.")


@pytest.mark.slow
def test_a_format_alone_is_a_file_of_the_scenarios_name(view, folder):
    for ending, what in (("mcap", "runs/swing/latest"), ("csv", "swing")):  # a scenario's name is its last run
        code, told, _ = view(what, "--output", ending, "--signal", "swing.travel")
        assert (code, told) == (0, f"1 signal of 1 case\nswing.{ending}\n")
        assert (folder / f"swing.{ending}").stat().st_size > 1000


@pytest.mark.slow
def test_a_case_of_a_study_that_was_kept(view, folder):
    (run,) = (folder / "runs/swing").glob("2*")
    study = folder / "runs/hearts_713/2026-11-22_10-00-00"
    shutil.copytree(run, study / "cases/swing/2026-11-22_10-00-01")
    parquet.write_table(pa.table({"case": range(1, 714)}), study / "cases.parquet")
    (study / "manifest.json").write_text('{"runs": {"713": "cases/swing/2026-11-22_10-00-01"}}')
    assert view("hearts_713:713", "--signal", "swing.travel", "-o", "case.html")[0] == 0
    code, _, told = view("hearts_713:3", "-o", "case.html")
    assert code == 1
    assert (
        "hearts_713:3: the study did not keep this case's signals. Kept: 713. Run it again: twin run --case hearts_713:3"
        in told
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("two_bens",), "There is no environment or run 'two_bens'. Did you mean 'two_bends'?"),
        (
            ("qqq",),
            "There is no environment or run 'qqq'. Known: aortic_arch, free_gap, heart_wall, latest, left_ventricle, swing",
        ),
        (("swin",), "There is no environment or run 'swin'. Did you mean 'swing'?"),
        (("lates",), "There is no environment or run 'lates'. Did you mean 'latest'?"),
        (("two_bends", "-o", "a.pdf"), "a.pdf: cannot be written. Use .svg, .png, .html."),
        (("two_bends", "-o", "nowhere/a.svg"), "nowhere/a.svg: there is no folder nowhere. Create it first."),
        (("two_bends", "--seed", "1"), "--signal, --title, --variant and --seed need a run, not an environment."),
        (
            ("runs/swing/latest", "-o", "a.png"),
            "a.png: signals can be written as .html, .csv, .mat, .mcap. Add --scene",
        ),
        (
            ("runs/swing/latest", "--signal", "swing.trave", "-o", "a.html"),
            "'swing.trave' was not recorded. Did you mean",
        ),
        (("runs/swing/latest", "--seed", "9", "-o", "a.html"), "has no such case. Variants: base; seeds: 0."),
        (("runs/swing/latest", "runs/swing/latest", "-o", "a.csv"), ".csv holds one run, not 2. Name one."),
        (("runs/swin/latest",), "runs/swin: holds no finished run. Looked in "),
        (("hearts:3",), "hearts:3: no study hearts has run in runs."),
        (("runs/swing/latest", "--scene", "--variant", "PI"), "there is no variant 'PI'. Known: base."),
        (
            ("runs/swing/latest", "--scene", "-o", "a.avi"),
            "a.avi: cannot be written. Use .html, .svg, .gif, .mp4, .png.",
        ),
        (("swing.yaml",), "swing.yaml: cannot be read. Expected .svg, .geojson, .json, or the name of an environment."),
    ],
)
def test_what_cannot_be_viewed(view, words, told):
    code, out, err = view(*words)
    assert (code in (1, 2), out) == (True, "")
    assert told in err
