"""Tables of bench measurements, read and converted; fits in words."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from twin.errors import TwinError
from twin.results import calibration, calibration_report

if TYPE_CHECKING:
    from pathlib import Path

COLUMNS = {"travel_mm": "way", "count": "number"}


def read(path: Path, text: str, **aliases: tuple[str, str]) -> dict[str, list[float]]:
    file = path / "a.csv"
    file.write_text(text)
    return {name: values.tolist() for name, values in calibration.read_table(file, COLUMNS, aliases).items()}


@pytest.mark.parametrize(
    ("text", "aliases", "travel"),
    [
        ("travel_mm,count\n1,2\n3.5,4\n", {}, [1.0, 3.5]),
        ("count; travel_mm\n2;1\n4;3.5\n", {}, [1.0, 3.5]),
        ("travel_mm [m],count,more\n0.001,2,x\n0.0035,4,y\n", {}, [1.0, 3.5]),
        ("way,count\n1,2\n3.5,4\n", {"travel_mm": ("way", "")}, [1.0, 3.5]),
        ("way,count\n100,2\n350,4\n", {"travel_mm": ("way", "um")}, [0.1, 0.35]),
        ("way [um],count\n100,2\n350,4\n", {"travel_mm": ("way", "")}, [0.1, 0.35]),
        ("travel (cm),count (all)\n1,2\n3.5,4\n", {"count": ("count (all)", "")}, [10.0, 35.0]),
        ("travel [in],count\n1,2\n3.5,4\n", {}, [25.4, 88.9]),
        ("Travel [in],COUNT\n1,2\n3.5,4\n", {}, [25.4, 88.9]),
        ("Travel_mm,travel_mm,count\n9,1,2\n9,3.5,4\n", {}, [1.0, 3.5]),
    ],
)
def test_columns_are_converted_to_their_own_units(
    tmp_path: Path, text: str, aliases: dict[str, tuple[str, str]], travel: list[float]
) -> None:
    found = read(tmp_path, text, **aliases)
    assert list(found) == ["travel_mm", "count"]
    assert found["travel_mm"] == pytest.approx(travel)
    assert found["count"] == [2.0, 4.0]
    assert [calibration.unit_of(name) for name in ("x_mm", "mm_x", "x")] == ["mm", "1", "1"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "way,count\n1,2\n",
            (
                "a.csv: column `travel_mm` is missing; there is way, count. Name the columns travel_mm, count, or map them "
                "to the names in the file with --columns (see `twin calibrate --help`)."
            ),
        ),
        ("travel_mm,count\n", "a.csv: has no readings below its header. Give one line for each."),
        ("travel_mm,count\n1,2\nx,3\n", "a.csv:3: travel_mm is 'x', expected a number."),
        ("travel_mm;count\n1,5;2\n", "a.csv:2: travel_mm is '1,5', expected a number. Write a decimal point."),
        ("travel_mm,count\n1,2\n1_000,3\n", "a.csv:3: travel_mm is '1_000', expected a number."),
        ("travel_mm,count\n1\n", "a.csv:2: count is '', expected a number."),
        ("travel_mm,count\n1,inf\n", "a.csv:2: count is inf, expected a finite number. Leave the line out."),
        ("travel_mm [N],count\n1,2\n", "a.csv: "),
    ],
)
def test_tables_that_cannot_be_read(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(TwinError) as caught:
        read(tmp_path, text)
    message = str(caught.value).replace(f"{tmp_path}/", "")
    assert message == problem if not problem.endswith(": ") else message.endswith("Correct the unit of travel_mm.")


def fit(residual: float, noise: float = float("nan"), r_squared: float = 0.5, error: float = 0.1) -> Any:
    values = np.array([0.0, 1.0, 2.0])
    return SimpleNamespace(
        residual=residual,
        noise=noise,
        r_squared=r_squared,
        span=10.0,
        errors=(error,),
        rows=5,
        used=range(3),
        measured=values,
        predicted=values + residual,
    )


FITS = {
    "small": fit(0.2, r_squared=0.05),
    "fair": fit(0.5),
    "poor": fit(0.501, r_squared=0.99),
    "noisy": fit(0.6, 0.4),
    "limit": fit(0.0, error=float("nan")),
}


def test_a_fit_worse_than_a_constant_is_a_warning() -> None:
    result = calibration.Calibration({}, {}, {"swapped": fit(0.1, r_squared=-0.2)}, [])
    (line,) = calibration_report.warnings(result)
    assert line == "warning: swapped: R2 -0.2: a constant fits better. Check columns and signs."


def test_fits_in_words(tmp_path: Path) -> None:
    """A fit is judged by its RMSE over the range of the motion, not by R2."""
    assert [calibration_report.verdict(FITS[name]) for name in FITS] == [
        "within 2%",
        "within 5%",
        "over 5%",
        "as the noise",
        "read off",
    ]
    result = calibration.Calibration(
        {"k": 2.5, "x": [1.0, 2.0], "weak": 0.1}, {"k": 0.01, "x": [0.0, 0.2], "weak": 0.06}, FITS, ["hint."]
    )
    assert calibration_report.fit_cells(FITS["noisy"]) == ("as the noise", "0.6", "10", "0.4", "3 of 5", "0.5")
    rows = [("k", "2.5", "0.01"), ("x[1]", "1", "-"), ("x[2]", "2", "0.2"), ("weak", "0.1", "0.06")]
    assert calibration_report.parameter_rows(result) == rows
    assert calibration_report.warnings(result) == [
        "warning: hint.",
        "warning: poor: RMSE 0.501 mm, 5% of the range. Check columns, units and order of its rows.",
        "warning: noisy: RMSE 0.6 mm, 6% of the range. The readings are noisy.",
        "warning: weak: 0.1 with standard error 0.06 is not determined. Take more readings.",
    ]
    text = calibration_report.to_yaml("sleeve", {"t": tmp_path / "a.csv"}, result).splitlines()
    assert text[:2] == [
        "# sleeve, calibrated from t=a.csv",
        "# small: within 2%; RMSE 0.2 mm, range 10 mm, noise not measured, 3 of 5 rows used, R2 0.05",
    ]
    assert text[-5:] == [
        "# standard errors: k 0.01, x[2] 0.2, weak 0.06",
        "parameters:",
        "  k: 2.5",
        "  x: [1.0, 2.0]",
        "  weak: 0.1",
    ]


@pytest.mark.slow
def test_the_picture_shows_each_fit_with_measured_values() -> None:
    picture = calibration_report.to_svg(calibration.Calibration({}, {}, FITS, []))
    assert [name for name in FITS if f"{name}: " in picture] == ["small", "fair", "poor", "noisy"]
    assert "measured minus fitted, RMSE 0.6 mm" in picture


@pytest.mark.parametrize(
    ("span", "sentence"),
    [
        (18.0, ""),
        (
            20.0 / 25.4,
            "t.a_mm spans 0.787 mm, the rig's stroke is 20 mm. Check its unit. With the header `a [in]` it spans",
        ),
        (2.0, "With the header `a [cm]` it spans 20 mm."),
        (20000.0, "With the header `a [um]` it spans 20 mm."),
        (1e-6, "the rig's stroke is 20 mm. Check its unit."),
    ],
)
def test_a_range_far_from_the_stroke_gives_a_hint(span: float, sentence: str) -> None:
    hints = calibration.stroke_hints("t.a_mm", np.array([300.0, 300.0 + span]), 20.0)
    assert bool(hints) == bool(sentence)
    assert sentence in "".join(hints)


def test_a_component_is_calibrated_by_its_own_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("own.calibrate")
    module.TABLES, module.STROKES = {"t": COLUMNS}, {"travel_mm": 50.0}  # type: ignore[attr-defined]
    module.standard_errors = lambda fits: {"k": fits["f"]}  # type: ignore[attr-defined]
    module.doubts = lambda tables, fits: [f"k of {len(tables)} table is doubtful."]  # type: ignore[attr-defined]
    module.calibrate = lambda tables: ({"k": float(np.sum(tables["t"]["count"]))}, {"f": 1})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "own", ModuleType("own"))
    monkeypatch.setitem(sys.modules, "own.calibrate", module)
    component: Any = type("Own", (), {"__module__": "own.model", "variables": [SimpleNamespace(name="k")]})
    file = tmp_path / "a.csv"
    file.write_text("travel_mm,number\n1,2\n3,4\n")
    aliases = {"t": {"count": ("number", "")}}
    hint = "t.travel_mm spans 2 mm, the rig's stroke is 50 mm. Check its unit. With the header `travel [in]` it spans 50.8 mm."
    expected = calibration.Calibration({"k": 6.0}, {"k": 1}, {"f": 1}, [hint, "k of 1 table is doubtful."])
    assert calibration.calibrate(component, "own", {"t": file}, aliases) == expected
    with pytest.raises(TwinError, match=r"^u=.*a\.csv: own has no table 'u'\. Its tables: t\.$"):
        calibration.calibrate(component, "own", {"u": file}, {})
    with pytest.raises(TwinError, match=r"^columns: own has no table with column t\.cont\. Did you mean 'count'"):
        calibration.calibrate(component, "own", {"t": file}, {"t": {"cont": ("number", "")}})
    other: Any = type("Other", (), {"__module__": "twin.results.evaluation"})
    with pytest.raises(
        TwinError, match=r"^it: has no calibration\. A component that has one keeps it in twin\.results\.cal"
    ):
        calibration.calibration_module(other, "it")
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "__init__.py").write_text("")
    (broken / "calibrate.py").write_text("import no_such_module\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):  # what is missing is not the calibration
        calibration.calibration_module(type("Broken", (), {"__module__": "broken.model"}), "it")  # type: ignore[arg-type]
