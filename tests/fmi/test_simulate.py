"""`twin simulate`: any FMU alone, inputs and outputs as tables.

Over 400 lines: a few small FMUs serve all tests.
"""

import csv
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from hypothesis import example, given
from hypothesis import strategies as st

from tests.fmi.third_party import FMI2, NATIVE, NATIVE_XML, native_fmu, python_fmu
from twin.cli.simulate import command, summarize
from twin.coupling import MemberVariable
from twin.errors import FMUError, SimulationError, TwinError
from twin.fmi import FMUMember, plan, simulate
from twin.fmi.csv_tables import InputColumn, Inputs, read_inputs
from twin.fmi.simulation import decimal_step


@pytest.fixture(scope="session")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return native_fmu(tmp_path_factory.mktemp("native"))


@pytest.fixture(scope="session")
def gain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return python_fmu(tmp_path_factory.mktemp("python"), FMI2, "Gain")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(command, [str(argument) for argument in arguments], standalone_mode=False)
    if result.exception and not isinstance(result.exception, TwinError):
        raise result.exception
    return result


def rows(path: Path | str = "Native_out.csv") -> tuple[list[str], list[list[str]]]:
    with open(path, newline="") as file:
        header, *lines = csv.reader(file)
    return header, lines


def refused(result: Result, words: str) -> None:
    assert isinstance(result.exception, TwinError)
    assert words in str(result.exception), str(result.exception)
    assert "\n" not in str(result.exception)


def test_defaults(native: Path) -> None:
    result = run(native, "-s", "data=00ff")
    assert result.output == "Native_out.csv: 11 rows, 0 s to 1 s\n"
    header, lines = rows()
    assert header == ["time", "y[1]", "y[2]", "echo", "y_seen[1]", "y_seen[2]"]
    assert (lines[3][0], lines[3][3]) == ("0.3", "00ff")
    assert float(lines[3][2]) == pytest.approx(0.6)
    assert run(native).output.endswith("(replaced)\n")


def test_last_step_is_shortened(native: Path) -> None:
    assert run(native, "--stop-time", 0.25, "--step-size", 0.1, "-o", "a.csv", "-r", "y").exit_code == 0
    assert [line[0] for line in rows("a.csv")[1]] == ["0.0", "0.1", "0.2", "0.25"]
    assert float(rows("a.csv")[1][-1][1]) == pytest.approx(0.25)


def test_output_interval(native: Path) -> None:
    run(native, "--start-time", 1, "--stop-time", 2, "--step-size", 0.001, "--output-interval", 0.25)
    assert [line[0] for line in rows()[1]] == ["1.0", "1.25", "1.5", "1.75", "2.0"]


def test_no_accumulated_time(native: Path) -> None:
    run(native, "--stop-time", 10, "--step-size", 0.01)
    times = [line[0] for line in rows()[1]]
    assert times == [repr(k / 100) for k in range(1001)]


def test_start_values(native: Path) -> None:
    run(native, "-s", "n=3", "-s", "x=[1, 2, 3]", "--stop-time", 1, "--step-size", 1, "-r", "y", "-r", "n")
    assert rows()[0] == ["time", "y[1]", "y[2]", "y[3]", "n"]
    assert rows()[1][-1] == ["1.0", "1.0", "2.0", "3.0", "3"]
    run(native, "-s", "x=3 4", "-s", "x[2]=5", "--step-size", 1, "--record", "y")
    assert rows()[1][-1] == ["1.0", "3.0", "5.0"]


def test_record_patterns(native: Path) -> None:
    run(native, "-r", "y*")
    assert rows()[0] == ["time", "y[1]", "y[2]", "y_seen[1]", "y_seen[2]"]


def test_without_outputs(tmp_path: Path) -> None:
    xml = NATIVE_XML.replace('causality="output"', 'causality="parameter"').replace(
        'variability="discrete"/>', 'variability="fixed"><Start value=""/></Binary>'
    )
    xml = re.sub(r"<Output [^>]*/>", "", xml)
    result = run(native_fmu(tmp_path, xml), "--step-size", "0.5", "-o", "none.csv")
    assert not result.exception
    assert "has no outputs and no local variables: only time is recorded" in result.output
    assert rows("none.csv") == (["time"], [["0.0"], ["0.5"], ["1.0"]])


