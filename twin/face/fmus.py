"""FMUs in Python: simulate a single FMU, export a component."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from twin import clock, compiler
from twin.compiler import model_name
from twin.component import Component, catalog
from twin.errors import DeclarationError, FMUError, SimulationError, TwinError
from twin.face.arrays import frame
from twin.face.conversions import as_list, check_file, choice, plain, python_option_names, seconds
from twin.face.progress import progress_callback
from twin.face.scenario import Scenario, reference
from twin.files import split_unit
from twin.fmi import csv_tables, exporter, plan
from twin.fmi import member as made
from twin.fmi import simulate as run_alone
from twin.scenario import has_source, load_scenario, part

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd

    from twin.face.progress import Progress
    from twin.fmi import FMUMember, Results

INPUT = "input"  # in messages


def simulate(
    fmu: str | Path,
    input: Any = None,  # noqa: A002 - as in FMPy and on the command line
    *,
    start_values: Mapping[str, Any] | None = None,
    start_time: float | str | None = None,
    stop_time: float | str | None = None,
    step_size: float | str | None = None,
    output_interval: float | str | None = None,
    record: str | Sequence[str] | None = None,
    interface: Literal["", "co_simulation", "model_exchange", "scheduled_execution"] = "",
    solver: str = "",
    tolerance: float | None = None,
    progress: Progress = None,
    logging: bool = False,
) -> pd.DataFrame:
    """Simulate a single FMU (FMI 2.0, 3.0); return a column `time` [s], then its outputs, or the variables of `record`.

    `input`: a DataFrame, a structured array, a dict of columns or the path of a CSV file, with a column `time` [s] (or times as
    the DataFrame's index) and inputs; `x [mm]` converts units, `u[1]` is an element. `solver` (Radau, RK45, CVODE, ...) and
    relative `tolerance` apply to Model Exchange, which is used if there is no Co-Simulation. Times: seconds or text such as
    `10 ms`; defaults of the FMU otherwise. `.attrs` has `units`, `notes`, `log`, and `interrupted` after Ctrl-C.
    SimulationError if the FMU fails, with the `results` so far; TwinError for other problems.
    """
    check_file(fmu, "fmu", (".fmu",), FMUError)
    path = Path(fmu)
    given = {name: plain(value) for name, value in (start_values or {}).items()}
    with python_option_names(), progress_callback(progress, path.stem) as share:
        member = made(path.stem, path, given, logging=logging, interface=interface, solver=solver, tolerance=tolerance)
        try:
            planned = plan(
                member,
                start=seconds(start_time, "start_time"),
                stop=seconds(stop_time, "stop_time"),
                step=seconds(step_size, "step_size"),
                interval=seconds(output_interval, "output_interval"),
                record=tuple(as_list(record)),
            )
            inputs = table(input, member) if input is not None else None
            outcome = run_alone(member, planned, inputs, progress=partial(report_progress, share, path.stem))
        finally:
            member.close()
        results = table_of(outcome.results)
        results.attrs.update(notes=outcome.notes, log=list(member.log), interrupted=outcome.interrupted)
        if outcome.failure:
            hint = "" if logging or member.log else " Use --log to see the FMU's messages."
            error = SimulationError(f"{outcome.failure}{hint} Results up to then are in this error's `results`.")
            error.results = results
            raise error
    return results


def report_progress(share: Callable[[str, float], object], name: str, part: float) -> None:
    """Report the progress of a run."""
    share(name, part)


def table_of(results: Results) -> pd.DataFrame:
    """Return the results of an FMU, one column for each scalar."""
    values = {
        name: values.astype(np.bool_) if variable.type in ("Boolean", "Clock") else values
        for name, variable, values in results.columns()
    }
    return frame(
        np.array([clock.seconds(time) for time in results.times]),
        values,
        {name: column.unit for name, column, _ in results.columns()},
    )


def table(given: Any, member: FMUMember) -> Any:
    """Return inputs over time, from a file or from columns in memory."""
    if isinstance(given, str | Path):
        return csv_tables.read_inputs(Path(given), member)
    columns, units = columns_of(given)
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise FMUError(f"{INPUT}: columns have different lengths, {lengths}. Give each a value for every time.")
    header = [titled(name, units.get(name, ""), member) for name in columns]
    rows = zip(*columns.values(), strict=True)
    return csv_tables.table_inputs([(0, header), *((i + 1, list(row)) for i, row in enumerate(rows))], INPUT, member)


def titled(name: str, unit: str, member: FMUMember) -> str:
    """Return the name of a column with its unit, if known."""
    variable = member.variables.get(name)
    return (
        f"{name} [{unit}]" if unit and variable is not None and variable.unit and variable.dtype.kind == "f" else name
    )


def columns_of(given: Any) -> tuple[dict[str, list[Any]], Mapping[str, str]]:
    """Return columns as plain values by name, and their units if known."""
    if isinstance(given, np.ndarray) and given.dtype.names:
        return {name: given[name].tolist() for name in given.dtype.names}, {}
    if isinstance(given, Mapping):
        return {str(name): list(plain(values)) for name, values in given.items()}, {}
    if not (hasattr(given, "columns") and hasattr(given, "index")):
        kinds = "a DataFrame, a structured array, a dict of columns or the path of a CSV file"
        raise FMUError(f"{INPUT}: expected {kinds}, not {type(given).__name__}.")
    columns = {str(name): given[name].tolist() for name in given.columns}
    if not any(split_unit(name)[0].lower() == "time" for name in columns):
        columns = {"time": given.index.tolist(), **columns}
    return columns, given.attrs.get("units", {})


def export(
    what: str | Path | type[Component] | Scenario,
    path: str | Path | None = None,
    *,
    fmi: Literal["2.0", "3.0"] = "3.0",
    platforms: str | Sequence[str] = (),
    sources: bool = False,
    members: str | Sequence[str] = (),
    group: str | None = None,
    variant: str | None = None,
    force: bool = False,
    build: str | Path = "build",
) -> Path:
    """Export a component (a name in fmus/, `module:Class`, a class) or a part of a scenario as an FMU; return its path.

    Of a scenario: `members` or a `group`, of a `variant`. `platforms`: default this machine; several, or "all". `path`: default
    NAME.fmu; an existing file is replaced only with `force`.
    """
    with python_option_names():
        choice(fmi, exporter.VERSIONS, "fmi")
        cls = exportable(what, as_list(members), group, variant)
        target = Path(path) if path is not None else Path(f"{model_name(cls)}.fmu")
        if target.exists() and not force:
            raise TwinError(f"{target} exists. Use force=True to replace it, or another path.")
        targets = tuple(compiler.PLATFORMS) if "all" in as_list(platforms) else tuple(as_list(platforms))
        return exporter.export(cls, fmi, target, Path(build), targets, sources=sources)


def exportable(
    what: str | Path | type[Component] | Scenario, members: list[str], group: str | None, variant: str | None
) -> type[Component]:
    """Return the component to export."""
    if isinstance(what, Scenario):
        return part(what.checked, members, group, variant)
    if not isinstance(what, type):
        check_file(what, "what", (".yaml", ".yml"))
        if str(what).endswith((".yaml", ".yml")):
            return part(load_scenario(what), members, group, variant)
        what = catalog.component(str(what))
    if members or group or variant:
        raise TwinError(f"{what.__name__}: members, group and variant need a scenario. Give one, or omit them.")
    reference(what, {})
    if not has_source(what):
        raise DeclarationError(
            f"{what.__name__}: its source cannot be found. Define it in a file or in a notebook's cell."
        )
    return what
