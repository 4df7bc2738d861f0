"""Scenarios, runs and FMUs from Python.

Over 400 lines: all that `twin.run` takes and gives.
"""

import ast
import inspect
import json
import os
import pickle
import pydoc
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import twin
import twin.face
from tests.face.parts import SCENARIO, Types
from tests.viewer.recorded import folder_of
from twin.component import Component, input, output
from twin.errors import DeclarationError, ScenarioError, SimulationError, TwinError, UnknownNameError
from twin.face import arrays, open_run
from twin.results import RecordedVariable


@pytest.mark.slow
def test_a_branch_from_a_checkpoint(scenario, place, build):
    whole = scenario.run(out=place / "runs", build=build, backend="compiled", checkpoint="10 ms")
    branch = whole.branch("25 ms", {"part.push": "3 N"}, build=build)
    assert branch.passed
    assert "plain, seed 1: continues" in branch.notes[0]
    one, other = (each["part.place"].sel(variant="plain", seed=1).values for each in (whole, branch))
    assert (one == other)[:26].all()
    assert not (one == other)[30:].any()
    with pytest.raises(TwinError, match="is complete: there is nothing to resume"):
        whole.resume(build=build)


@pytest.mark.parametrize("name", twin._PACKAGES)
def test_help_on_a_function_that_is_also_a_package(name):
    """`help(twin.run)`, editors and notebooks show the function's signature and docstring, and no content of the package."""
    package, function = getattr(twin, name), getattr(twin.face, name)
    assert inspect.signature(package) == inspect.signature(function)
    text = pydoc.render_doc(package, renderer=pydoc.plaintext)
    assert len(text.splitlines()) < 40
    assert text.startswith("Python Library Documentation: function in twin")
    assert f"\ntwin.{name}(" in text
    assert all(line.strip() in text for line in inspect.getdoc(function).splitlines())
    assert all(f"{parameter}: " in text for parameter in inspect.signature(function).parameters)


def test_help_on_the_package_lists_all_functions():
    """`run`, `live`, `study` and `follow` were listed as data."""
    text = pydoc.render_doc(twin, renderer=pydoc.plaintext)
    assert "\nDATA\n" not in text
    assert all(f"\n    {name} = twin.{name}(" in text.partition("\nFUNCTIONS\n")[2] for name in twin._PACKAGES)


def test_a_file_that_is_wrong_lists_all_problems(tmp_path):
    file = tmp_path / "wrong.yaml"
    file.write_text(SCENARIO.replace("part.place, at_most", "part.plce, at_most").replace("gain: 5", "gian: 5"))
    with pytest.raises(ScenarioError) as caught:
        twin.load(file)
    assert len(caught.value.problems) == 2
    assert all(str(file) in problem and "Did you mean" in problem for problem in caught.value.problems)
    with pytest.raises(ScenarioError, match="cannot be read"):
        twin.load(tmp_path / "missing.yaml")


def test_set_gives_another_scenario(scenario, place, build):
    before = repr(scenario), scenario.checked
    changed = scenario.set("part.gain", np.float64(3.0)).set("variants.more.part.gain", "4 m/N").set("seeds", [7])
    assert (repr(scenario), scenario.checked) == before
    assert changed.seeds == (7,)
    reached = changed.run(out=place / "other", build=build, report=False, backend="interpreted").metrics
    assert reached.set_index("variant").value.to_dict() == {"plain": 6000.0, "strong": 6000.0, "more": 8000.0}
    assert set(reached.verdict) == {"other settings", "info"}  # as on the card
    for name, value in (
        ("part.gian", 1),
        ("prt.gain", 1),
        ("part.gain", "3 kg"),
        ("stop", 1),
        ("variants.x.part.gain", 1),
    ):
        with pytest.raises(ScenarioError) as caught:
            scenario.set(name, value)
        assert not any("--" in problem for problem in caught.value.problems)