def test_ends_by_itself(native: Path) -> None:
    result = run(native, "-s", "limit=0.25")
    assert result.exit_code == 0
    assert "note: Native: ended the simulation in the step from 200 ms" in result.output
    assert [line[0] for line in rows()[1]] == ["0.0", "0.1", "0.2", "0.25"]


def test_failure_keeps_results(native: Path) -> None:
    Path("in.csv").write_text("time,mode\n0,0\n0.3,3\n")
    result = run(native, "-i", "in.csv")
    refused(result, "Native: doStep returned ERROR. It logged: ERROR: mode is set Results up to then are in")
    assert [line[0] for line in rows()[1]] == ["0.0", "0.1", "0.2", "0.3"]


def test_parquet(native: Path) -> None:
    run(native, "-o", "a.parquet", "-s", "data=00FF")
    table = pq.read_table("a.parquet")
    assert table.column_names == ["time", "y[1]", "y[2]", "echo", "y_seen[1]", "y_seen[2]"]
    assert table.schema.field("y[1]").metadata == {b"unit": b"m"}
    assert table["echo"][0].as_py() == b"\x00\xff"


@pytest.mark.slow
def test_strings_and_booleans(gain: Path) -> None:
    Path("in.csv").write_text('time,u,n,b,s\n0,1,1,true,"a"\n0.2,1,5,0,"say ""hi"", you"\n')
    run(gain, "-i", "in.csv", "--stop-time", 0.4, "--step-size", 0.1, "-s", "label=<")
    text = Path("Gain_out.csv").read_text().splitlines()
    assert text[0] == "time,y,m,c,r"
    assert text[3] == '0.2,2.0,2,0,"<a"'
    assert text[4] == '0.3,2.0,6,1,"<say ""hi"", you"'


def test_interpolation(gain: Path) -> None:
    Path("in.csv").write_text("time,u,n\n0.1,1,1\n0.3,3,3\n0.3,10,7\n0.4,20,8\n")
    run(gain, "-i", "in.csv", "--stop-time", 0.6, "--step-size", 0.1, "-r", "u", "-r", "n", "-r", "y")
    table = np.array(rows("Gain_out.csv")[1], float)
    assert table[:, 1] == pytest.approx([1, 1, 1, 2, 10, 20, 20])
    assert table[:, 2].tolist() == [1, 1, 1, 1, 7, 8, 8]
    assert table[1:, 3] == pytest.approx(2 * table[1:, 1])


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("late", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["product", "sum", "single"])
def test_rows_whose_times_are_not_quite_those_of_the_steps(gain: Path, kind: str, late: float) -> None:
    """Held or jumping, a row acts in the step that it is meant for, and not one later."""
    count = 8
    times = {
        "product": np.arange(count) * 0.1 * (1 + late * 1e-15),
        "sum": np.cumsum([0.0, *[0.1] * (count - 1)]) * (1 + late * 1e-15),
        "single": np.float32(np.arange(count) * 0.1).astype(float) * (1 + late * 5e-8),
    }[kind]
    assert list(times) != [k / 10 for k in range(count)]
    held = "".join(f"{time!r},{k},{k}\n" for k, time in enumerate(times.tolist()))
    Path("in.csv").write_text(f"time,u,n\n{held}")
    run(gain, "-i", "in.csv", "--stop-time", 0.8, "--step-size", 0.1, "-r", "u", "-r", "n")
    table = np.array(rows("Gain_out.csv")[1], float)
    assert table[1:, 2].tolist() == list(range(count))
    assert table[1:, 1].tolist() == list(range(count))

    jump = float(times[3])
    Path("in.csv").write_text(f"time,u,n\n0,0,0\n{jump!r},0,0\n{jump!r},5,5\n1,5,5\n")
    run(gain, "-i", "in.csv", "--stop-time", 0.8, "--step-size", 0.1, "-r", "u", "-r", "n")
    table = np.array(rows("Gain_out.csv")[1], float)
    assert table[1:, 1].tolist() == table[1:, 2].tolist() == [0, 0, 0, 5, 5, 5, 5, 5]


