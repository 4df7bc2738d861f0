"""What people see: the terminal's table, report.html, and the plots in it.

Over 400 lines: one finished run serves all tests.
"""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from tests.every_case import every_case
from tests.run.reported import FORCE, LIMIT, PLOTS, TIME, tables
from twin.coupling import MemberVariable
from twin.results import Evaluation, Expectation, Metric, Plot, Signals, Window, evaluate, find_violations
from twin.results.evaluation import expression
from twin.results.recording import run_folder as results
from twin.run import parameter_table, report, report_page
from twin.run.event_table import EventRow
from twin.run.variant_matrix import build_matrix
from twin.scenario import load_scenario
from twin.scenario.resolution.variable_resolution import resolve_variables

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

METRIC = Metric(
    "error_std", expression.parse("a.force - 0.2"), "std", unit="mN", paper={"PI": 0.0362, "PI+FF": 0.1}, tolerance=0.2
)
ORDER = Expectation("", metric="error_std", ordered=("PI", "PI+FF"), unit="mN")


def judged(*, applies: bool = True) -> Evaluation:
    return evaluate({"error_std": METRIC}, [ORDER, LIMIT], tables(), applies)


def text(evaluation: Evaluation, width: int = 100, *, verbose: bool = True) -> str:
    out = io.StringIO()
    Console(file=out, width=width).print(report.results_table(evaluation, verbose))
    return out.getvalue()


def test_table_is_plain_text_within_100_columns() -> None:
    lines = [line.rstrip() for line in text(judged()).splitlines()]
    assert "\x1b" not in "".join(lines)
    assert max(map(len, lines)) <= 100
    row = next(line for line in lines if "PI+FF " in line)
    std = [1000 * float(np.std(tables()["PI+FF", seed].values["a.force"])) for seed in (1, 2)]
    mean, worst = f"{np.mean(std):.1f}", f"{max(std):.1f}"
    assert row.split() == ["PI+FF", "100", "mN", mean, "mN", worst, "mN", "0.14", "±", "20", "%", "FAIL"]
    assert any(line.startswith("pass    error_std: PI ") and line.endswith(f"> PI+FF {mean} mN.") for line in lines)
    assert any(line.startswith("FAIL    stays <in> band: 0.25 N at 3.07 s in PI, seed 2, expected") for line in lines)
    assert "other settings" in text(judged(applies=False))
    assert "paper" not in text(evaluate({"m": Metric("m", FORCE, "mean")}, [], tables()))
    assert not text(Evaluation()).strip()


LONG = (
    "force_error_std",
    "force_error_max",
    "force_error_mean",
    "a_metric_whose_name_alone_takes_more_than_40_columns",
)
SEVERAL = ("PI", "PI+FF", "PI+FF+BW")


@pytest.mark.slow
@every_case("compared", [True, False])
@every_case("names", [LONG[:3], LONG])
@every_case("width", [140, 100, 90, 80, 60, 40])
def test_no_name_and_no_number_is_shortened(width: int, names: tuple[str, ...], compared: bool) -> None:
    cases = {(variant, 1): tables()["PI", 1] for variant in SEVERAL}
    paper = dict.fromkeys(SEVERAL, 0.0362) if compared else {}
    metrics = {name: Metric(name, METRIC.signal, "std", unit="mN", paper=paper, tolerance=0.2) for name in names}
    evaluation = evaluate(metrics, [LIMIT], cases)
    found = text(evaluation, width)
    assert max(map(len, found.splitlines())) <= width
    assert "\N{HORIZONTAL ELLIPSIS}" not in found
    whole = "".join(found.split())
    for one in evaluation.metric_results:
        assert whole.count(one.metric.name) == 1
        mean = f"{1000 * (one.mean or 0):.4g}mN"
        assert whole.count(mean) == 2 * len(names) * len(SEVERAL)
    for variant in SEVERAL:
        rows = [line for line in found.splitlines() if variant in line.replace(":", " ").split()]
        assert len(rows) == len(names)
        assert all("pass" in row or "FAIL" in row for row in rows) is compared


def test_rows_of_one_variant_each_are_not_set_apart() -> None:
    metrics = {name: Metric(name, FORCE, "mean", variants=("PI",)) for name in "ab"}
    lines = text(evaluate(metrics, [], tables())).splitlines()
    first = next(i for i, line in enumerate(lines) if line.split()[:2] == ["a", "PI"])
    assert lines[first + 1].split()[:2] == ["b", "PI"]


