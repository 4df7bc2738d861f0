"""Representations for notebooks and conversions of the Python interface, from summaries that a test chooses."""

import pickle
import re
from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.web.browser import browser, chromium  # noqa: F401
from twin.errors import TwinError
from twin.face import arrays, conversions, notebook, progress
from twin.results import RecordedVariable, Signals


def cells(html):
    """The cells of a table, row by row."""
    rows = html.removeprefix("<table>").removesuffix("</table>").split("</tr>")
    return [row.removeprefix("<tr>") for row in rows if row]


def metric(variants, unit="mN", description=""):
    """A metric of a summary; `variants`: (mean, paper, verdict)."""
    keys = ("mean", "paper", "verdict", "ratio")
    figures = {
        name: dict(zip(keys, (*own, own[0] / own[1] if own[1] else None), strict=True))
        for name, own in variants.items()
    }
    return {"description": description, "unit": unit, "variants": figures}


SUMMARY = {
    "scenario": {"title": "Rig"},
    "status": "completed",
    "passed": False,
    "reason": "",
    "sentence": "It holds.",
    "cases": [{"variant": name, "seed": seed} for name in ("PI", "FF, replayed") for seed in (1, 2)],
    "metrics": {
        "speed": metric({"PI": (1.0, None, "info")}, "m/s"),
        "force": metric({"PI": (0.25, 0.5, "pass"), "<FF>": (None, None, "info")}, description="a <b>"),
        "depth": metric({"PI": (0.02, 0.02, "pass"), "FF": (0.03, 0.02, "fail")}, "m"),
    },
    "expectations": [
        {"verdict": "fail", "name": "safe", "detail": "3 < 4"},
        {"verdict": "pass", "name": "a", "detail": "b"},
    ],
}


def test_a_quantity_has_one_unit_in_data_and_in_the_table():
    """A metric in N beside one in mN: both in mN, in the DataFrame as in the HTML."""
    figures = {"values": {"1": 0.06875}, "mean": 0.06875, "paper": 0.0782, "ratio": 0.88, "verdict": "pass"}
    large = {**figures, "values": {"1": 200.1}, "mean": 200.1, "paper": None, "ratio": None, "verdict": "info"}
    metrics = {
        "error": {"description": "", "unit": "N", "variants": {"PI": figures}},
        "force": {"description": "", "unit": "mN", "variants": {"PI": large}},
    }
    table = arrays.metrics({"metrics": metrics})
    assert table[["value", "unit", "paper"]].values.tolist()[0] == [68.75, "mN", 78.2]
    assert table.ratio[0] == pytest.approx(0.06875 / 0.0782, rel=1e-12)
    assert "error [mN]" in notebook.verdicts({"metrics": metrics})


def test_a_table_of_metrics():
    """Failures first, then figures of the paper; a metric has one unit, beside its name; the rest is folded."""
    text = notebook.verdicts(SUMMARY)
    table, _, rest = text.partition("<details><summary>1 more metric</summary>")
    names = ("metric", "variant", "mean", "paper", "ratio", "verdict")
    kinds = ("text", "text", "number", "number", "ratio", "text")
    head, *rows = cells(table.removeprefix("<div class=wide>").removesuffix("</div>"))
    assert head == "".join(f"<th class={kind}>{name}</th>" for kind, name in zip(kinds, names, strict=True))
    own = [[re.sub("<[^>]*>", "", cell) for cell in row.removesuffix("</td>").split("</td>")] for row in rows]
    assert own == [
        ["depth [m]", "FF", "0.03", "0.02", "1.50", "✗ fail"],
        ["", "PI", "0.02", "0.02", "1.00", "✓ pass"],
        ["force [mN]", "PI", "0.25", "0.50", "0.50", "✓ pass"],
        ["", "&lt;FF&gt;", "-", "-", "-", "-"],
    ]
    assert '<span title="a &lt;b&gt;">' in rows[2]
    assert ("speed [m/s]" in rest, "paper" in rest) == (True, False)
    assert notebook.verdicts({"metrics": {}}) == ""
    other = notebook.verdicts({"metrics": {"force": metric({"PI": (0.25, 0.5, "other")})}})
    assert '<b class="other">other settings</b>' in other  # short, where the notebook is narrow
    assert other.endswith("<p>Other settings than the paper&#x27;s: not comparable.</p>")
    assert "<details>" not in notebook.verdicts({"metrics": {"speed": SUMMARY["metrics"]["speed"]}})
    outcomes = [{"verdict": "fail", "name": "safe", "detail": "3 < 4"}]
    assert (
        '<td class=text><b class="fail">✗ fail</b></td><td class=text>safe</td><td class=detail>3 &lt; 4</td>'
        in notebook.requirements(outcomes)
    )
    assert notebook.value(300.0, "K") == "300 K"