@given(st.lists(st.integers(0, 40_000), min_size=1, max_size=30), st.integers(-20_000, 20_000))
@example([0], 1)  # exactly at the limit
def test_rows_keep_their_order_and_their_times(ticks: list[int], start: int) -> None:
    """Only what is within a thousandth of a step is moved, the nearest time, and the steps' own times are met exactly."""
    times = np.array(sorted(ticks)) * 1e-9
    moved = Inputs(times).on_steps(start, 1000, 12).times
    assert (np.diff(moved) >= 0).all()
    assert np.abs(moved - times).max() <= 1.0000001e-9
    for k in range(12):
        t = (start + k * 1000) / 1e9
        near = np.abs(times - t)[np.abs(times - t) < 1.1e-9]
        if near.min(initial=1.0) < 0.9e-9:
            assert (moved == t).sum() == (near == near.min()).sum()
        else:  # rows at the very limit: rounding decides
            assert (moved == t).sum() <= near.size


def test_rows_closer_than_a_thousandth_of_a_step_are_not_one(gain: Path) -> None:
    """A ramp in rows of 10 us and an edge of 50 us: at each step of 0.1 s the value is that of the row there."""
    times = np.arange(0, 80_001) * 1e-5
    Path("in.csv").write_text("time,u\n" + "".join(f"{t:.5f},{t:.5f}\n" for t in times))
    run(gain, "-i", "in.csv", "--stop-time", 0.8, "--step-size", 0.1, "-r", "u")
    assert np.array(rows("Gain_out.csv")[1], float)[1:, 1] == pytest.approx(np.arange(8) / 10, abs=1e-12)
    Path("in.csv").write_text("time,u\n0,0\n0.3,0\n0.30005,5\n1,5\n")
    run(gain, "-i", "in.csv", "--stop-time", 0.8, "--step-size", 0.1, "-r", "u")
    assert np.array(rows("Gain_out.csv")[1], float)[1:, 1].tolist() == [0, 0, 0, 0, 5, 5, 5, 5]


def test_units(native: Path, tmp_path: Path) -> None:
    xml = NATIVE_XML.replace('causality="parameter" variability="fixed" start="1 2"', 'causality="input" start="1 2"')
    path = native_fmu(tmp_path, xml)
    Path("in.csv").write_text('time [ms],x[1] [mm],"x[2]"\n0,1000,1\n1000,3000,5\n')
    run(path, "-i", "in.csv", "-r", "x", "--step-size", 0.5)
    assert [line[1:] for line in rows()[1]] == [["1.0", "1.0"], ["1.0", "1.0"], ["2.0", "3.0"]]
    Path("in.csv").write_text("time,x\n0,1 2\n1,3 4\n")
    run(path, "-i", "in.csv", "-r", "x", "--step-size", 0.5)
    assert [line[1:] for line in rows()[1]] == [["1.0", "2.0"], ["1.0", "2.0"], ["2.0", "3.0"]]
    Path("in.csv").write_text("time,x[1] [N]\n0,1\n")
    refused(run(path, "-i", "in.csv"), "N does not convert to m")