def test_a_metric_without_a_value_says_so_without_a_paper() -> None:
    late = Metric("m", FORCE, "mean", Window(6 * 10**9))
    assert text(evaluate({"m": late}, [], tables())).count("run too short") == 2


@pytest.mark.parametrize("columns", [None, "40"])
def test_piped_output_has_whole_sentences(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, columns: str | None
) -> None:
    """A file is searched by lines; a width that is set with COLUMNS is obeyed."""
    from twin.cli.run import show
    from twin.run import RunResult as Ran
    from twin.scenario import parse_scenario

    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    limits = [Expectation("long " * 30 + "name", signal=FORCE, at_least=0.1, unit="N")]
    evaluation = evaluate({"error_std": METRIC}, limits, tables())
    scenario = parse_scenario("{title: T, stop_time: 1, members: {heart: {component: heart}}}", tmp_path / "s.yaml")
    info = results.RunInfo("x")
    summary = results.build_summary(info, evaluation, tables())
    ran = Ran(scenario, {}, info, evaluation=evaluation, folder=tmp_path, summary=summary)
    show(ran, report=True, verbose=True)
    lines = capsys.readouterr().out.splitlines()
    whole = [line for line in lines if line.startswith("pass    long ") and line.endswith("expected at least 0.1 N.")]
    assert len(whole) == (columns is None)
    assert any(line.split()[:2] == ["error_std", "PI"] for line in lines) is (columns is None)
    texts = [line for line in lines if str(tmp_path) not in line]
    assert columns is None or max(map(len, texts)) <= int(columns)


def compact(metrics: dict[str, Metric], expectations: Sequence[Expectation], width: int = 80) -> list[list[str]]:
    """The words of each line that a run of two variants with two seeds prints without --verbose."""
    lines = text(evaluate(metrics, expectations, tables()), width, verbose=False).splitlines()
    assert max(map(len, lines)) <= width
    return [line.split() for line in lines if line.strip()]


def test_what_passes_and_what_was_not_judged_is_counted() -> None:
    other = Expectation("of another variant", signal=FORCE, at_least=0.1, variants=("PI+BW",))
    lines = compact({"error_std": METRIC}, [ORDER, LIMIT, other, Expectation("low", signal=FORCE, at_most=9.0)])
    verdicts = lines[[line[0] for line in lines].index("FAIL") :]
    assert " ".join(verdicts[0]).startswith(
        "FAIL stays <in> band: 0.25 N at 3.07 s in PI, seed 2, expected 0.1 N to 0.22"
    )
    rest = [" ".join(line) for line in verdicts if line[0] in ("skipped", "pass")]
    assert rest == [
        "skipped 1 requirement (--verbose lists it and says why).",
        "pass 2 requirements (--verbose lists them), and 1 of the paper's figures",  # wrapped: above.
    ]


def test_failures_come_first_and_the_worst_seed_is_shown() -> None:
    titles, name, fails, passes, *rest = compact({"error_std": METRIC}, [])
    assert " ".join(titles).startswith("paper twin, mean worst seed ratio")
    assert titles[-3:] == ["ratio", "tolerance", "verdict"]
    assert (name, fails[0], fails[-1], passes[0], passes[-1]) == (["error_std"], "PI+FF", "FAIL", "PI", "pass")
    assert not rest


def test_metrics_without_a_reference_are_columns_of_variants_or_counted() -> None:
    means = {f"m{i}": Metric(f"m{i}", FORCE, "rms", unit="mN") for i in range(9)}
    lines = compact({"error_std": METRIC, **means}, [])
    assert lines[4] == ["mean", "/", "worst", "of", "the", "seeds", "PI", "PI+FF"]
    assert [line[:2] for line in lines[6:]] == [[name, "[mN]"] for name in means]
    assert all(line[3] == "/" and len(line) == 8 for line in lines[6:])
    neutral = compact({"error_std": METRIC, **{name: replace(one, reduce="mean") for name, one in means.items()}}, [])
    assert all(len(line) == 4 for line in neutral[6:])  # no seed of a mean is the worst one
    long = {f"{name}_{'x' * 60}": metric for name, metric in means.items()}
    renamed = {name: Metric(name, FORCE, "mean", unit="mN") for name in long}
    assert compact({"error_std": METRIC, **renamed}, [])[4:] == [
        ["9", "more", "metrics", "without", "a", "reference", "value:", "see", "--verbose", "or", "the", "report."]
    ]
    few = dict(list(renamed.items())[:2])
    assert len(compact(few, [])) > 2 * 2