def test_a_variant_that_no_value_changes_is_compared_with_the_paper(scenario, place, build):
    """All were `other settings`; what a value of one variant leaves alone keeps its verdict."""
    options = {"out": place / "partly", "build": build, "report": False, "backend": "interpreted"}
    for name, verdict in (("variants.strong.part.gain", "pass"), ("variants.plain.part.gain", "other settings")):
        metrics = scenario.set(name, 2.5).run(["plain", "strong"], 1, **options).metrics
        assert metrics.set_index("variant").verdict.to_dict() == {"plain": verdict, "strong": "info"}
    both = scenario.set("variants.strong.part.gain", 2.5).set("part.mass", "2 kg").run("plain", 1, **options)
    assert both.metrics.verdict.tolist() == ["other settings"]


@pytest.mark.slow
def test_metrics_are_those_of_the_summary(run):
    frame = run.metrics
    assert list(frame) == ["metric", "variant", "seed", "value", "unit", "paper", "ratio", "verdict"]
    assert frame[frame.seed == 1].set_index("variant").value.to_dict() == {"plain": 4000, "strong": 10000, "more": 4000}
    assert set(frame.unit) == {"mm"}
    assert frame.set_index("variant").verdict.to_dict() == {"plain": "pass", "strong": "info", "more": "info"}
    assert run.requirements.verdict.tolist() == ["pass"]
    assert "expectations" not in dir(run)  # a second name
    verdicts = ["skipped", "pass", "fail", "pass"]
    summary = {"expectations": [{"name": str(k), "verdict": one, "detail": ""} for k, one in enumerate(verdicts)]}
    assert arrays.requirements(summary).name.tolist() == ["2", "1", "3", "0"]  # those that are not judged last
    assert (run.status, run.passed, run.variants, run.seeds) == ("completed", True, ("plain", "strong", "more"), (1, 2))
    assert run.report.read_text().startswith("<!doctype html>")


@pytest.mark.slow
def test_a_signal_has_axes_and_units(run):
    signal = run["part.place"]
    assert signal.dims == ("time", "variant", "seed")
    assert signal.attrs["units"] == "m"
    assert signal.sel(variant="strong", seed=2).values[-1] == 10.0
    # `more` stops earlier
    assert np.isnan(signal.sel(variant="more", seed=1).values[-10:]).all()
    assert signal.time.values[-1] == 0.05
    assert run["part.row"].dims == run.signals["part.row"].dims == ("time", "variant", "seed", "element_of_3")
    np.testing.assert_array_equal(run["part.row"].sel(element_of_3=3), run["part.row[3]"])
    assert run["wave.value" if "wave.value" in run else list(run)[-1]].variant.values.tolist() == ["more"]
    with pytest.raises(UnknownNameError, match=r"Did you mean 'part\.place'") as caught:
        run["part.plce"]
    assert isinstance(caught.value, KeyError)


def test_an_expression_is_read_like_a_signal(run):
    difference = run["part.place - part.row[3]"]
    np.testing.assert_array_equal(
        difference, run["part.place"] - run["part.row[3]"].drop_vars("element_of_3", errors="ignore")
    )
    assert difference.attrs["units"] == "m"
    assert run["part.place * part.push"].attrs["units"] == "m*N"
    assert [run[text].attrs["units"] for text in ("sqrt(part.push)", "part.push**0.5")] == ["N^0.5", "N^0.5"]
    assert run.plot("sqrt(part.push)", interactive=False).axes[0].get_ylabel() == "sqrt(part.push) [N^0.5]"
    assert "units" not in run["part.push ** 1e300"].attrs  # unknown, not dimensionless
    with pytest.raises(UnknownNameError, match=r"Did you mean 'part\.place'"):
        run["part.plce - part.place"]
    with pytest.raises(ScenarioError):
        run["part.place - part.push"]


def test_an_expression_of_temperatures_is_in_its_unit(tmp_path):
    time, temperature = np.arange(3.0), np.array([20.0, -5.0, 40.0])
    column = RecordedVariable("motor.temperature", unit="degC")
    recorded = open_run(folder_of(tmp_path / "run", {("PI", 1): (time, {column.name: temperature})}, [column]))
    for text, expected in {
        "+motor.temperature": temperature,
        "max(motor.temperature, 283.15)": [20.0, 10.0, 40.0],
        "motor.temperature - 283.15": temperature - 10.0,  # a difference
    }.items():
        values = recorded[text]
        assert values.attrs["units"] == "degC"
        np.testing.assert_allclose(values.values[:, 0, 0], expected, atol=1e-9)


