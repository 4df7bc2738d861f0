"""How long one waits where nothing is built yet: the first run, all components, a change, an export.

    python -m benchmarks.first_times         prints `name: value` lines; medians in s, each from an empty folder

first_run         README's first command after installing: the force experiment with all variants and seeds, and a report
first_build_all   `twin build`: every component as FMI 2.0 and 3.0
first_step        a component that has just changed, from a process that has the engine until its first step
first_export      a controller for five platforms, the first on a machine, and another one after it
again_run         the first command once more
"""

from __future__ import annotations

import ctypes
import importlib.util
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from twin import compiler
from twin.component import catalog
from twin.fmi.exporting import exporter

REPEATS = 3
CHANGED = "sheath"
START = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)
STEP = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)


def command(*words: str) -> float:
    """Wall time of a `twin` command [s]."""
    begin = time.monotonic()
    subprocess.run([sys.executable, "-c", "from twin.cli import main; main()", *words], check=True, capture_output=True)
    return time.monotonic() - begin


def first_step(folder: Path, number: int) -> float:
    """A component's file is read, with a line that nobody has seen, until its first step is done [s]."""
    text = (Path("fmus") / CHANGED / "model.py").read_text(encoding="utf-8")
    path = folder / f"changed{number}.py"
    path.write_text(text.replace("self.position[i] = self.gripper_position", f"self.position[i] = {number}e-9"))
    begin = time.monotonic()
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[path.stem] = module
    specification.loader.exec_module(module)
    cls = catalog.component(f"{path.stem}:Sheath")
    start, step = compiler.load_component(cls, folder)
    record = cls().record
    assert START(start)(record.ctypes.data, 0.0) == STEP(step)(record.ctypes.data, 0.0, 1e-3) == 0
    return time.monotonic() - begin


def export(folder: Path, name: str) -> float:
    """One component for all platforms [s]."""
    begin = time.monotonic()
    exporter.export(catalog.component(name), "3.0", folder / "x.fmu", folder, tuple(compiler.PLATFORMS))
    return time.monotonic() - begin


def main() -> None:
    """Print the figures."""
    found: dict[str, list[float]] = {}

    def note(name: str, seconds: float) -> None:
        found.setdefault(name, []).append(seconds)

    for number in range(1, REPEATS + 1):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            run = ("run", "scenarios/heart_wall_force.yaml", "--runs", f"{name}/runs", "--build", f"{name}/run")
            note("first_run_s", command(*run))
            note("again_run_s", command(*run))
            note("first_build_all_s", command("build", "--build", f"{name}/all"))
            note("first_step_s", first_step(folder, number))
            note("first_export_s", export(folder / "export", "pi_bouc_wen_control"))
            note("next_export_s", export(folder / "export", "pi_control"))
    for figure, values in found.items():
        print(f"{figure}: {statistics.median(values):.2f}")


if __name__ == "__main__":
    main()