class Tags(HTMLParser):
    """Checks that every tag is closed in order."""

    VOID = frozenset({"meta", "br", "link", "img", "hr", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: Sequence[object]) -> None:
        self.seen.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Sequence[object]) -> None:
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def page(
    run: results.RunInfo, evaluation: Evaluation, cases: dict[tuple[str, int], Signals], plots: Sequence[Plot] = ()
) -> str:
    rows = [parameter_table.ParameterRow("a", "k", "3", "N/m", "stiffness", "paper A", given=True, variants="PI")]
    events = [EventRow(2 * 10**9, "set a.k = 4 N/m")]
    return report_page.report_html(
        results.build_summary(run, evaluation, cases), evaluation, cases, plots=plots, parameters=rows, events=events
    )


@pytest.mark.slow
def test_html() -> None:
    run = results.RunInfo("contact", "Contact & force", overrides=("a.k=3",), wall_time=0.1, simulated_time=10.0)
    html = page(run, judged(), tables(), PLOTS)
    tags = Tags()
    tags.feed(html)
    assert not tags.open
    assert tags.seen.count("svg") == 2
    assert {"link", "img"}.isdisjoint(tags.seen)
    assert "http" not in html.replace("http://www.w3.org", "")
    assert " src=" not in html
    for part in (
        "Contact &amp; force",
        "36.2 mN",
        "✗ fail",
        "1 passed",
        "stays &lt;in&gt; band",
        "With a.k 3, &#34;stays &lt;in&gt; band&#34; and &#34;error_std, PI+FF&#34; fail; the first: 0.25\N{NO-BREAK SPACE}N in PI, seed 2.",
        "stiffness",
        "set a.k = 4 N/m",
        "None of its signals was recorded",
        "Force &lt;per&gt; controller",
    ):
        assert part in html, part
    assert len(html) < 500_000


def test_html_of_a_run_that_failed_before_anything() -> None:
    html = page(results.RunInfo("x", status="failed", reason="servo: not a number at 1 s"), Evaluation(), {})
    assert "servo: not a number at 1 s" in html


@pytest.mark.slow
def test_html_says_what_did_not_finish() -> None:
    cases = tables() | {("PI", 2): tables(complete=False)["PI", 2]}
    html = page(results.RunInfo("x", status="interrupted"), evaluate({"error_std": METRIC}, [], cases), cases)
    assert "Incomplete cases, not evaluated: PI, seed 2" in html


@pytest.mark.slow
def test_the_first_screen_answers() -> None:
    """Verdict with counts, the sentence, what failed, then how it is looked at."""
    evaluation = judged()
    summary = results.build_summary(results.RunInfo("x"), evaluation, tables()) | {"sentence": "It deviates by 14 mN."}
    html = report_page.report_html(summary, evaluation, tables(), folder="runs/x/2026-01-01_00-00-00")
    head = html[html.index("<header>") : html.index("</header>")]
    for text in (
        "✗ 2 failed · 2 passed",
        "1 of 2 published values within their tolerance; twin / paper: 0.14 to 0.98.",
        "It deviates by 14\N{NO-BREAK SPACE}mN.",
        "twin view runs/x/2026",
    ):
        assert text in head
    verdicts = html[html.index('id="requirements"') : html.index('id="metrics"')]
    assert '<table class="key">' not in html  # what failed stands in its position
    assert html.index("</header>") < html.index('id="requirements"')
    assert verdicts.index("<b>stays &lt;in&gt; band</b>") < verdicts.index(
        "<summary>1 passed, and 1 of the paper's values within their tolerance ("
    )