@pytest.mark.parametrize(("relative", "expected"), [("", "278.15"), ('relativeQuantity="true"', "5.0")])
def test_a_display_unit_of_the_fmu_in_a_header(tmp_path: Path, relative: str, expected: str) -> None:
    xml = NATIVE_XML.replace(
        'causality="parameter" variability="fixed" start="1 2"',
        f'causality="input" start="1 2" displayUnit="degC" {relative}',
    ).replace('unit="m"', 'unit="K"')
    path = native_fmu(tmp_path, xml)
    Path("in.csv").write_text("time,x[1] [degC],x[2] [K]\n0,5,1\n")
    run(path, "-i", "in.csv", "-r", "x", "--step-size", 0.5)
    assert rows()[1][-1][1:] == [expected, "1.0"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "in.csv: is empty"),
        ("time,u\n", "no rows"),
        ("u\n1\n", "in.csv:1: has no column 'time'"),
        ("time;u\n1;2\n", "Separate columns by commas"),
        ("time,w\n0,1\n", "in.csv:1: has no variable 'w'"),
        ("time,y\n0,1\n", "in.csv:1: 'y' is no input (output). Inputs: u, n, b, s."),
        ("time,u\n0,1\n1\n", "in.csv:3: has 1 cells, expected 2"),
        ("time,u\n0,1\n1,2,3\n", "in.csv:3: has 3 cells, expected 2"),
        ("time,u\n0,one\n", "in.csv:2: u is a number, not 'one'"),
        ("time,u\n0,\n", "in.csv:2: u is a number, not ''"),
        ("time,u\n0,nan\n", "in.csv:2: u is nan, expected a finite number"),
        ("time,u\n\n\n0,1\nsoon,1\n", "in.csv:5: time is 'soon'"),
        ("time,u\nnan,1\n", "in.csv:2: time is nan"),
        ("time,u\n1,1\n0,1\n", "in.csv:3: time 0 is before 1"),
        ("time,n\n0,1.5\n", "in.csv:2: n is a whole number"),
        ("time,n\n0,3000000000\n", "in.csv:2: n is a int32: 3000000000 is out of range"),
        ("time,b\n0,maybe\n", "in.csv:2: b is Boolean"),
        ("time,u,u\n0,1,1\n", "in.csv:1: column 'u' gives u a second time"),
        ("time,u [mm]\n0,1\n", "'u' has no unit"),
        ("time [kg],u\n0,1\n", "kg does not convert to s"),
        ('time,u\n0,"1\n', "cannot be read"),
    ],
)
def test_input_defects(gain: Path, text: str, words: str) -> None:
    Path("in.csv").write_text(text)
    refused(run(gain, "-i", "in.csv"), words)


def test_input_files(gain: Path) -> None:
    refused(run(gain, "-i", "gone.csv"), "gone.csv: cannot be read (No such file")
    Path("in.csv").write_bytes(b"time,u\n0,\xff\n")
    refused(run(gain, "-i", "in.csv"), "in.csv: is not UTF-8")
    Path("in.csv").write_bytes("\ufefftime,u\r\n0,1\r\n".encode())
    assert run(gain, "-i", "in.csv", "--stop-time", 0.1).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-s", "limit"), "expected NAME=VALUE"),
        (("-s", "limit=1", "-s", "limit=2"), "given twice"),
        (("-s", "limt=1"), "Did you mean 'limit'"),
        (("-o", "a.txt"), "a.txt: results are written as .csv or .parquet"),
        (("-o", "gone/a.csv"), "the folder gone is not there"),
        (("--stop-time", "0"), "stops at 0 s, not after its start"),
        (("--stop-time", "inf"), "is not a time"),
        (("--step-size", "0"), "not positive"),
        (("--step-size", "1e-10"), "are too many"),
        (("--step-size", "1/0"), "'1/0' is not a time. Give seconds, such as 0.001 or 1/30."),
        (
            ("--output-interval", "0.15", "--step-size", "0.1"),
            "not a multiple of the step 100 ms. Use --step-size 0.075",
        ),
        (("--output-interval", "0"), "output interval 0 s is not positive"),
        (("--record", "z"), "no variable 'z' to record"),
        (("--stop-time", "1e9", "--step-size", "1e-3"), "are too many"),
    ],
)
def test_arguments(native: Path, arguments: tuple[str, ...], words: str) -> None:
    refused(run(native, *arguments), words)


def test_fixed_step(tmp_path: Path) -> None:
    fixed = NATIVE_XML.replace('Size="true"', 'Size="false" fixedInternalStepSize="0.002"')
    path = native_fmu(tmp_path, fixed.replace(' stepSize="0.1"', ""))
    run(path)
    assert len(rows()[1]) == 501
    refused(run(path, "--step-size", 0.003), "steps of 3 ms are no multiple of its 2 ms. Use 2 ms or 4 ms")
    refused(run(path, "--stop-time", 0.005), "Use --stop-time 4 ms or 6 ms")


