"""Plots of a run in Python: which signals of which cases they show, in which units, from a run that a test writes.

Over 400 lines: plots of runs, simulations and two runs share one run.
"""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.viewer.recorded import FORCE, PLACE, SHAPE, folder_of
from twin.errors import TwinError, UnknownNameError
from twin.face import open_run, open_study
from twin.results import RecordedVariable, plotting

SCENARIO = """
title: Rig
stop_time: 1 s
members: {tip: {component: "no.such.module:Tip"}, sensor: {component: "no.such.module:Sensor"}}
variants: {PI: {}, PI+FF: {}}
plots:
  - {title: Place, signals: [tip.position, tip.depth]}
  - {title: Loop, xy: [tip.position, sensor.force], unit: mN}
  - {title: Mixed, signals: [sensor.force, tip.position]}
"""
DEPTH = RecordedVariable("tip.depth", unit="m", display_unit="mm")
CASES = [("PI", 1), ("PI", 2), ("PI+FF", 1), ("PI+FF", 2)]
TIME = np.arange(5) * 0.25


@pytest.fixture
def run(tmp_path):
    values = {name: np.sin(TIME) for name in ("sensor.force", "tip.position", "tip.depth")}
    recorded = dict.fromkeys(CASES, (TIME, values | {"tip.shape": np.outer(TIME, [1.0, 2.0])}))
    folder = folder_of(tmp_path / "run", recorded, [FORCE, PLACE, DEPTH, SHAPE])
    (folder / "scenario.yaml").write_text(SCENARIO)
    return open_run(folder)


def test_panels_begin_and_end_below_each_other(run):
    """Numbers of different widths moved them. Over the same time, they share the axis, and only the last one has its label."""
    figure = run.plot("1e6 * tip.position", "sensor.force", variants="PI", interactive=False)
    boxes = [axis.get_position() for axis in figure.axes]
    assert len({(round(box.x0, 6), round(box.x1, 6)) for box in boxes}) == 1
    first, last = figure.axes
    assert (first.get_xlabel(), last.get_xlabel()) == ("", "time [s]")
    last.set_xlim(0.25, 0.5)
    assert first.get_xlim() == (0.25, 0.5)


@pytest.mark.parametrize("is_interactive", [False, True])
def test_a_figure_says_its_cases_and_shows_seeds_as_the_viewer(tmp_path, is_interactive):
    """Mean and range of the seeds, a color for each variant in any figure; it was one seed, the other pale, without a word."""
    if is_interactive:
        pytest.importorskip("plotly")
    cases = {case: (TIME, {"sensor.force": TIME + case[1]}) for case in CASES}
    cases["PI+FF", 2] = (TIME[:3], {"sensor.force": TIME[:3] + 2})
    run = open_run(folder_of(tmp_path / "run", cases, [FORCE]))

    def look(**chosen):
        figure = run.plot("sensor.force", interactive=is_interactive, **chosen)
        if is_interactive:
            lines = [(line.line.color, line.y.tolist()) for line in figure.data if line.line.width]
            return figure.layout.annotations[0].text, lines, len(figure.data) > len(lines)
        lines = [(line.get_color(), line.get_ydata().tolist()) for line in figure.axes[0].lines]
        return figure._suptitle.get_text(), lines, bool(figure.axes[0].collections)

    blue, orange = plotting.COLORS[:2]
    assert look(variants="PI") == ("PI, mean and range of seeds 1-2", [(blue, (TIME + 1.5).tolist())], True)
    title, lines, has_range = look(variants="PI+FF")
    assert (title, lines) == (
        "PI+FF, mean and range of seeds 1-2",
        [(orange, [*(TIME[:3] + 1.5), *(TIME[3:] + 1)])],
    )
    assert has_range
    assert look(variants="PI+FF", seeds=1) == ("PI+FF, seed 1", [(orange, (TIME + 1).tolist())], False)
    if not is_interactive:  # a long title does not lie on the legend, also in a narrow figure
        figure = run.plot("sensor.force", "2 * sensor.force", variants="PI+FF", interactive=False)
        figure.set_size_inches(3.0, 3.0)
        figure.draw_without_rendering()
        assert not figure.legends[0].get_window_extent().overlaps(figure._suptitle.get_window_extent())
    title, lines, _ = look()
    assert title == "mean and range of seeds 1-2"
    assert [color for color, _ in lines] == [blue, orange]


