"""`twin view`: what is shown of which run or environment, and what is written where, with the work itself replaced."""

from pathlib import Path
from types import SimpleNamespace

import click
import pytest

from tests.cli.replaced import Calls, replace
from tests.cli.test_fit_commands import run as run_command
from tests.viewer.recorded import FORCE, PLACE, folder_of, wave
from twin.cli import view
from twin.cli.view import ViewOptions
from twin.errors import SceneError, TwinError

VIEW = {
    "title": "",
    "variant": "",
    "seed": None,
    "patterns": (),
    "output": None,
    "rate": 25.0,
    "speed": 1.0,
    "port": None,
    "no_open": False,
}


@pytest.fixture
def calls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Calls()


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["latest"], ("runs", ["folder"], False)),
        (["a.svg", "latest"], ("runs", ["folder", "folder"], False)),
        (["latest", "--scene"], ("runs", ["folder"], True)),
        (["a.svg"], ("environment", "a.svg", None)),
        (["a.svg", "-o", "b.png"], ("environment", "a.svg", Path("b.png"))),
        (["study.yaml", "--scene", "-o", "b.gif"], ("scene", Path("study.yaml"), Path("b.gif"))),
        (["a.parquet", "-o", "b.CSV"], ("signals", Path("a.parquet"), Path("b.CSV"))),
        (["a.svg", "--seed", "0"], None),
        (["a.svg", "--title", "x"], None),
        (["a.svg", "--variant", "x"], None),
        (["a.svg", "--signal", "x"], None),
    ],
)
def test_what_is_viewed(calls, monkeypatch, words, shown):
    monkeypatch.setattr(view, "run_folder", lambda text, runs: "folder")
    monkeypatch.setattr(view, "view_runs", lambda folders, _, as_scene: calls.append(("runs", folders, as_scene)))
    monkeypatch.setattr(view, "view_environment", lambda what, output: calls.append(("environment", what, output)))
    monkeypatch.setattr(view, "view_scene", lambda run, _, output: calls.append(("scene", run, output)))
    monkeypatch.setattr(view, "write_signals", lambda run, target, _: calls.append(("signals", run, target)))
    code, _, errors = run_command(view.command, *words)
    if shown is None:
        assert code == 2
        assert "--signal, --title, --variant and --seed need a run, not an environment." in errors[-1]
    assert calls == ([shown] if shown else [])


@pytest.mark.parametrize(
    ("output", "as_scene", "shown"),
    [
        (None, False, ("page", None)),
        ("a.html", False, ("page", Path("a.html"))),
        ("html", False, ("page", Path("run.html"))),
        ("a.mat", False, ("signals", Path("a.mat"))),
        ("mcap", False, ("signals", Path("run.mcap"))),
        ("a.gif", True, ("scene", Path("a.gif"))),
        (None, True, ("scene", None)),
        ("a.gif", False, None),
    ],
)
def test_how_runs_are_viewed(calls, monkeypatch, output, as_scene, shown):
    """A format alone names the file after the scenario."""
    summary = {"scenario": {"name": "run"}}
    replace(monkeypatch, "twin.face", open_run=lambda _: SimpleNamespace(summary=summary))
    monkeypatch.setattr(view, "view_signals", lambda folders, _, target: calls.append(("page", target)))
    monkeypatch.setattr(view, "view_scene", lambda run, _, target: calls.append(("scene", target)))
    monkeypatch.setattr(view, "write_signals", lambda run, target, _: calls.append(("signals", target)))
    options = ViewOptions(**VIEW | {"output": output and Path(output)})
    if shown is None:
        with pytest.raises(click.UsageError, match=r"signals can be written as \.html, \.csv, \.mat, \.mcap\."):
            view.view_runs([Path("r")], options, as_scene)
        return
    view.view_runs([Path("r")], options, as_scene)
    assert calls == [shown]
    if shown[0] != "page":
        with pytest.raises(click.UsageError, match="one run, not 2"):
            view.view_runs([Path("r")] * 2, options, as_scene)


def test_the_folder_of_a_run(calls, monkeypatch):
    """`latest` alone is the last run of all; STUDY:7 a case; a study's folder stands for the first case that it kept."""
    found = []
    monkeypatch.setattr("twin.results.recording.latest_run.finished_runs", lambda runs, file: found)
    study, cases = Path("study"), {9: Path("nine"), 3: Path("three")}
    replace(
        monkeypatch,
        "twin.study",
        study_of_run=lambda folder: study if folder.name in ("study", "case") else None,
        stored_cases=lambda folder: cases,
        stored_case_folder=lambda text, runs: Path(runs, text),
    )
    runs = Path("runs")
    with pytest.raises(TwinError, match=r"runs: holds no finished run\. Run a scenario first"):
        view.run_folder("latest", runs)
    found[:] = [Path("second"), Path("first")]
    assert view.run_folder("latest", runs) == Path("second")
    assert view.run_folder("study:7", runs) == Path("runs/study:7")
    assert view.run_folder("study", runs) == Path("three")
    assert [view.run_folder(name, runs) for name in ("case", "other", "x/latest", "study:x")] == [
        Path(name) for name in ("case", "other", "x/latest", "study:x")
    ]
    cases.clear()
    with pytest.raises(
        TwinError, match=r"study: the study kept no signals of its cases\. Run one again: twin run --case study:1"
    ):
        view.run_folder("study", runs)
    for name in ("latest", "study:7"):
        Path(name).mkdir()
        assert view.run_folder(name, runs) == Path(name)


@pytest.fixture
def recorded(calls, tmp_path):
    """A run with two signals, variants and seeds."""
    time, values = wave(100.0, 0.1)
    signals = (time, {"sensor.force": values, "tip.position": values})
    cases = dict.fromkeys([("PI", 1), ("PI", 2), ("PI+FF", 1)], signals)
    return folder_of(tmp_path / "run", cases, [FORCE, PLACE])


