"""What commands print of their results: each table as a whole, from results that a test chooses.

Over 400 lines: what commands show while they run shares its stand-ins.
"""

import dataclasses
import io
import re
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from tests.cli.replaced import replace
from twin.cli import follow, identify, profile, simulate, study, terminal, validate
from twin.cli import test as conformance_command
from twin.errors import FMUError, TwinError
from twin.process import CrashReport
from twin.study import StudyProgress, duration_text, progress_text


def rows(text):
    """Lines without rules, as cells that are at least two spaces apart."""
    lines = (line.strip() for line in text.splitlines())
    return [re.split(r"\s{2,}", line) for line in lines if set(line) - set(" ─╴╶━-")]


def test_computing_times(capsys):
    costs = [
        SimpleNamespace(name="plant", what="beam", step=2e-6, per_tick=1e-6, share=0.25),
        SimpleNamespace(name="loop", what="master", step=0.0, per_tick=3e-6, share=0.75),
    ]
    profile.show(
        SimpleNamespace(
            costs=costs, step=1e-3, per_tick=4e-6, real_time_factor=250.0, sampled_steps=77, overhead=2.5e-8
        )
    )
    assert rows(capsys.readouterr().out) == [
        ["member", "component", "per own step", "per communication step", "share"],
        ["plant", "beam", "2.000 us", "1.000 us", "25.0 %"],
        ["loop", "master", "-", "3.000 us", "75.0 %"],
        [
            "A communication step of 1 ms takes 4.00 us: 250 times real time. 77 steps measured; 25 ns per reading of the clock are subtracted."
        ],
    ]


def test_identified_values(capsys):
    result = SimpleNamespace(
        problem=SimpleNamespace(
            title="Mass",
            keys=SimpleNamespace(confidence=0.95),
            unknowns=[SimpleNamespace(name=name, shown=lambda value: f"{value:g} kg") for name in ("m", "k")],
        ),
        values=[2.0, 3.0],
        verdicts=["", "flat"],
        interval_text=lambda i: f"{i} to {i + 1}",
        notes=lambda: ["k is flat"],
        fit=SimpleNamespace(agreeing=3, starts=[0] * 8, simulations=90, seconds=4.0, derivatives="exact, by tangents"),
        knowledge=SimpleNamespace(residual=1.0345),
    )
    identify.show(result)
    assert rows(capsys.readouterr().out) == [
        ["Mass"],
        ["unknown", "value", "95 % interval", "identified"],
        ["m", "2 kg", "0 to 1", "yes"],
        ["k", "3 kg", "1 to 2", "NO"],
        ["note: k is flat"],
        ["3 of 8 starts agree; 90 simulations, 22 per second, exact; RMS residual relative to noise 1.03"],
    ]
    result.fit.seconds = 0.0
    identify.show(result)
    assert "90 simulations, 0 per second" in capsys.readouterr().out
    shown = identify.IdentifyProgress("Mass")
    for phase in ("search", "search", "intervals"):
        shown.update(phase, 0.5, "best 3")
    assert capsys.readouterr().err.splitlines() == ["search", "intervals"]


def test_predictions_and_fits(capsys):
    row = {
        "file": "a.mat",
        "quantity": "tip",
        "rmse": 1.2345,
        "mean_error": -0.5,
        "largest": 3.0,
        "unit": "mm",
        "coverage": 0.9312,
        "consistent": False,
        "rezeroed_rmse": 0.25,
        "baselines": {"line": 2.0},
        "remarks": ["drifts"],
    }
    other = row | {"file": "b.mat", "coverage": None, "consistent": None, "baselines": {}, "remarks": []}
    third = row | {"file": "c.mat", "coverage": 1.0, "consistent": True, "remarks": []}
    validate.show("Robot", [SimpleNamespace(rows=[row, other]), SimpleNamespace(rows=[third])])
    head = ["file", "quantity", "RMSE", "mean", "largest", "unit", "coverage", "consistent", "rezeroed", "line"]
    assert rows(capsys.readouterr().out) == [
        ["Robot"],
        head,
        ["a.mat", "tip", "1.23", "-0.5", "3", "mm", "93%", "NO", "0.25", "2"],
        ["b.mat", "tip", "1.23", "-0.5", "3", "mm", "-", "-", "0.25", "nan"],
        ["c.mat", "tip", "1.23", "-0.5", "3", "mm", "100%", "yes", "0.25", "2"],
        ["a.mat: drifts"],
    ]
    fold = {"fold": "a", "quantity": "tip", "rmse": 1.5, "unit": "mm", "coverage": 0.5, "baselines": {"line": 2.5}}
    frozen = SimpleNamespace(
        seconds=12.4,
        parameters={"k": {"value": 1.25, "unit": "N/m", "interval": (1.0, 1.5)}},
        baselines={"line": None},
        cross_validation=[fold, {"fold": "b", "quantity": "tip", "rmse": 2.0, "unit": "mm"}],
    )
    validate.show_fit("Robot", {"all": frozen})
    assert rows(capsys.readouterr().out) == [
        ["Robot: all, 12 s"],
        ["parameter", "value", "unit", "95 % interval"],
        ["k", "1.25", "N/m", "1 to 1.5"],
        ["left out", "quantity", "RMSE", "unit", "coverage", "line"],
        ["a", "tip", "1.5", "mm", "50%", "2.5"],
        ["b", "tip", "2", "mm", "0%", "nan"],
    ]