def test_one_variant_has_no_column_and_what_is_not_judged_is_folded() -> None:
    cases = {("PI", seed): tables()["PI", seed] for seed in (1, 2)}
    other = Expectation("other", signal=FORCE, at_most=1.0, variants=("PI+FF",), unit="N")
    evaluation = evaluate({"error_std": METRIC}, [ORDER, other], cases)
    summary = results.build_summary(results.RunInfo("x"), evaluation, cases) | {"sentence": ""}
    html = report_page.report_html(summary, evaluation, cases)
    assert "variant PI \N{MULTIPLICATION SIGN} 2 seeds" in html
    assert "<th>Metric</th><th " in html
    assert "<td>PI</td>" not in html
    assert "Not judged: this run has no complete case of PI+FF with a.force." in html
    section = html[html.index('id="requirements"') :]
    assert section.index('<details class="skipped"><summary>2 not judged</summary>') < section.index("Not judged: ")


def test_parameters_that_a_scenario_sets_come_first() -> None:
    rows = [
        parameter_table.ParameterRow("servo", "stroke", "80", "mm"),
        parameter_table.ParameterRow("servo", "mass", "1", "kg", given=True),
    ]
    summary = results.build_summary(results.RunInfo("x"), Evaluation(), {}) | {"sentence": ""}
    html = report_page.report_html(summary, Evaluation(), {}, parameters=rows)
    assert (
        html.index("<code>mass</code>") < html.index("<summary>1 default</summary>") < html.index("<code>stroke</code>")
    )


def test_every_parameter_has_its_value_its_source_and_the_variants_that_use_it() -> None:
    catalog = {
        "wall": {
            "k": variable("k", "parameter", "N/m", start=2.0, description="stiffness"),
            "gap": variable("gap", "parameter", "m", "mm", start=0.005),
            "shape": variable("shape", "structuralParameter", start=3),
            "grid": variable("grid", "parameter", start=np.arange(7.0)),
            "seed": variable("seed", "parameter", start=0),
            "f": variable("f", "output", "N"),
        }
    }
    cases = [case("stiff", {"k": 4.0}), case("soft", {"grid[2]": 9.0, "seed": 5})]
    rows = parameter_table.parameter_rows(cases, {"stiff": catalog, "soft": catalog}, "x.yaml")
    assert [(row.name, row.value, row.unit, row.given, row.variants) for row in rows] == [
        ("k", "4", "N/m", True, "stiff"),
        ("k", "2", "N/m", False, "soft"),
        ("gap", "5", "mm", False, ""),
        ("shape", "3", "", False, ""),
        ("grid", "[0, 1, 2, … 6] (7)", "", False, "stiff"),
        ("grid", "[0, 9, 2, … 6] (7)", "", True, "soft"),
        ("seed", "5", "", True, "soft"),
    ]
    assert [(row.member, row.description, row.source) for row in rows[:2]] == [
        ("wall", "stiffness", "set by the scenario; default 2 N/m: paper A"),
        ("wall", "stiffness", "paper A"),
    ]
    spec = SimpleNamespace(parameters={"k": 1.0}, locations={"k": "/scenarios/parts/x.yaml:3"})
    assert parameter_table.find_setter(spec, "k", "/scenarios/a.yaml") == "parts/x.yaml:3"
    assert rows[5].source == "set by set.yaml:4; default [0, 1, 2, … 6] (7)"
    assert parameter_table.format_parameter(np.arange(6), "", "") == "[0, 1, 2, 3, 4, 5]"
    assert parameter_table.format_parameter(20.0, "degC", "K") == "293.15"
    assert parameter_table.format_parameter(293.15, "K", "degC") == "20"
    assert parameter_table.format_parameter(None, "", "") == ""


def variable(name: str, causality: str, unit: str = "", display: str = "", **more: Any) -> MemberVariable:
    dtype = np.asarray(more.get("start", 0.0)).dtype
    shape = np.shape(more.get("start", 0.0))
    more = {"shape": shape, "display_unit": display, **more}
    return MemberVariable(name, causality, "fixed", "Float64", dtype, unit=unit, **more)


def case(variant: str, parameters: dict[str, Any]) -> Any:
    """One run of a variant that sets some parameters of `wall`."""

    def values(_member: str, variables: dict[str, MemberVariable]) -> dict[str, Any]:
        plain = {name: value for name, value in parameters.items() if "[" not in name}
        grid = np.array(variables["grid"].start)
        grid[[int(name[5]) - 1 for name in parameters if "[" in name]] = 9.0
        return {**plain, "grid": grid}

    made = SimpleNamespace(variables=[SimpleNamespace(name="k", source="paper A")])
    locations = {"k": "x.yaml:3", "grid[2]": "set.yaml:4"}
    spec = SimpleNamespace(component="wall", made=made, parameters=parameters, locations=locations)
    return SimpleNamespace(variant=variant, members={"wall": spec}, values=values)