@pytest.mark.parametrize(
    ("options", "line", "cases"),
    [
        ({}, "2 signals of 3 cases", 3),
        ({"patterns": ("tip.*",)}, "1 signal of 3 cases", 3),
        ({"patterns": ("tip.*", "*.force")}, "2 signals of 3 cases", 3),
        ({"variant": "PI"}, "2 signals of 2 cases", 2),
        ({"seed": 1}, "2 signals of 2 cases", 2),
        ({"variant": "PI+FF", "seed": 1}, "2 signals of 1 case", 1),
    ],
)
def test_signals_are_written(recorded, capsys, options, line, cases):
    """Those that are named, else all; of the named cases."""
    for note in ("", " (replaced)"):
        view.write_signals(recorded, Path("a.csv"), ViewOptions(**VIEW | options))
        assert capsys.readouterr().out.splitlines() == [line, f"a.csv{note}"]
    head, *rows = Path("a.csv").read_text().splitlines()
    assert len(rows) == 10 * cases
    assert ("force" in head, "position" in head) == (options.get("patterns") != ("tip.*",), True)


@pytest.mark.parametrize(
    ("options", "target", "message"),
    [
        ({"patterns": ("tip.x",)}, "a.csv", r"run: 'tip\.x' was not recorded\. Known: sensor\.force, tip\.position\."),
        ({"variant": "PJ"}, "a.csv", r"run: has no such case\. Variants: PI, PI\+FF; seeds: 1, 2\."),
        ({"seed": 0}, "a.csv", "run: has no such case"),
        ({"variant": "PI+FF", "seed": 2}, "a.csv", "run: has no such case"),
        ({}, "x/a.csv", r"x/a\.csv: there is no folder x\. Create it first\."),
    ],
)
def test_signals_that_cannot_be_written(recorded, options, target, message):
    with pytest.raises(TwinError, match=message):
        view.write_signals(recorded, Path(target), ViewOptions(**VIEW | options))
    (recorded / "signals.parquet").unlink()
    with pytest.raises(TwinError, match=r"run/signals\.parquet: does not exist any more\. Run the scenario again\."):
        view.write_signals(recorded, Path("a.csv"), ViewOptions(**VIEW))


def test_scenes_are_written(calls, monkeypatch, capsys):
    """A page shows all of them; a film only one. The page is called as its scene, or as the scenario if there are more."""
    summary = {"scenario": {"title": "Rig", "name": "rig"}, "started": "2026-11-22T21:00:00+00:00"}
    replace(monkeypatch, "twin.face", open_run=lambda run: SimpleNamespace(folder=run, summary=summary))
    one, same, other = (SimpleNamespace(title=title) for title in ("Tip", "Tip", "Robot"))
    animations = {"a": one, "b": same}
    monkeypatch.setattr("twin.run.scenes.run_scenes", lambda *words: calls.append(words) or animations)
    monkeypatch.setattr("twin.scene.page.page_html", lambda *words: calls.append(words) or "page")
    monkeypatch.setattr(view, "write_animation", calls("film"))
    folder = Path("r")
    folder.mkdir()
    options = ViewOptions(**VIEW | {"title": "Tip", "variant": "PI", "seed": 3, "rate": 5.0, "speed": 2.0})
    for note in ("", " (replaced)"):
        view.view_scene(folder, options, None)
        assert capsys.readouterr().out == f"r/scene.html{note}\n"
    assert calls[:2] == [(folder, "Tip", "PI", 3), ("Tip", animations, "Rig, 2026-11-22 21:00")]
    animations["c"] = other
    view.view_scene(folder, options, Path("x.html"))
    assert calls[-1][0] == "Rig"
    summary["scenario"]["title"] = ""
    view.view_scene(folder, options, Path("x.html"))
    assert calls[-1][0] == "rig"
    with pytest.raises(SceneError, match=r"x\.gif: can show one of a, b, c\. Choose with --title"):
        view.view_scene(folder, options, Path("x.gif"))
    del animations["b"], animations["c"]
    view.view_scene(folder, options, Path("x.gif"))
    assert calls[-1] == ("film", one, Path("x.gif"), 5.0, 2.0)
    for target, message in (
        ("x.csv", "cannot be written. Use .html, .svg, .gif, .mp4, .png."),
        ("y/x.gif", "no folder y"),
    ):
        with pytest.raises(SceneError, match=message):
            view.view_scene(folder, options, Path(target))


@pytest.mark.parametrize("suffix", ["svg", "png", "gif", "mp4"])
def test_an_animation_is_written_by_its_suffix(calls, monkeypatch, suffix):
    """A picture shows the last instant."""
    frames = SimpleNamespace(title="Tip", time=[0.0, 1.5], select=lambda indices: f"frame {indices.tolist()}")
    monkeypatch.setattr("twin.scene.animation.animated_svg", calls("svg", "<svg/>"))
    monkeypatch.setattr("twin.scene.animation.write_movie", calls("movie"))
    monkeypatch.setattr("twin.scene.picture.scene_figure", calls("figure", "drawn"))
    monkeypatch.setattr("twin.scene.picture.save_figure", calls("save"))
    target = Path(f"x.{suffix}")
    view.write_animation(frames, target, 5.0, 2.0)
    if suffix == "svg":
        assert (calls, target.read_text()) == ([("svg", frames, 5.0, 2.0)], "<svg/>")
    elif suffix == "png":
        assert calls == [("figure", "frame [1]", "Tip, 1.5 s"), ("save", "drawn", target)]
    else:
        ((*call, progress),) = calls
        assert (call, progress(0.5)) == (["movie", frames, target, 5.0, 2.0], None)