@pytest.mark.slow
def test_estimates(capsys, monkeypatch):
    """In display units: a temperature has an offset, its deviation has none."""
    estimates = (
        SimpleNamespace(name="a.x", unit="m", display_unit="mm"),
        SimpleNamespace(name="a.T", unit="degC", display_unit=""),
    )
    alarm = SimpleNamespace(name="stuck", onset=1.25, probability=0.987, time=1.5)
    first, last = (
        SimpleNamespace(time=time, values=(value, 20.0), deviations=(1e-3, 0.5))
        for time, value in ((1.0, 1.0), (2.0, 2e-3))
    )
    problem = SimpleNamespace(title="Follow", estimates=estimates, notes=["noted"])
    replace(monkeypatch, "twin.follow", remarks=lambda *_: ["remark"])
    follow.show(problem, [first, last], [alarm], "2 times", 0.954, Path("runs/x"))
    assert rows(capsys.readouterr().out) == [
        ["Follow"],
        ["estimate", "value", "standard deviation"],
        ["a.x", "2 mm", "1 mm"],
        ["a.T", "20 degC", "0.5 degC"],
        ["change: stuck, since 1.2 s, with a probability of 98.7 %; noticed at 1.5 s"],
        ["note: noted"],
        ["note: remark"],
        ["2 times, 95 % of them with NIS in its 95 % band. Look: twin view runs/x"],
    ]


def study_outcome():
    """Outcome and answers of a study with each kind of result."""
    mark = SimpleNamespace(factor="rate", side="high")
    low = SimpleNamespace(factor="noise", side="low")
    answers = SimpleNamespace(
        changes=[],
        failed=2,
        metric=lambda metric, value: f"{metric} {value:g}",
        interval=lambda share: "80 to 90 %",
        spreads=[
            SimpleNamespace(
                metric="force",
                variant="PI",
                worst=17,
            )
        ],
        part_names=["50 %", "95 %"],
        quantiles=lambda _: [1.0, 2.0],
        shares=[SimpleNamespace(name="safe", variant="PI", part=0.85)],
        study=SimpleNamespace(metrics=defaultdict(lambda: SimpleNamespace(has_worst=True))),
        clusters=[
            SimpleNamespace(what="safe", variant="PI", cases=[5, 7], factors=[mark, low]),
            SimpleNamespace(what="fast", variant="PI", cases=[9], factors=[]),
        ],
    )
    keys = SimpleNamespace(quantiles=(0.5, 0.95), confidence=0.95)
    outcome = SimpleNamespace(
        study=SimpleNamespace(title="Study", keys=keys),
        cases=SimpleNamespace(rows=[0] * 30),
        before=10,
        seconds=4.0,
        worst=None,
        tuned=None,
    )
    return outcome, answers


def test_results_of_a_study(capsys, monkeypatch):
    """Distributions, pass rates, failures and sentences; with changes, these instead of distributions."""
    outcome, answers = study_outcome()
    replace(
        monkeypatch,
        "twin.study",
        percent="{:.0%}".format,
        headline=lambda *_: [SimpleNamespace(text=text, case=9, topic="Goes") for text in ("A sentence.", "Another.")],
    )
    assert study.show(outcome, answers) == 9
    first = rows(capsys.readouterr().out)
    answers.changes, answers.shares, answers.clusters = ([SimpleNamespace(metric="force", before=1.0, now=2.0)], [], [])
    answers.change = lambda change: "rate up"
    study.show(outcome, answers)
    second = rows(capsys.readouterr().out)
    assert first == [
        ["Study"],
        ["metric", "variant", "50 %", "95 %", "worst case"],
        ["force", "PI", "force 1", "force 2", "17"],
        ["requirement", "variant", "pass rate", "95% confidence"],
        ["safe", "PI", "85%", "80 to 90 %"],
        ["fails: safe (PI): 2 cases, rate high, noise low, such as case 5"],
        ["fails: fast (PI): 1 case, such as case 9"],
        ["Goes", "A sentence."],
        ["Another."],
    ]
    assert second == [
        ["Study"],
        ["change", "metric", "from", "to"],
        ["rate up", "force", "force 1", "force 2"],
        ["Goes", "A sentence."],
        ["Another."],
    ]