def test_all_samples_are_a_table(run):
    frame = run.to_dataframe("part.pl*", "part.row")
    assert list(frame) == ["variant", "seed", "time", "part.place", "part.row[1]", "part.row[2]", "part.row[3]"]
    assert frame.attrs["units"]["part.place"] == "m"
    assert len(frame) == 2 * (51 + 51 + 41)
    assert {"part.place", "part.odd"} <= {*run.to_dataframe()}
    with pytest.raises(UnknownNameError, match=r"Did you mean 'part\.place'"):
        run.to_dataframe("part.plce")


def test_a_scenario_is_stepped_from_python(scenario, run, build):
    with scenario.simulate("strong", 2, build=build) as simulation:
        while simulation.time < 0.03:
            simulation.advance()
        assert simulation["part.push"] == 2.0  # the event at 10 ms
        simulation.advance(until="50 ms")
    recorded = run["part.place"].sel(variant="strong", seed=2).values
    np.testing.assert_array_equal(simulation.results["part.place"], recorded)
    with scenario.simulate(build=build) as simulation:
        simulation.advance("50 ms")  # past the event in one call
    np.testing.assert_array_equal(simulation.results["part.place"], run["part.place"].sel(variant="plain", seed=1))
    with pytest.raises(ScenarioError, match="strong"):
        scenario.simulate("strng", build=build)


class FakeWall:
    """A wall clock that only sleeping moves."""

    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now

    def sleep(self, duration):
        self.now += duration


def test_a_live_simulation_is_the_run_at_the_rate_of_the_wall_clock(place, run, build, monkeypatch):
    wall = FakeWall()
    monkeypatch.setattr("twin.face.simulation.wall", wall)
    with twin.live(place / "pushed.yaml", "strong", 2, backend="interpreted", build=build) as simulation:
        assert (simulation.rate, simulation.stop_time) == (1.0, 0.05)
        simulation.advance("20 ms")
        assert wall.now == pytest.approx(100.02)
        wall.now += 0.1  # of the caller's own code
        simulation.advance()
        assert simulation.lag == pytest.approx(0.1)
        simulation.rate = 0.5
        simulation.advance(until=simulation.stop_time)
        assert wall.now == pytest.approx(100.12 + 0.029 / 0.5)
        with pytest.raises(TwinError, match=r"after the stop, 50 ms\. Create"):
            simulation.advance()
        for rate in (0, 100, "fast"):
            with pytest.raises(TwinError, match=r"rate: .+ is not a rate"):
                simulation.rate = rate
        assert "<td class=number>10 m</td>" in simulation._repr_html_()
    assert "closed" in simulation._repr_html_()
    recorded = run["part.place"].sel(variant="strong", seed=2).values
    np.testing.assert_array_equal(simulation.results["part.place"], recorded)


@pytest.mark.slow
def test_a_scenario_is_run_or_stepped_with_values_in_one_call(place, build):
    values = {"part.mass": "2 kg", "variants.strong.part.gain": 4}
    run = twin.run(
        place / "pushed.yaml", "strong", 1, values=values, out=place / "called", build=build, backend="compiled"
    )
    assert run["part.place"].values[-1] == 8.0
    with twin.live(run.scenario, "strong", rate=float("inf"), backend="interpreted", build=build) as simulation:
        assert simulation["part.mass"] == 2.0
        assert simulation.variable("part.mass").unit == "kg"
        with pytest.raises(UnknownNameError, match="Did you mean"):
            simulation.variable("part.mas")
        while simulation.time < simulation.stop_time:
            simulation["part.push"] = "1000 mN"
            simulation.advance()
    assert simulation.results["part.place"].iloc[-1] == 4.0


