"""Public FMUs by our importer and by FMPy: which of the two runs each, and where their results differ.

    python -m benchmarks.public_fmus FOLDER -o docs/data/public_fmus.csv
    python -m benchmarks.public_fmus FOLDER --systems -o docs/data/public_systems.csv

FOLDER holds a whole clone of each repository (of modelica+Reference-FMUs, the builds in folders 2.0 and 3.0). Of equal
files one is taken. Both tools run the same start, stop and step: those
that the FMU suggests, at most 200 steps. Co-Simulation if offered, else Model Exchange (FMPy by CVode). FMPy runs with
`validate=False`. Each run has its own process and 30 s of processor time. Where results differ, FMPy runs again, and by its calls with our
arguments. Remarks of an existing table are kept. Systems (SSP, and OspSystemStructure.xml) make ten steps here, and with FMPy or libcosim.

FMUs are native code: run this only in a machine that you can throw away.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import multiprocessing
import os
import re
import resource
import shutil
import signal
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from benchmarks import ring
from twin.errors import TwinError
from twin.fmi import member, plan, simulate
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, load_scenario

STEPS = 200  # largest number
CPU_LIMIT, LIMIT = 30, 300  # processor time and time of a run [s]
EXACT, SOLVED = 1e-12, 1e-3  # difference that counts, of the largest value: Co-Simulation, Model Exchange
SYSTEMS = ("*.ssp", "SystemStructure.ssd", "*OspSystemStructure*.xml")
REALS = ("Real", "Float64")
COLUMNS = ("repository", "file", "FMI", "interface", "tool", "ours", "FMPy", "difference", "remark")

Table = dict[str, np.ndarray[Any, Any]]


def experiment(path: Path) -> dict[str, Any]:
    """Start, stop and step [s], interface, version and tool of an FMU, as FMPy reads them."""
    description = read_model_description(str(path), validate=False)
    suggested = description.defaultExperiment
    start = float((suggested and suggested.startTime) or 0.0)
    stop = float((suggested and suggested.stopTime) or start + 1.0)
    fixed = getattr(description.coSimulation, "fixedInternalStepSize", None)
    step = float((suggested and suggested.stepSize) or fixed or (stop - start) / STEPS)
    step = step if step < stop - start else (stop - start) / STEPS
    count = min(STEPS, max(1, int((stop - start) / step + 1e-9)))
    return {
        "start": start,
        "step": step,
        "stop": round(start + count * step, 12),  # without the rounding error of the sum
        "interface": "Co-Simulation" if description.coSimulation else "Model Exchange",
        "version": description.fmiVersion,
        "tool": description.generationTool or "",
    }


def ours(path: Path, times: dict[str, Any]) -> Table:
    """Our results."""
    part = member("it", path)
    text = {name: repr(times[name]) for name in ("start", "stop", "step")}
    outcome = simulate(part, plan(part, **text))
    if outcome.failure:
        raise RuntimeError(outcome.failure)
    columns = {name: np.asarray(values) for name, _, values in outcome.results.columns()}
    return {"time": np.array(outcome.results.times, float) / 1e9, **columns}


def fmpys(path: Path, times: dict[str, Any]) -> Table:
    """FMPy's results."""
    found = simulate_fmu(
        str(path),
        validate=False,
        start_time=times["start"],
        stop_time=times["stop"],
        step_size=times["step"],
        output_interval=times["step"],
    )
    return {name: found[name] for name in found.dtype.names}