@pytest.mark.parametrize(
    ("status", "failed", "parts", "runs", "line"),
    [
        (
            "completed",
            0,
            [1.0],
            {},
            "PASS 30 cases, 20 of them now in 4 s. Report: runs/a/1/r.html  Look: twin run --case a:5",
        ),
        (
            "completed",
            0,
            [0.5],
            {7: "x"},
            "DONE 30 cases, 20 of them now in 4 s. Report: runs/a/1/r.html  Look: twin view a:7",
        ),
        (
            "completed",
            2,
            [1.0],
            {},
            "FAIL 30 cases, 20 of them now in 4 s. Report: runs/a/1/r.html  Look: twin run --case a:5",
        ),
        (
            "interrupted",
            0,
            [],
            {},
            "INTERRUPTED 30 of 80 cases, 20 of them now in 4 s. Report: runs/a/1/r.html  Look: twin run --case a:5",
        ),
    ],
)
def test_the_last_line_of_a_study(capsys, status, failed, parts, runs, line):
    outcome, answers = study_outcome()
    outcome.status, outcome.runs, outcome.folder, outcome.study.name = status, runs, Path("runs/a/1"), "a"
    outcome.study.total = 80
    answers.failed, answers.shares = failed, [SimpleNamespace(part=part) for part in parts]
    study.show_verdict(outcome, answers, "r.html")
    assert capsys.readouterr().out.strip() == line


def test_a_narrow_terminal_does_not_break_names_of_metrics():
    _, answers = study_outcome()
    answers.spreads[0].metric = "standard_deviation_of_the_force_error"
    console = Console(file=io.StringIO(), width=60)
    study.show_distributions(answers, console)
    lines = [line.split() for line in console.file.getvalue().splitlines()]
    assert ["standard_deviation_of_the_force_error"] in lines


def test_progress_of_a_study(capsys):
    """A line each ten seconds, and one at the end."""
    made = [
        StudyProgress("sample", done, 4, 2, float("nan"), left, 1)
        for done, left in ((0, 89.4), (1, 90.0), (4, 0.0), (1, float("nan")))
    ]
    fails = "1 fails a requirement, 2 did not finish"
    assert [progress_text(one) for one in made] == [
        f"0 of 4 cases, 89 s left; {fails}",
        f"1 of 4 cases, 2 min left; {fails}",
        f"4 of 4 cases; {fails}",
        f"1 of 4 cases; {fails}",
    ]
    none = StudyProgress("tune 3", 1, 9, 0, float("nan"), float("nan"))
    assert progress_text(none) == "tuning: 1 of 9 cases; 0 fail a requirement"
    assert [duration_text(seconds) for seconds in (89.4, 90, 5399, 5400)] == ["89 s", "2 min", "90 min", "1.5 h"]
    display, begin = (
        study.StudyDisplay("Study", "twin study a --resume"),
        dataclasses.replace(none, phase="building (1 of 8) heart"),
    )
    with display:  # at once: the first cases take 20 s
        display.update(begin)
        assert capsys.readouterr().err == "Study\n1 of 9 cases; building (1 of 8) heart\n"
    display.last_line -= study.LINE_INTERVAL
    for one in made[:3]:
        display.update(one)
    for phase in ("keeping case 3 (1 of 2)", "keeping case 4 (2 of 2)", "drawing the plots"):
        display.update(dataclasses.replace(made[2], phase=phase, folder=Path("runs/a")))
    shown = [progress_text(made[0]), progress_text(made[2])]
    shown += ["results: runs/a/report.html", "4 of 4 cases; keeping case 3 (1 of 2)", "4 of 4 cases; drawing the plots"]
    assert capsys.readouterr().err.splitlines() == shown