def test_an_interactive_plot_has_a_picture_for_exported_pages(run, monkeypatch):
    """nbconvert shows no data of plotly: its cells were blank."""
    monkeypatch.setattr("twin.face.signal_plots.in_notebook", lambda: True)
    figure = SimpleNamespace(_repr_mimebundle_=lambda: {"application/vnd.plotly.v1+json": {}})
    monkeypatch.setattr("twin.face.signal_plots.interactive_figure", lambda *_: figure)
    bundle = run.plot("sensor.force", interactive=True)._repr_mimebundle_(include=None, exclude=None)
    assert bundle["text/html"].startswith('<div class="twin">')
    assert "<svg" in bundle["text/html"]
    assert figure._ipython_display_ is None
    assert set(bundle) == {"text/html", "application/vnd.plotly.v1+json"}


@pytest.fixture(scope="module", params=[1, 2, 5])
def several(request, tmp_path_factory):
    """A run of some variants, with three seeds and signals of three units; the last variant is longer."""
    count = request.param
    variables = [
        RecordedVariable(f"{member}.{name}", unit=unit)
        for member, name, unit in (
            ("a", "force", "N"),
            ("a", "place", "m"),
            ("b", "force", "N"),
            ("b", "place", "m"),
            ("b", "rate", "Hz"),
        )
    ]
    cases = {
        (f"v{variant}", seed): (TIME * (1 + variant / 4), {each.name: TIME * seed for each in variables})
        for variant in range(count)
        for seed in (1, 2, 3)
    }
    return open_run(folder_of(tmp_path_factory.mktemp("several") / "run", cases, variables))


@every_case("what", [("*.force", "a.place"), ("a.place", "*.force"), ("b.rate", "*.place", "a.force"), ("b.*", "a.*")])
@pytest.mark.parametrize("seeds", [1, [1, 2, 3]])
def test_panels_share_the_time_whatever_their_number_and_order(several, what, seeds):
    """One axis for all, with the whole time; an axis that was shared already raised an error."""
    figure = several.plot(*what, seeds=seeds, interactive=False)
    axes = [axis for axis in figure.axes if axis.get_visible()]
    last = (TIME[-1] - TIME[0]) * (1 + (len(several.variants) - 1) / 4)
    assert {axis.get_xlim() for axis in axes} == {(0.0, last)}
    assert [axis.get_xlabel() for axis in axes] == [""] * (len(axes) - 1) + ["time [s]"]
    axes[0].set_xlim(0.25, 0.5)
    assert {axis.get_xlim() for axis in axes} == {(0.25, 0.5)}


@pytest.fixture
def drawn(monkeypatch):
    """What is drawn instead of a figure: (title, unit, unit of x, label, curves) of each plot, and the cases."""
    found = []

    figure = SimpleNamespace(_repr_svg_=lambda: '<svg><path fill="#ffffff"/><text fill="#1f2933">t</text></svg>')

    def plot_figure(plots, cases, marks, variants):
        found[:] = [
            [
                (
                    plot.title,
                    plot.unit,
                    plot.x_unit,
                    plot.label,
                    plot.per_variant,
                    [(curve.label, curve.signal.text) for curve in plot.curves],
                )
                for plot in plots
            ],
            list(cases),
            (marks, variants),
        ]
        return figure

    monkeypatch.setattr(plotting, "plot_figure", plot_figure)
    return found


PLACES = ("Place", "mm", "", "", False, [("tip.position", "tip.position"), ("tip.depth", "tip.depth")])


def names_of(plots):
    return [plot[0] for plot in plots]


def test_plots_of_the_scenario(run, drawn):
    """Without a unit they have that of their signals, if that is one."""
    html = run.plot()._repr_html_()
    assert 'fill="currentColor"' in html  # legible in a dark notebook
    assert "#ffffff" not in html
    plots, cases, more = drawn
    assert (names_of(plots), cases, more) == (["Place", "Loop", "Mixed"], CASES, ([], ("PI", "PI+FF")))
    assert [(plot[1], plot[2]) for plot in plots] == [("mm", ""), ("mN", "mm"), ("", "")]
    run.plot("Loop", "Place")
    assert names_of(drawn[0]) == ["Loop", "Place"]


