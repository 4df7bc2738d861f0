"""`twin simulate`: the reference FMUs of the Modelica Association, where a folder of them is named."""

import os
from pathlib import Path

import pytest

from tests.fmi.test_simulate import rows, run


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


REFERENCE = Path(os.environ.get("REFERENCE_FMUS", "reference-fmus")).absolute()  # see CONTRIBUTING.md


def cell(text: str) -> list[float] | str:
    if text in ("true", "false"):
        return [float(text == "true")]
    try:
        return [float(part) for part in text.split()]
    except ValueError:
        return text


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="REFERENCE_FMUS names no folder")
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize(
    "name", ["BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "StateSpace", "VanDerPol"]
)
def test_reference(name: str, version: str) -> None:
    fmu = REFERENCE / "fmus" / version / f"{name}.fmu"
    if not fmu.exists():
        pytest.skip("not there in this version")
    step = {"Feedthrough": ["--step-size", "0.1"], "Resource": ["--step-size", "1"]}.get(name, [])
    assert run(fmu, "-o", "a.csv", *step).exit_code == 0
    header, mine = rows("a.csv")
    wanted, theirs = rows(REFERENCE / "csv" / f"{name}_out.csv")
    assert [float(line[0]) for line in mine] == pytest.approx([float(line[0]) for line in theirs], abs=1e-12)
    for i, column in enumerate(wanted):
        places = [k for k, each in enumerate(header) if each.split("[")[0] == column]
        assert places or version == "2.0"
        for line, reference in zip(mine, theirs, strict=True):
            value = cell(reference[i])
            if isinstance(value, str):
                assert all(line[k] == value for k in places)
            elif places:
                assert [float(line[k]) for k in places] == pytest.approx(value, rel=1e-14, abs=1e-14)


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="REFERENCE_FMUS names no folder")
def test_reference_arrays() -> None:
    fmu = REFERENCE / "fmus/3.0/StateSpace.fmu"
    zeros = ["-s", "m=2", "-s", "n=2", "-s", "r=2", "-s", "A=[[0,0],[0,0]]", "-s", "B=1 0 0 1"]
    matrices = ["-s", "C=[[1, 1], [0, 2]]", "-s", "D=0,0,0,0", "-s", "x0=0 0", "-s", "u=1 2"]
    assert run(fmu, *zeros, *matrices, "--stop-time", 2, "-o", "a.csv").exit_code == 0
    assert [float(text) for text in rows("a.csv")[1][-1]] == pytest.approx([2.0, 6.0, 8.0])
    assert run(fmu, "-s", "A[1,2]=5", "-r", "A", "-o", "a.csv").exit_code == 0
    assert rows("a.csv")[0][:3] == ["time", "A[1,1]", "A[1,2]"]
    assert rows("a.csv")[1][0][:3] == ["0.0", "1.0", "5.0"]
    assert run(REFERENCE / "fmus/3.0/Clocks.fmu", "-r", "inClock1Ticks", "--stop-time", 9, "-o", "a.csv").exit_code == 0
    assert rows("a.csv")[1][-1] == ["9.0", "10"]


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="REFERENCE_FMUS names no folder")
def test_reference_inputs() -> None:
    run(
        REFERENCE / "fmus/3.0/Feedthrough.fmu",
        "-i",
        REFERENCE / "csv/Feedthrough_in.csv",
        "-o",
        "a.csv",
        "--step-size",
        0.5,
    )
    header, lines = rows("a.csv")
    last = dict(zip(header, lines[-1], strict=True))
    assert (last["Int8_output"], last["UInt64_output"]) == ("127", str(2**64 - 1))
    assert dict(zip(header, lines[1], strict=True))["Int64_output"] == str(-(2**63))
    assert last["time"] == "2.0"