def test_a_signal_to_a_study_is_acknowledged_at_once(monkeypatch):
    """The first one with what follows; further ones of the same instant are ignored; the second one ends the process."""
    seen = []
    monkeypatch.setattr("os.write", lambda number, text: seen.append((number, text.decode())))
    monkeypatch.setattr("os._exit", seen.append)
    display = study.StudyDisplay("Study", "twin study a --resume")
    end = "Continue: twin study a --resume\n"
    display.acknowledge_signal()
    assert "interrupted: nothing is finished, nothing is written. Ctrl-C again" in seen.pop()[1]
    display.signal_time = 0.0
    display.update(StudyProgress("sample", 2, 32, 0, float("nan"), float("nan")))
    display.acknowledge_signal()
    display.acknowledge_signal()  # `timeout` signals the process and its group
    assert seen == [
        (
            2,
            f"interrupted: 2 of 32 cases are kept, tables and report are being written. Ctrl-C again: end at once. {end}",
        )
    ]
    display.signal_time -= study.SAME_SIGNAL
    display.acknowledge_signal()
    assert seen[1:] == [(2, f"ended at once: 2 of 32 cases are kept. {end}"), 130]


def test_the_clock_of_a_bar_is_whole_at_80_columns(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "line_width", lambda _: 80)
    bar = terminal.make_bar()
    bar.add_task("713 of 4000 cases, 6 min left; 14 fail a requirement, 2 did not finish", total=1.0)
    bar.console.print(bar.get_renderable())
    assert capsys.readouterr().out.rstrip().endswith(" 0 % 0:00:00")


def test_pass_rates_of_all_cases_are_one_line(capsys):
    rate = SimpleNamespace(low=0.9, part=1.0)
    answers = SimpleNamespace(
        interval=lambda _: "90 % to 100 %",
        shares=[
            SimpleNamespace(**{**vars(rate), "name": name, "variant": variant, "part": part})
            for name, variant, part in (
                ("range", "A", 1.0),
                ("range", "B", 1.0),
                ("contact", "A", 0.5),
                ("contact", "B", 1.0),
            )
        ],
    )
    outcome = SimpleNamespace(study=SimpleNamespace(keys=SimpleNamespace(confidence=0.95)))
    study.show_pass_rates(outcome, answers)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if line[:1].strip() or "contact" in line][-2:] == ["contact", "Pass"]
    assert lines[-1] == "Pass rate 100 %: range; contact (B) (95 % confidence: at least 90 %)"


def test_results_of_one_fmu(capsys):
    number, text = SimpleNamespace(dtype=np.dtype(float), unit="mm"), SimpleNamespace(dtype=np.dtype(object), unit="")
    columns = [("x", number, np.array([1.0, -2.5, 2.0])), ("s", text, np.array(["a", "b", "c"], object))]
    results = SimpleNamespace(columns=lambda: columns, times=[0, 500_000_000, 1_000_000_000])
    simulate.report_results(results, Path("out.csv"), replaced=True, with_summary=True)
    assert rows(capsys.readouterr().out) == [
        ["variable", "min", "max", "final", "unit"],
        ["x", "-2.5", "2", "2", "mm"],
        ["s", "c"],
        ["out.csv: 3 rows, 0 s to 1 s (replaced)"],
    ]
    simulate.report_results(results, Path("out.csv"), replaced=False, with_summary=False)
    assert capsys.readouterr().out == "out.csv: 3 rows, 0 s to 1 s\n"
    assert simulate.parse_start_values((" m =0.2", "s=a=b", "t=")) == {"m": "0.2", "s": "a=b", "t": ""}
    for arguments, message in (
        (("m",), "--start-value 'm': expected NAME=VALUE, such as mass=0.2."),
        (("=3",), "--start-value '=3': expected NAME=VALUE, such as mass=0.2."),
        (("m=1", " m=2"), "--start-value m is given twice. Give it once."),
    ):
        with pytest.raises(FMUError) as caught:
            simulate.parse_start_values(arguments)
        assert str(caught.value) == message


def test_checks_of_components(capsys):
    conformance_command.report("a", [])
    conformance_command.report("b", ["  one", "  two"])
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("a: ok\nb: FAILED\n", "  one\n  two\n")
    crash = CrashReport(signal=11, note="b: fmi", stack=['  File "/home/me/m.py", line 3 in f'])
    assert conformance_command.describe_crash(crash) == (
        "  fmi: crashed with SIGSEGV (Segmentation fault), at /home/me/m.py:3. Correct what it calls."
    )
    crash = CrashReport(signal=9, note="b: fmi", unresponsive_time=60.0)
    assert conformance_command.describe_crash(crash) == (
        "  fmi: did not return for 60 s. Correct it there, or raise --timeout."
    )

    def check(error):
        def fail(*_):
            if error:
                raise error

        return conformance_command.problems(fail, object, Path())

    assert check(None) == []
    assert check(TwinError("one\ntwo")) == ["one", "two"]
    (line,) = check(ZeroDivisionError("x"))
    assert line.endswith(". Correct it there.")
