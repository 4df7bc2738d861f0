"""Representations for notebooks and conversions of the Python interface, from summaries that a test chooses."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.errors import TwinError
from twin.face import arrays, conversions, notebook, progress
from twin.results import RecordedVariable, Signals


def cells(html):
    """The cells of a table, row by row."""
    rows = html.removeprefix("<table>").removesuffix("</table>").split("</tr>")
    return [row.removeprefix("<tr>") for row in rows if row]


def test_a_table_of_metrics():
    """Figures of the paper have a column where there are any; a metric is named once."""
    figures = {
        "PI": {"paper": 0.5, "mean": 0.25, "verdict": "pass"},
        "<FF>": {"paper": None, "mean": None, "verdict": "none"},
    }
    metrics = {"force": {"description": "a <b>", "unit": "mN", "variants": figures}}
    title = '<td class=text><span title="a &lt;b&gt;">force</span></td>'
    head, first, second = cells(notebook.verdicts({"metrics": metrics}))
    numbers = "<th class=number>paper</th><th class=number>mean over seeds</th>"
    assert head == f"<th class=text>metric</th><th class=text>variant</th>{numbers}<th class=text>verdict</th>"
    values = "<td class=number>0.50 mN</td><td class=number>0.25 mN</td>"
    assert first == f'{title}<td class=text>PI</td>{values}<td class=text><b class="pass">✓ pass</b></td>'
    values = "<td class=number>-</td><td class=number>-</td>"
    verdict = '<b class="none">no value</b>'
    assert second == f"<td class=text></td><td class=text>&lt;FF&gt;</td>{values}<td class=text>{verdict}</td>"
    figures["PI"]["paper"] = None
    assert "paper" not in notebook.verdicts({"metrics": metrics})
    assert notebook.verdicts({"metrics": {}}) == ""
    outcomes = [{"verdict": "fail", "name": "safe", "detail": "3 < 4"}]
    assert cells(notebook.expectations(outcomes))[1] == (
        '<td class=text><b class="fail">✗ fail</b></td><td class=text>safe</td><td class=text>3 &lt; 4</td>'
    )
    assert notebook.value(300.0, "K") == "300 K"


@pytest.mark.parametrize(
    ("summary", "counts", "kind", "text"),
    [
        ({}, (2, 3), "pass", "✓ 2 of 3 requirements met"),
        ({}, (0, 0), "pass", "✓ completed"),
        ({"passed": False}, (2, 3), "fail", "✗ 2 of 3 requirements met"),
        ({"status": "failed", "reason": "<x>"}, (2, 3), "fail", "failed: &lt;x&gt;"),
    ],
)
def test_the_state_of_a_run(monkeypatch, summary, counts, kind, text):
    monkeypatch.setattr(notebook, "count_verdicts", lambda _: counts)
    for number, more in ((notebook.CASES, ""), (notebook.CASES + 1, " …")):
        cases = [{"variant": "v", "seed": seed} for seed in range(number)]
        shown = ", ".join(f"v {seed}" for seed in range(notebook.CASES))
        given = {"status": "completed", "passed": True, "reason": "", "cases": cases, **summary}
        assert notebook.state(given, "runs/a") == f'<b class="{kind}">{text}</b><p>{shown}{more}; runs/a</p>'


def test_parts_of_a_page():
    assert notebook.page("a", "", "b") == f'<div class="twin">{notebook.STYLE}ab</div>'
    assert (notebook.paragraph(""), notebook.paragraph("<"), notebook.heading("<")) == (
        "",
        "<p>&lt;</p>",
        "<h4>&lt;</h4>",
    )
    assert [notebook.short(name) for name in ("a/b/rig.yaml#rig@fast", "heart", "a/b.fmu")] == [
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
    assert (whole.dims, whole.dtype, whole.shape) == (("time", "variant", "seed", "element"), np.int64, (2, 2, 2, 2))
    assert whole.sel(variant="B", seed=2, time=1.0, element=2).item() == 21
    assert whole.attrs == {"units": "N", "long_name": "about"}
    assert whole.element.values.tolist() == [1, 2]
    del cases["A", 1]
    cases["B", 2] = Signals(np.array([1.0, 2.0]), {"a.n": np.array([[1, 2], [3, 4]])})
    part = arrays.array(variable, cases)
    assert part.time.values.tolist() == [0.0, 1.0, 2.0]
    assert part.sel(variant="B", seed=2, element=2).values.tolist() == [pytest.approx(np.nan, nan_ok=True), 2.0, 4.0]
    assert np.isnan(part.sel(variant="A", seed=1)).all()
    assert arrays.array(variable, {}).shape == (0, 0, 0, 2)
    matrix = RecordedVariable("a.m", shape=(1, 2))
    assert arrays.array(matrix, {("A", 1): Signals(time, {"a.m": np.zeros((2, 1, 2))})}).dims[3:] == (
        "element_1",
        "element_2",
    )
    table = arrays.frame(time, {"a.m": np.arange(4.0).reshape(2, 1, 2), "a.x": time}, {"a.x": "m"})
    assert table.to_dict("list") == {
        "time": [0.0, 1.0],
        "a.m[1,1]": [0.0, 2.0],
        "a.m[1,2]": [1.0, 3.0],
        "a.x": [0.0, 1.0],
    }
    assert table.attrs["units"] == {"time": "s", "a.m[1,1]": "", "a.m[1,2]": "", "a.x": "m"}