def test_all_problems_of_values_are_reported(place):
    """Those of the file's keys and those of members' variables: the first alone was in `problems`."""
    values = {"part.mass": "2 N", "step": "3 kg", "part.gian": 1}
    with pytest.raises(ScenarioError) as caught:
        twin.run(place / "pushed.yaml", values=values)
    assert [line.partition("=")[0] for line in caught.value.problems] == ["set part.gian", "set part.mass", "set step"]
    with pytest.raises(ScenarioError) as caught:
        twin.load(place / "pushed.yaml")._with_values({"part.mass": "2 N", "part.gian": 1})
    assert len(caught.value.problems) == 2


def test_a_scenario_is_pickled(scenario, place, build):
    """With what was set, for processes that run it; `live` has one case."""
    faster = pickle.loads(pickle.dumps(scenario.set("part.gain", 4.0)))
    assert (repr(faster), faster.checked.overrides) == (repr(scenario), ("part.gain=4.0",))
    with faster.simulate("plain", backend="interpreted", build=build) as simulation:
        assert simulation["part.gain"] == 4.0
        assert simulation["part.gain [mm/N]"] == 4000.0
        with pytest.raises(TwinError, match=r"part\.gain: m/N does not convert to kg\."):
            simulation["part.gain [kg]"]
    for chosen, kind in (({"variant": ["plain", "strong"]}, "variant"), ({"seed": [1, 2]}, "seed")):
        with pytest.raises(TwinError, match=f"{kind}: a simulation has one, not 2"):
            twin.live(scenario, **chosen, build=build)


def test_a_step_that_cannot_be_taken_names_its_duration(scenario, build):
    """It named the time that would be reached, rounded: `1 s is no communication point`."""
    with scenario.simulate("plain", backend="interpreted", build=build) as simulation:
        simulation.advance("20 ms")
        for given, text in (
            ({"duration": "0.0000000001 s"}, "duration 1e-10 s is no multiple of the step, 1 ms"),
            ({"until": "20.5 ms"}, "until 20.5 ms is no multiple of the step, 1 ms"),
            ({"duration": "100 ms"}, "120 ms is after the stop, 50 ms. Advance by at most 30 ms more"),
        ):
            with pytest.raises(TwinError, match=re.escape(f"advance: {text}")):
                simulation.advance(**given)
    with pytest.raises(TwinError, match="rate: 50 is not a rate"):
        twin.live("a scenario that is not read", rate=50)


def test_a_value_outside_of_the_stated_range_is_noted_once(place, build, caplog):
    """As of `twin run --set`; it was set without a word."""
    file = place / "ranged.yaml"
    file.write_text(SCENARIO + "console: {parameters: {part.gain: [1 m/N, 5 m/N]}}\n")
    warning = "warning: part.gain=30 m/N is outside of 1 m/N to 5 m/N."
    with twin.live(file, "plain", rate=float("inf"), backend="interpreted", build=build) as simulation:
        simulation["part.gain"] = 3.0
        assert (simulation.notes, caplog.messages) == ([], [])
        simulation["part.gain"] = simulation["part.gain"] = "30 m/N"
        assert (simulation.notes, caplog.messages) == ([warning], [warning])
    values = {"part.gain": "30 m/N"}
    with twin.live(file, "plain", values=values, backend="interpreted", build=build) as simulation:
        assert simulation.notes == [warning]


def test_one_thread_advances_a_simulation(scenario, build):
    """Another is refused, and `close` waits for the end of the step: the members are freed after it."""
    problems = []

    def advance(_time):
        thread = threading.Thread(target=interfere)
        thread.start()
        thread.join()

    def interfere():
        with pytest.raises(TwinError, match="another thread is advancing") as caught:
            simulation.advance()
        problems.append(caught.value)

    simulation = scenario.simulate("plain", backend="interpreted", build=build)
    simulation.advance("1 ms", progress=advance)
    assert (bool(problems), simulation.time) == (True, 0.001)
    simulation.rate = 0.1
    thread = threading.Thread(target=lambda: simulation.advance("40 ms"))
    thread.start()
    while thread.is_alive() and simulation.time == 0.001:
        time.sleep(0.001)
    simulation.close()
    thread.join()
    assert 0.001 < simulation.results.time.iloc[-1] < 0.04