def equal_steps(path: Path, times: dict[str, Any]) -> Table:
    """Results of Co-Simulation (FMI 2.0, 3.0) by FMPy's calls with the arguments of our loop: all steps have the same size.

    `simulate_fmu` passes differences of times, which vary in the last bit.
    """
    description = read_model_description(str(path), validate=False)
    is_fmi2 = description.fmiVersion.startswith("2")
    outputs = [each for each in description.modelVariables if each.causality == "output" and each.type in REALS]
    references = [each.valueReference for each in outputs]
    suggested = description.defaultExperiment
    tolerance = float(suggested.tolerance) if suggested and suggested.tolerance else None
    count = round((times["stop"] - times["start"]) / times["step"])
    points = np.round((times["start"] + times["step"] * np.arange(count + 1)) * 1e9) / 1e9
    with tempfile.TemporaryDirectory() as folder:
        extract(str(path), unzipdir=folder)
        slave = (FMU2Slave if is_fmi2 else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="it",
        )
        slave.instantiate()
        if is_fmi2:
            slave.setupExperiment(startTime=times["start"], tolerance=tolerance)
            slave.enterInitializationMode()
        else:
            slave.enterInitializationMode(startTime=times["start"], tolerance=tolerance)
        slave.exitInitializationMode()
        read = slave.getReal if is_fmi2 else slave.getFloat64
        rows = [read(references)]
        for point in points[:-1]:
            slave.doStep(point, times["step"])
            rows.append(read(references))
    columns = np.array(rows).T
    return {"time": points, **{each.name: column for each, column in zip(outputs, columns, strict=True)}}


def our_system(path: Path) -> None:
    """Ten steps of a system by our loop."""
    scenario = load_scenario(path, ["stop_time=1000 s"])  # many have none
    case = scenario.cases()[0]
    simulation = build_simulation(case, resolve_catalogs(scenario)[case.variant], Backend.fmu, ring.BUILD)
    simulation.initialize(case.start_ns)
    simulation.advance(case.start_ns + 10 * case.step_ns)


def other_system(path: Path) -> None:
    """Ten steps of an SSP by FMPy, of an OspSystemStructure by libcosim."""
    if path.suffix == ".xml":
        from libcosimpy.CosimExecution import CosimExecution

        if not CosimExecution.from_osp_config_file(str(path)).step(10):
            raise RuntimeError("the steps failed")
        return
    from fmpy.ssp.simulation import simulate_ssp

    with tempfile.TemporaryDirectory() as folder:
        archive = path if path.suffix == ".ssp" else shutil.make_archive(f"{folder}/system", "zip", path.parent)
        simulate_ssp(str(archive), stop_time=0.01, step_size=0.001)


def run(tool: str, path: Path, output: Path) -> tuple[Table | None, str]:
    """Results of a tool in a process of its own, or the reason why there are none."""
    process = multiprocessing.get_context("fork").Process(target=run_one, args=(tool, path, output))  # imports are done
    process.start()
    process.join(LIMIT)
    if process.exitcode is None:
        process.kill()
        process.join()
        return None, f"no end within {LIMIT} s"
    if process.exitcode == -signal.SIGXCPU:
        return None, f"no end within {CPU_LIMIT} s of processor time"
    if process.exitcode < 0:
        return None, f"killed by {signal.Signals(-process.exitcode).name}"
    if (message := output.with_suffix(".txt")).exists():
        return None, message.read_text(encoding="utf-8")
    if not output.exists():  # of a system
        return {}, "runs"
    with np.load(output, allow_pickle=False) as data:
        return dict(data), "runs"


def reason(error: BaseException) -> str:
    """First line of an error, without folders of this machine, and without the classes that add nothing to it."""
    name = "" if isinstance(error, TwinError) or type(error) is Exception else f"{type(error).__name__}: "
    return re.sub(r"(?<![^\s'\"`(])/\S*/", "", f"{name}{error}".partition("\n")[0])[:200]