def test_metrics_print_every_column():
    """With the paper's value and the ratio beside each; a named index, such as that of a pivot table, stays."""
    values = {"values": {"1": 0.5, "2": None}, "mean": 0.5, "paper": 0.4, "ratio": 1.25, "verdict": "fail"}
    summary = {"metrics": {"a_metric_with_a_long_name": {"unit": "mN", "variants": {"a variant, replayed": values}}}}
    table = arrays.metrics(summary)
    head, first, second = (line.split() for line in repr(table).splitlines())
    assert head == ["metric", "variant", "seed", "value", "unit", "paper", "ratio", "verdict"]
    assert first == ["a_metric_with_a_long_name", "a", "variant,", "replayed", "1", "0.5", "mN", "0.4", "1.25", "fail"]
    assert second[4:] == ["2", "-", "mN", "0.4", "-", "fail"]
    assert repr(table[table.seed == 2]).splitlines()[1].split() == second
    assert "<td>1.25</td>" in table._repr_html_()
    pivot = table.pivot_table(index="metric", columns="seed", values="value")
    assert "a_metric_with_a_long_name" in repr(pivot)
    assert pickle.loads(pickle.dumps(table)).equals(table)


def test_requirements_print_their_verdict(monkeypatch):
    """Names and details are shortened to the terminal; pandas left out the column of verdicts. A notebook has all."""
    monkeypatch.setenv("COLUMNS", "80")
    outcome = {"name": "force " * 12, "verdict": "skipped", "detail": 9 * "Not judged. " + "End"}
    table = arrays.requirements({"expectations": [outcome]})
    head, row = repr(table).splitlines()
    assert (head.split(), len(row) < 80) == (["name", "verdict", "detail"], True)
    assert "skipped" in row
    wide = arrays.table([{f"column {k}": 0.5 for k in range(20)}])
    assert "..." not in repr(wide)  # all columns, also where they are wider than the terminal
    assert outcome["detail"] in table._repr_html_()


@pytest.mark.slow
def test_a_card_fits_a_narrow_notebook(browser, tmp_path):  # noqa: F811
    """Without the column of ratios at 360 px, which needed scrolling: the paper's value stays beside the twin's."""
    verdicts = notebook.verdicts({"metrics": {"force_error_std": metric({"PI+FF": (35.6, 36.2, "other")})}})
    long = {"verdict": "pass", "name": "PI moves against", "detail": f"controller.{'target_velocity' * 3} was -0.2"}
    (tmp_path / "card.html").write_text(notebook.page(verdicts, notebook.requirements([long])))
    page = browser.new_page(viewport={"width": 360, "height": 600})
    page.goto((tmp_path / "card.html").as_uri())
    widths = "[...document.querySelectorAll('.wide')].map(each => each.scrollWidth - each.clientWidth)"
    assert page.evaluate(widths) == [0, 0]
    assert page.get_by_text("paper", exact=True).is_visible()
    assert not page.get_by_text("ratio", exact=True).is_visible()
    page.set_viewport_size({"width": 900, "height": 600})
    assert page.get_by_text("ratio", exact=True).is_visible()
    page.close()


