"""Two runs compared, and signals as files of other tools."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import loadmat

from twin.cli.compare import command as compare
from twin.cli.view import command as view
from twin.results import Evaluation, Signals
from twin.results.exporters import matlab_names
from twin.results.recording import run_folder
from twin.results.recording.run_folder import RecordedVariable

TIME = np.arange(101) * 0.01
COLUMNS = [
    RecordedVariable("a.force", unit="mN"),
    RecordedVariable("a.x", shape=(3,), unit="m"),
    RecordedVariable("a.on", np.dtype(bool)),
]


def written(folder: Path, *, force: float = 0.0, every: int = 1, stop: int = 101, on: int = 50) -> Path:
    """The folder of a run of two variants; `force`: added to one sample of the second [mN]."""
    folder.mkdir()
    cases = {}
    for variant, size in (("PI", 1.0), ("PI+FF", 2.0)):
        values = {"a.force": size * TIME, "a.x": np.outer(TIME, [1.0, 2.0, 3.0]), "a.on": np.arange(101) >= on}
        if variant == "PI+FF":
            values["a.force"] = values["a.force"] + force * (np.arange(101) == 40)
        part = slice(0, stop, every)
        cases[variant, 7] = Signals(
            TIME[part], {name: one[part] for name, one in values.items()}, {"a.force": "mN", "a.x": "m"}
        )
    with run_folder.SignalFile(folder / "signals.parquet", COLUMNS, {}) as file:
        for (variant, seed), signals in cases.items():
            file.write(variant, seed, signals)
    summary = run_folder.build_summary(run_folder.RunInfo("x"), Evaluation(), cases)
    (folder / "summary.json").write_text(json.dumps(run_folder.to_json_value(summary)))
    return folder


def called(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(compare, [str(word) for word in words])
    first, second, *lines = done.output.splitlines(keepends=True)
    assert (first[:7], second[:8]) == ("first: ", "second: ")  # which runs they are
    return done.exit_code, "".join(lines)


def test_equal_runs_agree(tmp_path: Path) -> None:
    a, b = written(tmp_path / "a"), written(tmp_path / "b")
    assert called(a, b, "--tolerance", 0) == (
        0,
        "The runs agree: 6 signals, 6 equal to the bit, 0 within 0.\n",
    )


def test_the_same_run_twice_is_said(tmp_path: Path) -> None:
    a = written(tmp_path / "a")
    text = "note: Both are the same run.\nThe runs agree: 6 signals, 6 equal to the bit, 0 within 1e-09.\n"
    assert called(a, tmp_path / "a") == (0, text)


def test_a_difference_is_found_where_it_is(tmp_path: Path) -> None:
    a, b = written(tmp_path / "a"), written(tmp_path / "b", force=0.02)
    code, text = called(a, b)
    assert code == 1
    row = next(line for line in text.splitlines() if line.strip().startswith("a.force"))
    assert row.split() == ["a.force", "0.02", "mN", "0.4", "s", "0.4", "s", "0.01", "1"]
    assert text.splitlines()[0] == "The runs differ: 1 of 6 signals (5 equal to the bit, 0 within 1e-09)."
    assert called(a, b, "--variant", "PI") == (0, "The runs agree: 3 signals, 3 equal to the bit, 0 within 1e-09.\n")
    assert called(a, b, "--variant", "PI+FF")[0] == 1
    assert called(a, b, "--tolerance", 0.011)[0] == 0
    assert called(a, b, "--tolerance", 0.009)[0] == 1
    assert called(a, b, "--signal", "a.x")[0] == 0
    done = CliRunner().invoke(compare, [str(a), str(b), "--signal", "a.on", "--signal", "a.forc"])
    assert done.exit_code == 1
    assert str(done.exception) == "'a.forc': not recorded in either run. Did you mean 'a.force'?"


def test_other_times_are_interpolated_and_said(tmp_path: Path) -> None:
    """A straight line is the same between samples; a Boolean that switches between them is not."""
    a, b = written(tmp_path / "a"), written(tmp_path / "b", every=2, stop=100)
    code, text = called(a, b, "--tolerance", 1e-12)
    assert code == 0
    assert text.count("sample times differ") == 1
    assert "note: all 2 cases: sample times differ; compared at those of the coarser recording." in text
    code, text = called(a, written(tmp_path / "d", stop=81))
    assert code == 1
    assert text.count("all 2 cases: recorded to 1 s and to 0.8 s.") == text.count("0.8 s") == 1
    assert "sample times differ" not in text  # they are the same while both are recorded
    code, text = called(a, written(tmp_path / "c", every=2, on=51), "--signal", "a.on")
    assert code == 1
    assert "0.5 s" in text


def test_what_is_in_one_run_alone_differs(tmp_path: Path) -> None:
    a, b = written(tmp_path / "a"), written(tmp_path / "b")
    summary = json.loads((b / "summary.json").read_text())
    summary["expectations"] = [{"name": "e", "verdict": "fail", "detail": ""}]
    summary["status"] = "interrupted"
    summary["cases"].pop()
    (b / "summary.json").write_text(json.dumps(summary))
    code, text = called(a, b)
    assert code == 1
    assert "status: completed and interrupted." in text
    assert "1 requirement only in the second run: e" in text
    assert "1 case only in the first run: PI+FF, seed 7" in text
    done = CliRunner().invoke(compare, [str(a), str(b), "--variant", "PI+F"])
    assert str(done.exception) == "'PI+F': neither run has this variant. Did you mean 'PI+FF'?"


def test_signals_of_one_run_are_one_line(tmp_path: Path) -> None:
    """However many signals and variants there are; not those of variants that only one run has."""
    names = [f"a.x{i:02}" for i in range(60)]
    for folder, recorded, variants in (("a", names, ("PI", "FF", "BW")), ("b", ["a.x03", "a.y"], ("PI", "FF"))):
        cases = {
            (variant, 1): Signals(TIME, dict.fromkeys(recorded + ["a.z"] * (variant == "BW"), TIME))
            for variant in variants
        }
        columns = [RecordedVariable(name) for name in [*recorded, "a.z"]]
        with run_folder.SignalFile(tmp_path / f"{folder}.parquet", columns, {}) as file:
            for (variant, seed), signals in cases.items():
                file.write(variant, seed, signals)
        (tmp_path / folder).mkdir()
        (tmp_path / f"{folder}.parquet").rename(tmp_path / folder / "signals.parquet")
        summary = run_folder.build_summary(run_folder.RunInfo("x"), Evaluation(), cases)
        (tmp_path / folder / "summary.json").write_text(json.dumps(run_folder.to_json_value(summary)))
    code, text = called(tmp_path / "a", tmp_path / "b")
    assert code == 1
    alone = "1 case only in the first, 59 signals only in the first, 1 signal only in the second"
    assert text.splitlines() == [
        "1 case only in the first run: BW, seed 1",
        f"The runs differ: 0 of 2 signals (2 equal to the bit, 0 within 1e-09), {alone}.",
        f"59 signals only in the first run: {', '.join(name for name in names[:7] if name != 'a.x03')} and 53 more",
        "1 signal only in the second run: a.y",
    ]
    assert "a.x59" in called(tmp_path / "a", tmp_path / "b", "--all")[1]


def exported(run: Path, target: Path, *words: str) -> str:
    done = CliRunner().invoke(view, [str(run), "--output", str(target), *words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_csv(tmp_path: Path) -> None:
    target = tmp_path / "x.csv"
    assert "3 signals of 2 cases" in exported(written(tmp_path / "a"), target)
    lines = target.read_text().splitlines()
    head = [word.strip('"') for word in lines[0].split(",")]
    assert head == ["variant", "seed", "time [s]", "a.force [mN]", "a.x[1] [m]", "a.x[2] [m]", "a.x[3] [m]", "a.on"]
    assert len(lines) == 203
    last = [word.strip('"') for word in lines[-1].split(",")]
    assert last[:2] == ["PI+FF", "7"]
    assert [float(word) for word in last[2:7]] == [1.0, 2.0, 1.0, 2.0, 3.0]
    assert "(replaced)" in exported(tmp_path / "a", target, "--variant", "PI", "--signal", "a.f*")
    assert len(target.read_text().splitlines()) == 102


def test_mat(tmp_path: Path) -> None:
    target = tmp_path / "x.mat"
    exported(written(tmp_path / "a"), target)
    found = loadmat(target, simplify_cells=True)
    first, second = found["cases"]
    assert (first["variant"], second["variant"], second["seed"]) == ("PI", "PI+FF", 7)
    assert np.array_equal(second["time"], TIME)
    assert np.array_equal(second["signals"]["a_force"], 2 * TIME)
    assert second["signals"]["a_x"].shape == (101, 3)
    assert second["signals"]["a_on"].tolist() == [0] * 50 + [1] * 51
    assert found["about"]["a_force"]["unit"] == "mN"


def test_names_in_matlab() -> None:
    names = matlab_names(["a.x[3]", "a.x_3", "der(x)", "1.y", "m." + 70 * "x", "m." + 71 * "x"])
    assert list(names.values())[:4] == ["a_x_3", "a_x_3_2", "der_x", "x1_y"]
    assert len(set(names.values())) == 6
    assert max(map(len, names.values())) <= 63


@pytest.mark.parametrize(
    ("words", "part"),
    [(["--signal", "a.q"], "was not recorded"), (["--variant", "Q"], "has no such case"), ([], "does not exist")],
)
def test_what_cannot_be_exported(tmp_path: Path, words: list[str], part: str) -> None:
    run = written(tmp_path / "a") if words else tmp_path / "none"
    done = CliRunner().invoke(view, [str(run), "--output", str(tmp_path / "x.csv"), *words])
    assert done.exit_code
    assert part in str(done.exception)
    assert not (tmp_path / "x.csv").exists()