def test_packages_that_are_functions_show_their_arguments():
    for name in ("follow", "live", "run"):
        package = getattr(twin, name)
        assert str(inspect.signature(package)) == str(inspect.signature(getattr(twin.face, name)))


def test_whole_numbers_and_booleans_stay(scenario, place, build):
    run = scenario.run("plain", 1, out=place / "one", build=build, report=False, backend="compiled")
    assert (run["part.count"].dtype, run["part.odd"].dtype) == (np.int64, np.bool_)
    assert run["part.count"].values[:, 0, 0].tolist() == list(range(51))
    with pytest.raises(twin.TwinError, match="report=True"):
        run.report  # noqa: B018


@pytest.mark.slow
def test_plots_by_title_and_by_signals(run, tmp_path):
    for names in ((), ("Places",), ("part.place",), ("part.place", "part.push", "abs(part.place - part.row[1])")):
        figure = run.plot(*names, variants="plain")
        figure.savefig(tmp_path / "plot.png")
        assert figure._repr_svg_().startswith("<svg")
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels == ["length [mm]", "part.push [N]"]
    for names in (("Place",), ("part.plce",), ("part.place + part.push",), ("part.row",), ("part.place +",)):
        with pytest.raises(twin.TwinError):
            run.plot(*names)
    with pytest.raises(twin.TwinError, match="There are variants plain"):
        run.plot("Places", variants="none")


def test_all_signals_are_a_dataset(run):
    assert list(run) == list(run.signals.data_vars)
    assert run.signals["part.place"].attrs["units"] == "m"
    assert run.signals["part.place"].dims == ("time", "variant", "seed")
    assert run.signals["part.row"].sizes["element_of_3"] == 3
    assert run.signals.variant.values.tolist() == ["plain", "strong", "more"]
    assert run.signals.seed.values.tolist() == [1, 2]
    signal = run.signals["part.place"].sel(variant="strong", seed=2)
    np.testing.assert_array_equal(signal, run["part.place"].sel(variant="strong", seed=2))


class FakeFigure:
    """Records what is added to a figure of plotly."""

    def __init__(self, rows, columns, **options):
        self.rows, self.options, self.curves, self.labels = rows, options, [], []

    def add_traces(self, traces, rows, cols):
        self.curves += [(rows, trace) for trace in traces]

    def update_yaxes(self, title_text, row):
        self.labels.append(title_text)

    def add_vline(self, x, **options):
        self.labels.append(x)

    def update_xaxes(self, title_text, row):
        self.labels.append(title_text)

    def update_layout(self, **options):
        self.options |= options


def test_an_interactive_plot(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "plotly.subplots", SimpleNamespace(make_subplots=FakeFigure))
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", SimpleNamespace(Scatter=dict))
    figure = run.plot("part.pl*", "part.push", variants=["plain", "strong"], interactive=True)
    assert (figure.rows, figure.options["shared_xaxes"]) == (2, True)
    assert figure.labels == [0.01, "part.place [mm]", 0.01, "part.push [N]", "time [s]"]
    assert [row for row, _ in figure.curves] == [1] * 6 + [2] * 6  # low, high, mean
    (_, low), (_, _), (_, first), *_, (_, other) = figure.curves[:6]
    assert (first["name"], first["showlegend"], low["showlegend"]) == ("plain", True, False)
    assert (other["name"], other["y"][-1]) == ("strong", pytest.approx(1e4))
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(TwinError, match=r"pip install 'catheter-twin\[plotly\]'"):
        run.plot("part.place", interactive=True)