def test_a_run_in_some_lines(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert notebook.run_text(SUMMARY, tmp_path / "runs" / "1").splitlines() == [
        "Rig: ✗ 2 failed · 3 passed",
        "It holds.",
        "FAIL safe: 3 < 4",
        "FAIL depth, FF: 0.03 m (paper 0.02, ratio 1.50)",
        "variants PI · FF, replayed; seeds 1 · 2",
        "runs/1",
    ]


def test_links_of_a_run_work_from_a_notebook(tmp_path, monkeypatch):
    """Relative below the working folder, which is the notebook's, else as URI; without a page the command that opens it."""
    folder = tmp_path / "runs" / "a b"
    folder.mkdir(parents=True)
    (folder / "report.html").touch()
    monkeypatch.chdir(tmp_path)
    command = " · Curves: type <code>twin view runs/a b</code> in a terminal"
    assert notebook.links(folder) == f'<p><a href="runs/a%20b/report.html">Report</a>{command}</p>'
    monkeypatch.chdir(folder)
    (folder / "signals.html").touch()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    uri = folder.resolve().as_uri()
    viewer = f'<a href="{uri}/signals.html">Viewer</a>'
    assert notebook.links(folder) == f'<p><a href="{uri}/report.html">Report</a> · {viewer}</p>'


@pytest.mark.parametrize(
    ("summary", "counts", "kind", "text"),
    [
        ({}, (3, 3), "pass", "✓ 3 of 3 requirements met"),
        ({}, (0, 0), "pass", "✓ completed"),
        ({"passed": False}, (2, 3), "fail", "✗ 1 failed · 2 passed"),
        ({"expectations": [{"verdict": "skipped"}]}, (2, 2), "pass", "✓ 2 of 2 requirements met, 1 not judged"),
        (
            {"expectations": [{"verdict": "skipped", "name": "order", "detail": "Not judged: needs PI."}] * 3},
            (2, 2),
            "other",
            "2 of 2 requirements met, 3 not judged</b><p>order: Not judged: needs PI.",
        ),
        (
            {"expectations": [{"verdict": "skipped", "name": "age", "detail": "Outside.", "is_outside": True}]},
            (2, 2),
            "other",
            "2 of 2 requirements met, 1 not judged, 1 of these outside of nominal limits</b><p>age: Outside.",
        ),
        ({"status": "failed", "reason": "<x>"}, (2, 3), "fail", "failed: &lt;x&gt;"),
    ],
)
def test_the_state_of_a_run(monkeypatch, summary, counts, kind, text):
    monkeypatch.setattr(notebook, "count_verdicts", lambda _: counts)
    for number, more in ((notebook.CASES, ""), (notebook.CASES + 1, " and 1 more")):
        cases = [{"variant": "v", "seed": seed} for seed in range(number)]
        shown = " · ".join(str(seed) for seed in range(notebook.CASES))
        given = {"status": "completed", "passed": True, "reason": "", "cases": cases, "expectations": [], **summary}
        end = "</p>" if "</b>" in text else "</b>"
        assert notebook.state(given) == f'<b class="{kind}">{text}{end}<p>variant v; seeds {shown}{more}</p>'


def test_a_plot_has_the_colors_of_its_surroundings():
    """Its texts are not changed."""
    svg = '<svg><path style="fill: #ffffff"/><path style="stroke: #e4e7eb"/><text style="fill: #3e4c59">#ffffff</text></svg>'
    shown = '<svg><path style="fill: none"/><path style="stroke: #8884"/><text style="fill: currentColor">#ffffff</text></svg>'
    assert notebook.plot(svg) == f"<div class=plot>{shown}</div>"
    assert notebook.plot("") == ""
    assert ".twin a:any-link { color: inherit;" in notebook.STYLE
    assert "background: #fff" not in notebook.STYLE


def test_parts_of_a_page():
    assert notebook.page("a", "", "b") == f'<div class="twin">{notebook.STYLE}ab</div>'
    assert (notebook.paragraph(""), notebook.paragraph("<"), notebook.heading("<")) == (
        "",
        "<p>&lt;</p>",
        "<h4>&lt;</h4>",
    )
    assert [notebook.short_name(name) for name in ("a/b/rig.yaml#rig@fast", "heart", "a/b.fmu")] == [
        "rig.yaml#rig@fast",
        "heart",
        "b.fmu",
    ]


@every_case(
    ("line", "python"),
    [
        ("Use --stop-time 1 or more.", "Use stop_time=1 or more."),
        ("Drop --stop-time.", "Drop stop_time."),
        ('Use --set "a=1".', 'Use set "a=1".'),
        ("Use --variant and --seed 3.", "Use variants and seeds=3."),
        ("Give --runs.", "Give out."),
        ("Use `--checkpoint 10s`.", 'Use `checkpoint="10s"`.'),
    ],
)
def test_options_are_named_as_arguments(line, python):
    with pytest.raises(TwinError) as caught, conversions.python_option_names():
        raise TwinError([line, "x"])
    assert (caught.value.problems, str(caught.value)) == ([python, "x"], f"{python}\nx")


@every_case(
    ("value", "text"),
    [
        (None, "null"),
        (True, "true"),
        (False, "false"),
        (1, "1"),
        (0.1, "0.1"),
        ("a b", "a b"),
        ((1, 2.5), "[1, 2.5]"),
        (np.array([[1.0, 2.0]]), "[[1.0, 2.0]]"),
        (np.float64(0.1), "0.1"),
        (np.bool_(True), "true"),
        ([None, "x"], "[null, x]"),
    ],
)
def test_values_of_overrides(value, text):
    assert conversions.override_text(value) == text


def test_conversions():
    assert conversions.as_list(None) == []
    assert [conversions.as_list(one) for one in ("ab", 3, np.int64(3), ("a", "b"))] == [["ab"], [3], [3], ["a", "b"]]
    assert conversions.plain(SimpleNamespace(to_numpy=lambda: np.arange(2))) == [0, 1]
    assert conversions.finite([1, 2.5], "x") == [1, 2.5]
    assert conversions.finite("nan", "x") == "nan"
    for value in (np.nan, [1.0, np.inf], np.array([np.nan])):
        with pytest.raises(TwinError, match=r"x: .* is not finite\. Give a finite number\."):
            conversions.finite(value, "x")
    assert (conversions.seconds(None, "x"), conversions.seconds("5 ms", "x"), conversions.seconds(2, "x")) == (
        None,
        0.005,
        2.0,
    )
    with pytest.raises(TwinError, match="stop: "):
        conversions.nanoseconds("5 kg", "stop")
    assert conversions.choice("fmu", ["fmu", "compiled"], "backend") == "fmu"
    with pytest.raises(TwinError, match=r"backend: 'fmi' is not known\. Did you mean"):
        conversions.choice("fmi", ["fmu", "compiled"], "backend")


def test_progress_of_a_run():
    """A callback, nothing, or a bar that is removed."""
    seen = []
    with progress.progress_callback(lambda *call: seen.append(call), "t") as callback:
        callback("base", 0.5)
    with progress.progress_callback(None, "t") as callback:
        assert callback("base", 0.5) is None
    assert seen == [("base", 0.5)]
    closed = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(progress, "Bar", lambda title: SimpleNamespace(title=title, close=lambda: closed.append(title)))
        with progress.progress_callback(True, "t") as bar:
            assert bar.title == "t"
    assert closed == ["t"]


@pytest.fixture
def shown(monkeypatch):
    """What a notebook shows in its one output, one after the other."""
    pytest.importorskip("IPython", reason="the extra `docs` is not installed")
    texts = []

    def update(data, *, raw, display_id=None):
        texts.append(data["text/plain"])
        return SimpleNamespace(update=update)

    monkeypatch.setattr("IPython.display.display", update)
    return texts


def test_progress_appears_after_some_seconds_by_default(monkeypatch, shown):
    """Also while nothing is reported, as when a component is compiled; nothing of a short run, or of one in a script."""
    monkeypatch.setattr(progress, "find_spec", lambda name: None)
    monkeypatch.setattr(progress, "DELAY", 0.01)
    for is_notebook, expected in ((True, ["building a  0 %", ""]), (False, [])):
        monkeypatch.setattr(progress, "in_notebook", lambda is_notebook=is_notebook: is_notebook)
        with progress.progress_callback(None, "t") as callback:
            callback("building a", 0.0)
            sleep(0.2)
        assert shown == expected
        shown.clear()
    monkeypatch.setattr(progress, "DELAY", 10.0)
    monkeypatch.setattr(progress, "in_notebook", lambda: True)
    with progress.progress_callback(None, "t") as callback, progress.progress_callback(False, "u") as silent:
        callback("PI", 0.5)
        silent("PI", 0.5)
    assert shown == []


def test_progress_without_ipywidgets_is_a_line_of_text(monkeypatch, shown):
    """rich warned at each update, and showed no bar."""
    monkeypatch.setattr(progress, "in_notebook", lambda: True)
    monkeypatch.setattr(progress, "find_spec", lambda name: None)
    with progress.progress_callback(True, "t") as line:
        line("base", 0.5)
        line("base", 0.501)
    assert shown == ["t  0 %", "base  50 %", ""]


def test_cases_as_one_array():
    """A case or a sample that is missing is not a number; without any, the type stays."""
    variable = RecordedVariable("a.n", dtype=np.dtype(np.int64), shape=(2,), unit="N", description="about")
    time = np.array([0.0, 1.0])
    cases = {
        (name, seed): Signals(time, {"a.n": np.full((2, 2), 10 * seed + k)})
        for k, name in enumerate("AB")
        for seed in (1, 2)
    }
    whole = arrays.array(variable, cases)
    assert (whole.dims, whole.dtype, whole.shape) == (
        ("time", "variant", "seed", "element_of_2"),
        np.int64,
        (2, 2, 2, 2),
    )
    assert whole.sel(variant="B", seed=2, time=1.0, element_of_2=2).item() == 21
    assert whole.attrs == {"units": "N", "long_name": "about"}
    assert whole.element_of_2.values.tolist() == [1, 2]
    del cases["A", 1]
    cases["B", 2] = Signals(np.array([1.0, 2.0]), {"a.n": np.array([[1, 2], [3, 4]])})
    part = arrays.array(variable, cases)
    assert part.time.values.tolist() == [0.0, 1.0, 2.0]
    assert part.sel(variant="B", seed=2, element_of_2=2).values.tolist() == [
        pytest.approx(np.nan, nan_ok=True),
        2.0,
        4.0,
    ]
    assert np.isnan(part.sel(variant="A", seed=1)).all()
    assert arrays.array(variable, {}).shape == (0, 0, 0, 2)
    matrix = RecordedVariable("a.m", shape=(1, 2))
    assert arrays.array(matrix, {("A", 1): Signals(time, {"a.m": np.zeros((2, 1, 2))})}).dims[3:] == (
        "element_1_of_1",
        "element_2_of_2",
    )
    table = arrays.frame(time, {"a.m": np.arange(4.0).reshape(2, 1, 2), "a.x": time}, {"a.x": "m"})
    assert table.to_dict("list") == {
        "time": [0.0, 1.0],
        "a.m[1,1]": [0.0, 2.0],
        "a.m[1,2]": [1.0, 3.0],
        "a.x": [0.0, 1.0],
    }
    assert table.attrs["units"] == {"time": "s", "a.m[1,1]": "", "a.m[1,2]": "", "a.x": "m"}
