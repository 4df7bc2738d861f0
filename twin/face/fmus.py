"""FMUs in Python: run anyone's alone, export one's own."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from twin import clock
from twin.compiler import model_name
from twin.component import Component, catalog
from twin.errors import DeclarationError, FMUError, SimulationError, TwinError
from twin.face.arrays import frame
from twin.face.conversions import as_arguments, choice, listed, plain, seconds
from twin.face.progress import shown
from twin.face.scenario import Scenario, reference
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
    input: Any = None,  # noqa: A002 - the word of FMPy and of the command line
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
    """Run any FMU (FMI 2.0, 3.0) alone: column `time` [s], then its outputs, or what `record` names.

    `input`: a DataFrame, a structured array, a dict of columns or the path of a CSV file, with a column `time` [s] (or
    times as the DataFrame's index) and inputs; `x [mm]` converts, `u[1]` is an element. `solver` (Radau, RK45, CVODE, ...)
    and relative `tolerance`: of Model Exchange, which is taken where there is no Co-Simulation. Times: seconds or text such as
    `10 ms`; as the FMU suggests if not given. `.attrs` has `units`, `notes`, `log`, and `interrupted` after Ctrl-C.
    SimulationError if the FMU fails, with `results` until then; TwinError for whatever else is wrong.
    """
    path = Path(fmu)
    given = {name: plain(value) for name, value in (start_values or {}).items()}
    with as_arguments(), shown(progress, path.stem) as share:
        member = made(path.stem, path, given, logging=logging, interface=interface, solver=solver, tolerance=tolerance)
        try:
            planned = plan(
                member,
                start=seconds(start_time, "start_time"),
                stop=seconds(stop_time, "stop_time"),
                step=seconds(step_size, "step_size"),
                interval=seconds(output_interval, "output_interval"),
                record=tuple(listed(record)),
            )
            inputs = table(input, member) if input is not None else None
            outcome = run_alone(member, planned, inputs, progress=partial(report_progress, share, path.stem))
        finally:
            member.close()
        results = table_of(outcome.results)
        results.attrs.update(notes=outcome.notes, log=list(member.log), interrupted=outcome.interrupted)
        if outcome.failure:
            hint = "" if logging or member.log else " Use --log to see what it logs."
            error = SimulationError(
                f"{outcome.failure}{hint} What was recorded until then is in this error's `results`."
            )
            error.results = results
            raise error
    return results


def report_progress(share: Callable[[str, float], object], name: str, part: float) -> None:
    """Report the progress of a run."""
    share(name, part)


def table_of(results: Results) -> pd.DataFrame:
    """What an FMU did, one column for each scalar."""
    values = {
        name: values.astype(np.bool_) if variable.type in ("Boolean", "Clock") else values
        for name, variable, values in results.columns()
    }
    return frame(
        np.array([clock.seconds(time) for time in results.times]),
        values,
        {name: one.unit for name, one, _ in results.columns()},
    )


def table(given: Any, member: FMUMember) -> Any:
    """Inputs over time, from a file or from columns in memory."""
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
    """A column's name with the unit that a table of ours says it is in."""
    variable = member.variables.get(name)
    return (
        f"{name} [{unit}]" if unit and variable is not None and variable.unit and variable.dtype.kind == "f" else name
    )


def columns_of(given: Any) -> tuple[dict[str, list[Any]], Mapping[str, str]]:
    """Columns as plain values by name, and their units where a table of ours says them."""
    if isinstance(given, np.ndarray) and given.dtype.names:
        return {name: given[name].tolist() for name in given.dtype.names}, {}
    if isinstance(given, Mapping):
        return {str(name): list(plain(values)) for name, values in given.items()}, {}
    if not (hasattr(given, "columns") and hasattr(given, "index")):
        kinds = "a DataFrame, a structured array, a dict of columns or the path of a CSV file"
        raise FMUError(f"{INPUT}: expected {kinds}, not {type(given).__name__}.")
    columns = {str(name): given[name].tolist() for name in given.columns}
    if not any(csv_tables.split_unit(name)[0].lower() == "time" for name in columns):
        columns = {"time": given.index.tolist(), **columns}
    return columns, given.attrs.get("units", {})


def export(
    what: str | Path | type[Component] | Scenario,
    path: str | Path | None = None,
    *,
    fmi: str = "3.0",
    platforms: str | Sequence[str] = (),
    sources: bool = False,
    members: str | Sequence[str] = (),
    group: str | None = None,
    variant: str | None = None,
    force: bool = False,
    build: str | Path = "build",
) -> Path:
    """Write a component (a name in fmus/, `module:Class`, a class), or part of a scenario, as an FMU; its path.

    Of a scenario: `members`, or a `group` that it names, of a `variant`. `platforms`: this machine's if not given, several,
    or "all". `path`: NAME.fmu here if not given; a file that is there is only replaced with `force`.
    """
    with as_arguments():
        choice(fmi, exporter.VERSIONS, "fmi")
        cls = exportable(what, listed(members), group, variant)
        target = Path(path) if path is not None else Path(f"{model_name(cls)}.fmu")
        if target.exists() and not force:
            raise TwinError(f"{target} is there already. Give force=True to replace it, or another path.")
        wanted = tuple(exporter.TARGETS) if "all" in listed(platforms) else tuple(listed(platforms))
        return exporter.export(cls, fmi, target, Path(build), wanted, sources=sources)


def exportable(
    what: str | Path | type[Component] | Scenario, members: list[str], group: str | None, variant: str | None
) -> type[Component]:
    """The component to export."""
    if isinstance(what, Scenario):
        return part(what.checked, members, group, variant)
    if not isinstance(what, type):
        if str(what).endswith((".yaml", ".yml")):
            return part(load_scenario(what), members, group, variant)
        what = catalog.component(str(what))
    if members or group or variant:
        raise TwinError(
            f"{what.__name__}: members, group and variant belong to a scenario. Give one, or leave them out."
        )
    reference(what, {})
    if not has_source(what):
        raise DeclarationError(
            f"{what.__name__}: its source cannot be found. Define it in a file or in a notebook's cell."
        )
    return what