def run_one(tool: str, path: Path, output: Path) -> None:
    """Run an FMU or a system by one of the tools, and end this process."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT, CPU_LIMIT + 1))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    try:
        if path.suffix != ".fmu":
            {"ours": our_system, "fmpy": other_system}[tool](path)
        else:
            table = {"ours": ours, "fmpy": fmpys, "equal_steps": equal_steps}[tool](path, experiment(path))
            np.savez(output, **{name: column for name, column in table.items() if column.dtype.kind != "O"})
    except BaseException as error:  # of anyone's library
        output.with_suffix(".txt").write_text(reason(error), encoding="utf-8")
    os._exit(0)  # what a library does when it is unloaded is not compared


def difference(first: Table, second: Table) -> tuple[float, str]:
    """Largest difference of numeric columns at equal times, of the column's largest value, and where."""
    worst, where = 0.0, ""
    times, others = first["time"], second["time"]
    rows = np.minimum(np.searchsorted(others, times + 1e-9, side="right") - 1, len(others) - 1)
    same = np.abs(others[rows] - times) < 1e-9
    for name in first.keys() & second.keys() - {"time"}:
        if first[name].dtype.kind not in "fiub" or second[name].dtype.kind not in "fiub":
            continue
        a, b = first[name].astype(float)[same], second[name].astype(float)[rows][same]
        if a.shape != b.shape or not a.size:
            continue
        gap = np.where(np.isnan(a) & np.isnan(b), 0.0, np.abs(a - b))
        scale = max(float(np.nanmax(np.abs(b), initial=0.0)), 1e-12)
        if not float(np.max(gap)) / scale <= worst:
            row = int(np.argmax(gap.reshape(len(gap), -1).max(axis=1)))
            worst, where = float(np.max(gap)) / scale, f"{name} at t = {times[same][row]:.6g}"
    return worst, where


def compare(path: Path, folder: Path) -> dict[str, str]:
    """Row of the table for one FMU or system."""
    row = dict.fromkeys(COLUMNS, "")
    row["repository"], row["file"] = path.relative_to(folder).parts[0], "/".join(path.relative_to(folder).parts[1:])
    if path.suffix != ".fmu":
        row["interface"] = "OSP" if path.suffix == ".xml" else "SSP"
    else:
        try:
            times = experiment(path)
            row |= {"FMI": times["version"], "interface": times["interface"], "tool": times["tool"]}
        except Exception as error:  # of anyone's file
            row["remark"] = f"description not readable by FMPy: {str(error).splitlines()[0][:100]}"
    with tempfile.TemporaryDirectory() as place:
        (mine, row["ours"]), (theirs, row["FMPy"]) = (run(t, path, Path(place) / f"{t}.npz") for t in ("ours", "fmpy"))
        if mine and theirs:
            gap, where = difference(mine, theirs)
            limit = EXACT if row["interface"] == "Co-Simulation" else SOLVED
            row["difference"] = "equal" if gap <= limit else f"{gap:.2g}: {where}"
            if gap > limit and row["interface"] == "Co-Simulation":
                row["remark"] = cause(path, Path(place), mine, theirs)
    return row


def cause(path: Path, folder: Path, mine: Table, theirs: Table) -> str:
    """Why two Co-Simulations of an FMU differ, found by further runs; empty if they do not tell."""
    again, _ = run("fmpy", path, folder / "again.npz")
    if again and difference(again, theirs)[0] > 0:
        return "FMPy's second run differs from its first: random numbers"
    equal, _ = run("equal_steps", path, folder / "equal.npz")
    if equal and difference(mine, equal)[0] == 0:
        return "equal to the bit by FMPy's calls with steps of equal size; simulate_fmu varies their last bit"
    return ""


def main() -> None:
    """Compare all FMUs or systems of a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", "-o", type=Path, required=True)
    parser.add_argument("--systems", action="store_true")
    arguments = parser.parse_args()
    remarks = {}
    if arguments.output.exists():
        with arguments.output.open(encoding="utf-8", newline="") as file:
            remarks = {(row["repository"], row["file"]): row["remark"] for row in csv.DictReader(file)}
    paths = {path for each in (SYSTEMS if arguments.systems else ("*.fmu",)) for path in arguments.folder.rglob(each)}
    unique = {hashlib.sha256(path.read_bytes()).digest(): path for path in sorted(paths, reverse=True)}
    with arguments.output.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for path in sorted(unique.values()):
            row = compare(path, arguments.folder)
            row["remark"] = remarks.get((row["repository"], row["file"])) or row["remark"]
            writer.writerow(row)
            file.flush()


if __name__ == "__main__":
    main()