@pytest.mark.slow
def test_an_earlier_run_is_read_when_asked(run, place, tmp_path):
    earlier = twin.open_run(place / "runs" / "pushed" / "latest")
    assert earlier.folder == run.folder
    assert earlier.metrics.equals(run.metrics)
    assert earlier["part.place"].equals(run["part.place"])
    assert earlier.plot("Places").axes
    assert (earlier.scenario.title, earlier.scenario.name) == ("Pushed", "pushed")
    assert "Pushed" in earlier._repr_html_()
    copy = tmp_path / "pushed"
    for name in ("2026-01-01_00-00-00_2", "2026-01-01_00-00-00_10", "2025-12-31_00-00-00"):
        shutil.copytree(run.folder, copy / name)
    (copy / "2026-01-01_00-00-01").mkdir()  # has not written its summary
    assert twin.open_run(str(copy / "latest")).folder.name == "2026-01-01_00-00-00_10"
    for wrong in (
        copy,
        copy / "2026-01-01_00-00-01",
        copy / "none",
        tmp_path / "none" / "latest",
        tmp_path / "puhsed/latest",
    ):
        with pytest.raises(twin.TwinError) as caught:
            twin.open_run(wrong)
        assert len(caught.value.problems) == 1
    (copy / "2025-12-31_00-00-00" / "signals.parquet").unlink()
    rest = twin.open_run(copy / "2025-12-31_00-00-00")
    assert len(rest.metrics) == 6
    with pytest.raises(twin.TwinError, match="does not exist any more"):
        rest["part.place"]
    (copy / "2025-12-31_00-00-00" / "summary.json").write_text("{")
    with pytest.raises(twin.TwinError, match="cannot be read"):
        twin.open_run(copy / "2025-12-31_00-00-00")


@pytest.mark.slow
def test_a_notebook_shows_verdicts_and_the_system(run, scenario):
    text = run._repr_html_()
    assert text.count("<svg") == 2  # the first plot, and the system
    assert "requirements met" in text
    assert "reached" in text
    assert "✓ pass" in text
    assert "strong" in scenario._repr_html_()
    assert "#000" not in text
    assert f'<a href="{run.report.as_uri()}">Report</a>' in text
    assert "max-width: 100%" in text  # of a plot that would be wider than the notebook
    assert float(re.search(r'<svg[^>]* width="([\d.]+)pt"', text)[1]) < 72 * 7
    lines = str(run).splitlines()
    assert (lines[0], lines[-1]) == ("Pushed: ✓ 2 of 2 requirements met", str(run.folder))


@pytest.mark.slow
def test_progress_is_told_to_a_function(scenario, place, build, capsys):
    seen = []
    scenario.run("plain", [1], progress=lambda name, part: seen.append((name, part)), out=place / "told", build=build)
    assert ("plain, seed 1", 1.0) in seen
    assert capsys.readouterr() == ("", "")


def test_an_interruption_returns_what_there_is(scenario, place, build):
    def interrupt(name, part):
        if name == "strong, seed 1":
            raise KeyboardInterrupt

    run = scenario.run(progress=interrupt, out=place / "stopped", build=build, report=False, backend="compiled")
    assert run.status == "interrupted"
    assert "strong" in run.reason
    assert run["part.place"].sel(variant="plain", seed=2).values[-1] == 4.0


def test_nothing_recorded_is_an_empty_array(run):
    empty = arrays.array(run.variable("part.row"), {})
    assert (empty.dims, empty.size, empty.attrs["units"]) == (("time", "variant", "seed", "element_of_3"), 0, "m")


@pytest.mark.slow
def test_a_class_takes_a_members_place(scenario, place, build):
    class Local(Types):
        """Of this function alone."""

        def step(self, t, h):
            self.place = 7.0

    run = scenario.set("part.component", Local).run("plain", 1, out=place / "cls", build=build, report=False)
    assert run.metrics.value.tolist() == [7000.0]
    with pytest.raises(ScenarioError, match="not a component"):
        scenario.set("part.component", dict)


@pytest.mark.slow
class Misspelled(Types):
    """A component that cannot be compiled."""

    def step(self, t, h):
        self.place = self.gian * self.push


def test_a_run_in_which_no_case_can_begin_raises(scenario, place, build):
    with pytest.raises(
        ScenarioError, match=r"Misspelled .*test_run.py:\d+.: `self.gian` is not declared. Did you mean `gain`"
    ):
        scenario.set("part.component", Misspelled).run(out=place / "runs", build=build)


