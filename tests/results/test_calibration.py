"""Tables of bench measurements, read and converted; fits in words."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from twin.errors import TwinError
from twin.results import calibration

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
                "a.csv: column travel_mm is missing; there is way, count. Name the columns travel_mm, count, or say with "
                "--columns how the file calls them."
            ),
        ),
        ("travel_mm,count\n", "a.csv: has no readings below its header. Give one line for each."),
        ("travel_mm,count\n1,2\nx,3\n", "a.csv:3: travel_mm is 'x', expected a number."),
        ("travel_mm;count\n1,5;2\n", "a.csv:2: travel_mm is '1,5', expected a number. Write a decimal point."),
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


def fit(r_squared: float, residual: float = 0.01234, used: int = 3) -> Any:
    return SimpleNamespace(r_squared=r_squared, residual=residual, used=range(used))


def test_fits_in_words(tmp_path: Path) -> None:
    fits = {"good": fit(0.9), "poor": fit(0.8999), "odd": fit(float("nan"))}
    assert calibration.quality(fits["good"]) == "R2 0.9000, residual 0.0123, 3 measurements"
    assert calibration.quality(fits["odd"]) == "residual 0.0123, 3 measurements"
    warning = "warning: poor: R2 0.90 is below 0.9. Check columns, units and order of its measurements."
    assert calibration.warnings(fits) == [warning]
    text = calibration.to_yaml("sleeve", {"t": tmp_path / "a.csv"}, {"k": 2.5, "x": [1.0, 2.0]}, fits)
    assert text.splitlines() == [
        "# sleeve, calibrated from t=a.csv",
        "# good: R2 0.9000, residual 0.0123, 3 measurements",
        "# poor: R2 0.8999, residual 0.0123, 3 measurements",
        "# odd: residual 0.0123, 3 measurements",
        f"# {warning}",
        "parameters:",
        "  k: 2.5",
        "  x: [1.0, 2.0]",
    ]


def test_a_component_is_calibrated_by_its_own_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("own.calibrate")
    module.TABLES = {"t": COLUMNS}  # type: ignore[attr-defined]
    module.calibrate = lambda tables: ({"k": float(np.sum(tables["t"]["count"]))}, {"f": 1})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "own", ModuleType("own"))
    monkeypatch.setitem(sys.modules, "own.calibrate", module)
    component: Any = type("Own", (), {"__module__": "own.model", "variables": [SimpleNamespace(name="k")]})
    file = tmp_path / "a.csv"
    file.write_text("travel_mm,number\n1,2\n3,4\n")
    aliases = {"t": {"count": ("number", "")}}
    assert calibration.calibrate(component, "own", {"t": file}, aliases) == ({"k": 6.0}, {"f": 1})
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