def test_a_value_that_a_group_or_an_option_sets_has_not_the_source_of_the_default() -> None:
    """The group `contact_chain` sets the free length that it uses; seeds are no settings."""
    scenario = load_scenario("scenarios/heart_wall_force.yaml", ["heart.rate=1.2 Hz"])
    cases = scenario.cases(["PI"])
    rows = parameter_table.parameter_rows(cases, resolve_variables(scenario)[0], str(scenario.path))
    found = {(row.member, row.name): row for row in rows}
    length, rate = found["estimate", "tracking.free_length"], found["heart", "rate"]
    assert (length.value, length.unit, length.given) == ("63", "mm", True)
    assert length.source == "set by heart_motion.yaml; default 20 mm: as guided_tip"
    assert rate.source.startswith("set by `--set heart.rate=1.2 Hz`; default ")
    assert found["tip", "free_length"].source.startswith(
        "set by scenarios/instruments/fiber_catheter.yaml:3; default 20 mm: "
    )
    assert not found["estimate", "fiber.seed"].given


@pytest.mark.slow
def test_many_variants_are_a_matrix() -> None:
    """Each metric of each variant once, with how many expectations failed in it."""
    cases = {(f"v{i}", 1): Signals(TIME, {"a.force": np.full(5001, 0.1 * i)}, {"a.force": "N"}) for i in range(6)}
    metrics = {"mean": Metric("mean", FORCE, "mean", unit="mN")}
    limits = [Expectation("low", metric="mean", at_most=0.45), Expectation("odd", signal=FORCE, at_most=0.35)]
    evaluation = evaluate(metrics, limits, cases)
    grid = build_matrix(evaluation, find_violations(limits, evaluation, cases))
    assert grid.is_large
    assert [one.cells[0].text for one in grid.rows] == ["400", "500", "0", "100", "200", "300"]  # failures first
    assert [one.failures for one in grid.rows[:3]] == [("odd",), ("low", "odd"), ()]
    html = report_page.report_html(
        results.build_summary(results.RunInfo("x"), evaluation, cases),
        evaluation,
        cases,
        expectations=limits,
        plots=PLOTS[:1],
    )
    tags = Tags()
    tags.feed(html)
    assert not tags.open
    assert '<a href="#metrics">Metrics</a>' in html
    assert html.count('<tr class="bad">') == 2
    assert "src=" not in html
    few = dict(list(cases.items())[:4])
    assert not build_matrix(evaluate(metrics, [], few), []).is_large


@pytest.mark.slow
def test_matplotlib_and_others_are_loaded_only_when_needed() -> None:
    code = "import sys, twin.scenario, twin.results, twin.run, twin.cli.check; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"matplotlib", "pyarrow", "jinja2", "rich", "pint"}.isdisjoint(done.stdout.split())


def test_check_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from twin.cli.check import command

    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "from twin.component import Component, input, output, parameter\n\n\n"
        "class Gain(Component):\n    '''Gain.'''\n    u = input('N', 'in')\n    y = output('N', 'out')\n"
        "    k = parameter(2.0, '', 'gain')\n\n    def step(self, t, h):\n        self.y = self.k * self.u\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    good = (
        "stop_time: 1\nmembers:\n  a: {component: own:Gain}\n  b: {component: own:Gain}\nconnections:\n  - a.y -> b.u\n"
    )
    (tmp_path / "good.yaml").write_text(good)
    (tmp_path / "bad.yaml").write_text(good.replace("a.y", "a.z") + "record: [a.q]\n")
    (tmp_path / "none.yaml").write_text(good.replace("own:Gain", "own:Gian", 1))
    done = CliRunner().invoke(command, ["good.yaml"])
    assert (done.exit_code, done.output) == (0, "good.yaml: ok (1 variant, 1 seed, 2 members, 1 connection)\n")
    done = CliRunner().invoke(command, ["good.yaml", "bad.yaml", "none.yaml"])
    assert done.exit_code == 1
    lines = done.output.splitlines()
    assert lines[1].startswith("bad.yaml:6: 'a.z': a has no variable 'z'")
    assert lines[2].startswith("bad.yaml:7: a has no variable `q`.")
    assert lines[3].startswith("none.yaml:3: member `a`:")