class Foreign(Types):
    """A component in a unit that does not exist."""

    push = input("foo", "force")


class Lacking(Component):
    """A component without what the scenario connects and plots."""

    row = output("m", "one place")

    def step(self, t, h):
        self.row = t


def test_a_class_that_does_not_fit_is_named_with_what_it_lacks(scenario):
    """There was a line for each use in the scenario file, none of which named the class."""
    line = Lacking.step.__code__.co_firstlineno - 5
    with pytest.raises(ScenarioError) as caught:
        scenario.set("part.component", Lacking)
    problems = [problem for problem in caught.value.problems if "as `part`" in problem]
    name, text = "tests/face/test_run.py", "needs input push [N], output place [m], parameter gain [m/N]. Declare them."
    assert problems == [f"{name}:{line}: Lacking: as `part` of pushed it {text}"]
    assert not any("part has no variable" in problem for problem in caught.value.problems)
    with pytest.raises(
        ScenarioError, match=r"^tests/face/test_run\.py:\d+: Foreign: push: unit 'foo' is not known"
    ) as caught:
        scenario.set("part.component", Foreign)
    assert len(caught.value.problems) == 1


def test_a_misspelled_variable_or_a_value_of_another_kind_says_what_there_is():
    part = Types()
    with pytest.raises(AttributeError, match=r"'Types' object has no attribute 'plce'\. Did you mean 'place'\?"):
        part.plce  # noqa: B018
    assert not hasattr(part, "_repr_png_")
    for value in ("1 N", [1.0, 2.0]):
        for give in (lambda value=value: setattr(part, "push", value), lambda value=value: Types(push=value)):
            with pytest.raises(DeclarationError, match=r"Types\.push: .* does not fit\. Give a number in N\."):
                give()


@pytest.mark.slow
def test_type_checkers_know_values_and_tables(tmp_path):
    """`simulation[...]`, `run[...]` and the fields of a component were Any."""
    file = tmp_path / "typed.py"
    fields = {"force": 'input("N", "a")', "row": 'output("m", "b", shape=(3,))', "gain": 'parameter(1.0, "1", "c")'}
    file.write_text(
        "import twin\nfrom twin.component import Component, input, output, parameter\n\nclass C(Component):\n"
        + "".join(f"    {name} = {text}\n" for name, text in fields.items())
        + '    def step(self, t: float, h: float) -> None:\n        self.force = "1 N"\n        self.row[0] = self.gain\n'
        + 'reveal_type(C().gain)\nreveal_type(twin.live("x")["y"])\nreveal_type(twin.run("x")["y"])\n'
        + 'twin.run("x", backend="nativ")\ntwin.live("x", backend="nativ")\ntwin.export("x", fmi="3")\n'
    )
    environment = {**os.environ, "MYPYPATH": str(Path(twin.__file__).parents[1])}
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "typed.py"]
    done = subprocess.run(command, check=False, cwd=tmp_path, env=environment, capture_output=True, text=True)
    lines = [line.partition("typed.py:")[2] for line in done.stdout.splitlines() if line.startswith("typed.py:")]
    assert lines[0].startswith("9: error: Incompatible types in assignment")
    assert ['"float"' in lines[1], '"float | numpy.ndarray' in lines[2], "DataArray" in lines[3]] == [True] * 3
    assert [line.rpartition("; expected ")[2][:8] for line in lines[4:]] == ['"Literal'] * 3


def test_a_method_of_a_run_is_found_by_its_name():
    with pytest.raises(AttributeError, match=r"It belongs to a run: run\.compare"):
        twin.compare  # noqa: B018