def test_output_interval_decides_where_the_step_is_only_suggested(native: Path) -> None:
    assert "step size 75 ms" in run(native, "--output-interval", 0.15, "--stop-time", 0.3).output
    assert [line[0] for line in rows()[1]] == ["0.0", "0.15", "0.3"]
    run(native, "--output-interval", 0.02, "--stop-time", 0.06)
    assert [line[0] for line in rows()[1]] == ["0.0", "0.02", "0.04", "0.06"]


def test_early_return(tmp_path: Path) -> None:
    path = native_fmu(tmp_path, source=NATIVE.replace("*terminate = true", "*early = true"))
    refused(run(path, "-s", "limit=0.25"), "returned early at 0.25 s")


@pytest.mark.slow
def test_discard_fmi2(tmp_path: Path) -> None:
    path = python_fmu(tmp_path, FMI2, "Stops", "return t < 0.25")
    result = run(path, "--stop-time", 1, "--step-size", 0.1)
    assert result.exit_code == 0
    assert "fmi2Terminated" in result.output
    assert [line[0] for line in rows("Stops_out.csv")[1]][:4] == ["0.0", "0.1", "0.2", "0.3"]


@pytest.mark.slow
def test_log(tmp_path: Path) -> None:
    path = python_fmu(tmp_path, FMI2, "Seizes", "raise RuntimeError('bearing seized')")
    refused(run(path), "Seizes: doStep returned FATAL. Use --log to see the FMU's messages.")
    result = run(path, "--log")
    refused(result, "bearing seized")
    assert "log: FATAL" in result.output


def test_interrupted(native: Path) -> None:
    member = FMUMember("part", native)

    def progress(_: float) -> None:
        raise KeyboardInterrupt

    outcome = simulate(member, plan(member, step=0.01), progress=progress)
    assert outcome.interrupted
    assert outcome.results.times == [0, 10_000_000]
    assert not member._unpacked.folder.exists()


def test_failing_initialization(native: Path) -> None:
    member = FMUMember("part", native, {"n": 9, "x": [0] * 9})
    with pytest.raises(SimulationError, match="fmi3SetUInt64 returned ERROR"):
        simulate(member, plan(member))
    assert not member._unpacked.folder.exists()


def test_summary(native: Path, capsys: pytest.CaptureFixture[str]) -> None:
    member = FMUMember("part", native)
    summarize(simulate(member, plan(member)).results)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["variable", "min", "max", "final", "unit"]
    assert lines[4].split() == ["y[2]", "0", "2", "2", "m"]


@given(st.integers(1, 10**13))
def test_decimal_step(duration: int) -> None:
    step = decimal_step(duration)
    assert str(step).rstrip("0") in ("1", "2", "5")
    assert duration < 500 or 500 <= duration // step <= 1300


@given(st.lists(st.integers(0, 10), min_size=1, max_size=8), st.integers(-5, 15))
def test_held_values(times: list[int], t: int) -> None:
    times.sort()
    inputs = Inputs(np.array(times, float))
    before = [k for k, time in enumerate(times) if time <= t]
    column = held_column(len(times))
    assert inputs.at(column, float(t))[0] == (before[-1] if before else 0)


def held_column(count: int) -> InputColumn:
    """A discrete input whose value is the number of its row."""
    held = MemberVariable("n", "input", "discrete", "Int32", np.dtype(np.int32))
    return InputColumn(held, np.arange(count, dtype=np.int32)[:, None])


@pytest.fixture(scope="session")
def reader(gain: Path) -> Iterator[FMUMember]:
    """A member whose variables tables are read for."""
    member = FMUMember("part", gain)
    yield member
    member.close()


@given(st.text(max_size=60))
def test_any_text(reader: FMUMember, tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(("time,u\n" + text).encode(errors="surrogatepass"))
    message = ""
    try:
        assert np.all(np.isfinite(read_inputs(path, reader).times))
    except FMUError as error:
        message = str(error)
    assert "\n" not in message