def test_plots_of_signals_are_grouped_by_unit(run, drawn):
    """One signal names its axis; several are labeled, one panel a variant. Plots of the scenario come first."""
    run.plot("tip.position", "sensor.force", "Place", "tip.depth - tip.position")
    plots = drawn[0]
    assert plots[0][:2] == PLACES[:2]
    assert plots[1:] == [
        (
            "",
            "mm",
            "",
            "",
            True,
            [("tip.position", "tip.position"), ("tip.depth - tip.position", "tip.depth - tip.position")],
        ),
        ("", "N", "", "sensor.force", False, [("sensor.force", "sensor.force")]),
    ]


def test_two_runs_in_one_plot(run):
    """In the same color, the other dashed; the panel of a variant shows it of both."""
    cases = {("PI", 1): (TIME, {"sensor.force": TIME, "tip.position": TIME, "tip.depth": TIME})}
    other = open_run(folder_of(run.folder.parent / "other", cases, [FORCE, PLACE, DEPTH]))

    def curves(figure):
        return [(line.get_label(), line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines]

    figure = run.plot("sensor.force", variants="PI", other=other, interactive=False)
    blue, orange = plotting.COLORS[:2]
    assert curves(figure) == [("PI", blue, "-"), ("PI (other run)", blue, "--")]
    assert curves(run.plot("tip.position", "tip.depth", other=other, interactive=False)) == [
        (f"{name}{mark}", color, style)
        for mark, style in (("", "-"), (plotting.OTHER_RUN, "--"))
        for name, color in (("tip.position", blue), ("tip.depth", orange))
    ]


def test_an_expression_is_named_where_its_axis_is_too_short(run):
    text = "sensor.force - 2 * sensor.force + 3 * sensor.force"
    figure = run.plot(text, variants="PI", seeds=1, interactive=False)
    assert (figure._suptitle.get_text(), figure.axes[0].get_ylabel()) == (f"{text}: PI, seed 1", "force [N]")


def test_a_signal_has_one_color_whatever_variants_are_run(run, tmp_path):
    values = {"tip.position": TIME, "tip.depth": TIME}
    single = open_run(folder_of(tmp_path / "single", {("PI", 1): (TIME, values)}, [PLACE, DEPTH]))
    for each in (run, single):
        figure = each.plot("tip.position", "tip.depth", interactive=False)
        assert [line.get_color() for line in figure.axes[0].lines] == list(plotting.COLORS[:2])


def test_a_plot_of_some_time_or_over_a_signal(run):
    """In the words of a simulation and of a scenario: `start`, `stop`, `xy`."""
    for what in ("Place", "tip.position"):
        (axis,) = run.plot(what, variants="PI", start="250 ms", stop=0.75, interactive=False).axes
        assert axis.get_xlim() == (0.25, 0.75)
    figure = run.plot(xy=("tip.position [um]", "sensor.force"), variants="PI", start=0.5, interactive=False)
    assert [(axis.get_xlabel(), axis.get_ylabel()) for axis in figure.axes] == [
        ("tip.position [um]", "sensor.force [N]")
    ]
    assert figure.axes[0].lines[0].get_ydata().tolist() == np.sin(TIME[2:]).tolist()


def test_signals_in_another_unit(run):
    force, milli = run["sensor.force"], run["sensor.force [mN]"]
    np.testing.assert_allclose(milli, force * 1000)
    assert milli.attrs["units"] == "mN"
    assert run["tip.depth - tip.position [um]"].attrs["units"] == "um"
    assert run.plot("sensor.force [mN]", variants="PI", interactive=False).axes[0].get_ylabel() == "sensor.force [mN]"
    with pytest.raises(TwinError, match=r"sensor\.force: N does not convert to mm\."):
        run["sensor.force [mm]"]


def test_without_plots_in_the_scenario_the_first_scalars_are_shown(run, drawn):
    (run.folder / "scenario.yaml").write_text(SCENARIO.partition("plots:")[0])
    run.plot()
    shown = [text for plot in drawn[0] for _, text in plot[-1]]
    assert sorted(shown) == ["sensor.force", "tip.depth", "tip.position"]


@pytest.mark.parametrize(
    ("chosen", "cases"),
    [
        ({"variants": "PI"}, CASES[:2]),
        ({"seeds": 2}, CASES[1::2]),
        ({"variants": ["PI", "PI+FF"], "seeds": [1]}, CASES[::2]),
        ({"variants": "PI+FF", "seeds": (1, 2)}, CASES[2:]),
    ],
)
def test_cases_of_a_plot(run, drawn, chosen, cases):
    run.plot("Place", **chosen)
    assert drawn[1] == cases


def test_what_cannot_be_plotted(run, drawn, monkeypatch):
    for chosen, which in (({"variants": ["PI", "PID"]}, "'PID'"), ({"seeds": [1, 9]}, "9")):
        with pytest.raises(
            TwinError, match=rf"run: nothing was run with {which}\. There are variants PI, PI\+FF; seeds "
        ):
            run.plot("Place", **chosen)
    with pytest.raises(UnknownNameError, match=r"'Plac' was not recorded.*Did you mean 'Place'\?"):
        run.plot("Plac")
    with pytest.raises(UnknownNameError, match=r"'tip\.x' was not recorded"):
        run.plot("tip.x")
    with pytest.raises(TwinError, match=r"run: .*tip\.shape"):
        run.plot("abs(tip.shape)")
    for name in ("tip.shape", "tip.sh*"):
        with pytest.raises(TwinError, match=r"tip\.shape is an array .*tip\.shape\[1\]"):
            run.plot(name)
    for call in (run.plot, run.__getitem__):
        with pytest.raises(
            UnknownNameError, match=r"run: 'tip' is a member\. .* 'tip\.position', 'tip\.depth', 'tip\.s"
        ):
            call("tip")
    for given, problem in (
        ({"start": 3, "stop": "2 s"}, "start: 3 s is not before 2 s"),
        ({"start": "2 m"}, "start: "),
        ({"xy": "tip.position"}, "xy: 'tip.position' is not two signals"),
    ):
        with pytest.raises(TwinError, match=problem):
            run.plot("Place", interactive=False, **given)
    with pytest.raises(TwinError, match=r"tip\.position is in m, which does not convert to N"):
        run.plot("tip.position [N]")
    monkeypatch.setattr(plotting, "plot_figure", lambda *_, **__: None)
    with pytest.raises(TwinError, match="in these variants and at these times"):
        run.plot("Place", start=5)
    with pytest.raises(TwinError, match=r"none of the signals was recorded in these variants\. Choose others\."):
        run.plot("Place")
    failed = open_run(run.folder)
    failed.summary["cases"], failed.summary["reason"] = [], "no bus."
    with pytest.raises(TwinError, match=r"nothing was run\. The run failed: no bus\."):
        failed.plot("Place", variants="PID")


def test_a_run_is_pickled_by_its_folder(run):
    run.notes.append("a note")
    again = pickle.loads(pickle.dumps(run))
    assert (again.folder, again.notes, list(again)) == (run.folder, run.notes, list(run))
    assert again["sensor.force"].equals(run["sensor.force"])


def test_a_run_says_what_it_is(run):
    single = open_run(folder_of(run.folder.parent / "single", {("PI", 1): (TIME, {"sensor.force": TIME})}, [FORCE]))
    assert repr(single).endswith(", 1 variant x 1 seed>")
    assert repr(run) == f"<Run {run.folder}: completed, passed, 2 variants x 2 seeds>"
    assert ("tip.shape" in run, "tip.shape[1]" in run, 3 in run) == (True, False, False)
    with pytest.raises(TwinError, match=r"run/report\.html: does not exist\. Run the scenario with report=True\."):
        _ = run.report
    (run.folder / "report.html").touch()
    assert run.report == run.folder / "report.html"
    (run.folder / "signals.parquet").unlink()
    again = open_run(run.folder)
    with pytest.raises(TwinError, match=r"signals\.parquet: does not exist any more\. Run the scenario again\."):
        _ = again.signals
    (run.folder / "summary.json").write_text("{")
    with pytest.raises(TwinError, match=r"summary\.json: cannot be read \(.*\)\. Run the scenario again\."):
        open_run(run.folder)


def test_what_is_no_run(run):
    parent = run.folder.parent
    run.folder.rename(parent / "2026-11-22_21-00-00")
    (parent / "empty").mkdir()
    for folder, problem in (
        (parent, "is a folder of runs. Name one of them"),
        (parent / "empty", "has no summary.json: the run is not finished. Give the folder of a finished run"),
        (parent / "none", f"does not exist. Looked in {parent}. Known: 2026-11-22_21-00-00."),
    ):
        with pytest.raises(TwinError) as caught:
            open_run(folder)
        assert str(caught.value).startswith(f"{folder}: {problem}")


def test_a_run_is_opened_by_the_name_of_its_scenario(run, monkeypatch, tmp_path):
    """What does not exist names similar runs, and where they were looked for."""
    (tmp_path / "runs" / "rig_force").mkdir(parents=True)
    (tmp_path / "runs" / "rig_fork").mkdir()
    run.folder.rename(tmp_path / "runs" / "rig_force" / "2026-11-22_21-00-00")
    monkeypatch.chdir(tmp_path)
    assert open_run("rig_force").folder == tmp_path.joinpath("runs", "rig_force", "2026-11-22_21-00-00").relative_to(
        tmp_path
    )
    runs = tmp_path / "runs"
    for name, places in (
        ("rig_forc", f"{tmp_path} and {runs}"),
        ("runs/rig_forc", runs),
        ("runs/rig_forc/latest", runs),
        ("runs/rig_forc/2026-11-22_21-00-00", runs),
    ):
        with pytest.raises(TwinError) as caught:
            open_run(name)
        assert str(caught.value).endswith(f" Looked in {places}. Did you mean 'rig_force'?")


@pytest.mark.parametrize("has_folder", [True, False])
def test_where_nothing_was_run(monkeypatch, tmp_path, has_folder):
    if has_folder:
        (tmp_path / "runs").mkdir()
    monkeypatch.chdir(tmp_path)
    for open_results, kind in ((open_run, "runs"), (open_study, "studies")):
        with pytest.raises(TwinError) as caught:
            open_results("rig_force")
        assert str(caught.value) == f"rig_force: does not exist. There are no {kind} in {tmp_path}/runs."


def test_patterns_leave_out_internal_states(tmp_path):
    """Random generators and buffers are read by their names, or by a pattern of nothing else."""
    variables = [
        RecordedVariable(f"sensor.{name}", shape=shape)
        for name, shape in (("measured_force", ()), ("shown", ()), ("line", (32,)), ("head", ()), ("stream", (6,)))
    ]
    values = {variable.name: np.zeros((len(TIME), *variable.shape)) for variable in variables}
    folder = folder_of(tmp_path / "run", {("PI", 1): (TIME, values)}, variables)
    text = "title: Rig\nstop_time: 1 s\nmembers: {{sensor: {{component: {}}}}}\n"
    (folder / "scenario.yaml").write_text(text.format("force_sensor"))
    run, columns = open_run(folder), ["variant", "seed", "time"]
    visible = ["sensor.measured_force", "sensor.shown"]
    assert list(run.to_dataframe("sensor.*")) == [*columns, *visible]
    assert list(run["sensor.*"].data_vars) == visible
    assert list(run.to_dataframe("sensor.head", "sensor.str*"))[3:5] == ["sensor.head", "sensor.stream[1]"]
    assert list(run.to_dataframe()) == [*columns, *visible]  # one rule; it had 41 columns
    assert list(run.signals) == visible
    with pytest.raises(UnknownNameError, match=r"'force' was not recorded\. Did you mean 'sensor\.measured_force'\?"):
        run["force"]
    with pytest.raises(UnknownNameError, match=r"'nothing' was not recorded\. Known: sensor\.\*\."):
        run["nothing"]
    assert len(run.compare(run, "sensor.*").signals) == 5
    (folder / "scenario.yaml").write_text(text.format('"no.such.module:Sensor"'))
    assert len(open_run(folder)["sensor.*"].data_vars) == 5


@pytest.mark.parametrize("call", ["resume", "branch"])
def test_a_run_is_continued_beside_it(run, monkeypatch, call):
    """A new run in the same folder of results."""
    given = []

    def continue_run(folder, options, **more):
        from types import SimpleNamespace

        given.append((folder, options.root, str(options.build), options.report, more))
        return SimpleNamespace(folder=folder)

    monkeypatch.setattr("twin.run.continue_run", continue_run)
    values = ("0.5 s", {"tip.mass": 2.0, "tip.on": True}) if call == "branch" else ()
    again = getattr(run, call)(*values, report=False, build="b")
    changes = (
        {"at_ns": 500_000_000, "overrides": ["tip.mass=2.0", "tip.on=true"]}
        if values
        else {"at_ns": None, "overrides": ()}
    )
    assert given == [(run.folder, run.folder.parents[1], "b", False, changes)]
    assert again.folder == run.folder