def test_an_editor_completes_public_names():
    """Static completion lists what the file imports: `importlib`, `ModuleType`, `PACKAGES`."""
    tree = ast.parse(Path(twin.__file__).read_text(encoding="utf-8"))
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    defined = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    defined |= {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    assert {name for name in imported | defined if not name.startswith("_")} - {"name", "hint"} == set(twin.__all__)


class Divides(Types):
    """A component that divides by zero."""

    def step(self, t, h):
        self.place = self.gain / (self.push - self.push)


class DividesOnce(Types):
    """A component that divides by zero in one step."""

    def step(self, t, h):
        self.place = self.gain / (t - 0.02)


@pytest.mark.parametrize("cls", [Divides, DividesOnce])
@pytest.mark.parametrize("backend", ["interpreted", "compiled", pytest.param("fmu", marks=pytest.mark.slow)])
def test_a_division_by_zero_is_reported_with_file_and_line(scenario, place, build, backend, cls):
    failing = scenario.set("part.component", cls).set("seeds", [1])
    with pytest.raises(SimulationError) as caught:
        failing.run("plain", out=place / "divided", build=build, backend=backend, report=False)
    line = cls.step.__code__.co_firstlineno + 1
    run = caught.value.run
    assert (run.status, run.passed, "part.push" in run) == ("failed", False, True)
    assert f"{__file__}:{line}: " in run.reason
    assert [run.reason, f"What was recorded is in {run.folder}, and here as error.run."] == caught.value.problems
    with pytest.raises(TwinError, match="failed: plain, seed 1"):
        run.check()


def test_a_requirement_that_is_not_met_raises_where_it_is_checked(scenario, place, build):
    stiff = scenario.set("part.gain", 100.0).run("plain", 1, out=place / "stiff", build=build, backend="interpreted")
    with pytest.raises(TwinError) as caught:
        stiff.check()
    assert caught.value.problems[0].endswith("✗ 1 failed · 1 not judged")
    assert caught.value.problems[1].startswith("FAIL part.place")
    met = scenario.run("plain", 1, out=place / "met", build=build, backend="interpreted")
    assert met.check() is met


def test_a_signal_of_variants_that_were_not_run(scenario, place, build):
    """It was an empty array in `run[...]`, and NaN in `run.signals`."""
    run = scenario.run("plain", 1, out=place / "alone", build=build, report=False, backend="interpreted")
    assert "wave.position" not in [*run, *run.signals]
    for read in (run.__getitem__, run.plot, run.to_dataframe, run.variable):
        with pytest.raises(UnknownNameError, match=r"plain has no 'wave\.position'\. Run more\."):
            read("wave.position")


def test_an_export_is_refused_or_made(fmu, scenario, tmp_path, build):
    assert fmu.exists()
    for arguments, text in (
        ({"what": Types, "path": fmu}, "force=True"),
        ({"what": Types, "fmi": "4.0"}, "2.0"),
        ({"what": "typs"}, "no component"),
        ({"what": Types, "members": "part"}, "need a scenario"),
        ({"what": scenario}, "members"),
        ({"what": scenario, "members": ["prt"]}, "Did you mean"),
        ({"what": Types, "platforms": "x86"}, "not known"),
    ):
        with pytest.raises(twin.TwinError, match=text) as caught:
            twin.export(**{"path": tmp_path / "no.fmu", "build": build, **arguments})
        assert "--" not in str(caught.value)
    part = twin.export(scenario, tmp_path / "part.fmu", members=["part"], variant="strong", fmi="2.0", build=build)
    assert (
        twin.simulate(part, stop_time=0.1, step_size=0.05, start_values={"part.push": 1}).iloc[-1]["part.place"] == 5.0
    )


@pytest.mark.slow
def test_without_pandas_the_rest_goes_and_the_error_says_what_to_install(run):
    code = f"""
import json, sys, twin

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in ("pandas", "xarray"):
            raise ModuleNotFoundError(name, name=name)

sys.meta_path.insert(0, Missing())
run = twin.open_run({str(run.folder)!r})
said = []
for ask in (lambda: run.metrics, lambda: run["part.place"]):
    try:
        ask()
    except twin.TwinError as error:
        said += error.problems
print(json.dumps([run.passed, said]))
run.plot("Places")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    passed, said = json.loads(done.stdout)
    assert passed
    assert ["catheter-twin[python]" in line for line in said] == [True, True]
