"""Recorded signals as labeled arrays, and metrics as tables, for notebooks."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.component import unit
from twin.face.conversions import convert
from twin.installed import import_optional
from twin.results import readable_recording

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    import xarray as xr

    from twin.results import MetricTable, RecordedVariable, Signals

    Cases = Mapping[tuple[str, int], Signals]

METRICS = ("metric", "variant", "seed", "value", "unit", "paper", "ratio", "verdict")
REQUIREMENTS = ("name", "verdict", "detail")
VERDICTS = {"none": "no value", "other": "other settings", "cut": "run too short"}  # in words, as on the card


def array(variable: RecordedVariable, cases: Cases) -> xr.DataArray:
    """Return a variable over time x variant x seed x elements; `cases` are those that recorded it.

    The dimension of an array has its length in its name, `element_of_3`, since arrays of other lengths have other dimensions.
    Missing cases and missing samples are NaN, for which integers and Booleans become floats. Without cases it is empty.
    """
    xarray = import_optional("xarray", "python", "a DataArray")
    variants, seeds = (list(dict.fromkeys(case[i] for case in cases)) for i in (0, 1))
    times = [signals.time for signals in cases.values()]
    first = times[0] if times else np.zeros(0)
    time = first if all(np.array_equal(first, time) for time in times) else reduce(np.union1d, times)
    values = [signals.values[variable.name] for signals in cases.values()]
    is_complete = len(cases) == len(variants) * len(seeds) and all(len(case_time) == len(time) for case_time in times)
    kind = np.result_type(*values) if is_complete and values else np.dtype(np.float64)
    data = np.zeros((len(time), len(variants), len(seeds), *variable.shape), kind)
    if not is_complete:
        data[...] = np.nan
    for ((variant, seed), signals), value in zip(cases.items(), values, strict=True):
        data[np.searchsorted(time, signals.time), variants.index(variant), seeds.index(seed)] = value
    axes = [f"element_{i + 1}_of_{size}" for i, size in enumerate(variable.shape)]
    if len(axes) == 1:
        axes = [f"element_of_{variable.shape[0]}"]
    coordinates = {
        "time": ("time", time, {"units": "s"}),
        "variant": variants,
        "seed": np.array(seeds, int),
        **{axis: np.arange(1, size + 1) for axis, size in zip(axes, variable.shape, strict=True)},
    }
    notes = {"units": variable.unit, "display_units": variable.display_unit, "long_name": variable.description}
    attributes = {key: text for key, text in notes.items() if text or key == "units"}
    return xarray.DataArray(data, coordinates, ["time", "variant", "seed", *axes], variable.name, attributes)


def in_unit(values: xr.DataArray, symbol: str, is_difference: bool) -> xr.DataArray:
    """Return values in another unit; TwinError if they do not convert. `is_difference`: the offset of a unit does not matter."""
    factor, offset = convert(values.attrs.get("units", ""), symbol, str(values.name))
    converted = values * factor + (0.0 if is_difference else offset)
    attributes = {key: text for key, text in values.attrs.items() if key != "display_units"}
    return converted.assign_attrs({**attributes, "units": symbol})


def dataset(
    variables: Sequence[RecordedVariable], cases: Cases, variants: Sequence[str], seeds: Sequence[int]
) -> xr.Dataset:
    """Return variables over time x variant x seed x elements, each as `array` returns it."""
    xarray = import_optional("xarray", "python", "a Dataset")
    columns = [
        array(variable, {case: table for case, table in cases.items() if variable.name in table.values})
        for variable in variables
    ]
    aligned = xarray.align(*columns, join="outer")
    return xarray.Dataset({column.name: column for column in aligned}).reindex(variant=list(variants), seed=list(seeds))


def frame(time: Any, values: Mapping[str, Any], units: Mapping[str, str]) -> pd.DataFrame:
    """Return a column `time` [s], then one for each scalar, an array's as `x[1]`, `x[2]`; units in `.attrs["units"]`."""
    columns = {"time": time}
    column_units = {"time": "s"}
    for name, array in values.items():
        for index in np.ndindex(array.shape[1:]):
            label = name + (f"[{','.join(str(i + 1) for i in index)}]" if index else "")
            columns[label] = array[(slice(None), *index)]
            column_units[label] = units.get(name, "")
    made = import_optional("pandas", "python", "a DataFrame").DataFrame(columns)
    made.attrs["units"] = column_units
    return made


def samples(path: Path, variables: Sequence[RecordedVariable]) -> pd.DataFrame:
    """Return columns `variant`, `seed`, `time` [s], and one for each scalar; units in `.attrs["units"]`."""
    import_optional("pandas", "python", "a DataFrame")
    from pyarrow import parquet

    names = [column for variable in variables for column in variable.columns]
    with readable_recording(path):
        made: pd.DataFrame = parquet.read_table(path, columns=["variant", "seed", "time", *names]).to_pandas()
    units = {column: variable.unit for variable in variables for column in variable.columns}
    made.attrs = {"units": {"time": "s", **units}}
    return made


def metrics(summary: Mapping[str, Any]) -> MetricTable:
    """Return a row for each metric, variant and seed, in the unit of the tables; the verdict applies to the mean over the seeds."""
    import_optional("pandas", "python", "a DataFrame")
    from twin.results import MetricTable, display_units, si_conversion

    units = display_units({name: metric["unit"] for name, metric in summary["metrics"].items()})

    def in_unit(name: str, value: float | None) -> float | None:
        factor = si_conversion(summary["metrics"][name]["unit"])[0] / si_conversion(units[name])[0]
        return value if value is None or factor == 1.0 else unit.round_trip(value * factor)

    rows = [
        (
            name,
            variant,
            int(seed),
            in_unit(name, value),
            units[name],
            in_unit(name, figures["paper"]),
            None,
            VERDICTS.get(figures["verdict"], figures["verdict"]),
        )
        for name, metric in summary["metrics"].items()
        for variant, figures in metric["variants"].items()
        for seed, value in figures["values"].items()
    ]
    table: MetricTable = MetricTable(rows, columns=METRICS).astype({"seed": int, "value": float, "paper": float})
    table["ratio"] = table.value / table.paper.where(table.paper != 0.0)
    return table


def requirements(summary: Mapping[str, Any]) -> MetricTable:
    """Return a row for each requirement: those that fail, that are met, that are not judged."""
    ordered = sorted(summary["expectations"], key=lambda each: ("fail", "pass", "skipped").index(each["verdict"]))
    return table([[each[key] for key in REQUIREMENTS] for each in ordered], REQUIREMENTS)


def table(rows: Sequence[Any], columns: Sequence[str] | None = None) -> MetricTable:
    """Return rows as a DataFrame that prints all columns; without `columns`, rows are dicts."""
    import_optional("pandas", "python", "a DataFrame")
    from twin.results import MetricTable

    return MetricTable(rows, columns=columns)
