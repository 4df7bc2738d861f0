"""How long an export takes and how large it is: the force controller and its group, for all five platforms.

python -m benchmarks.export           prints `name: value` lines; cold: empty folder of objects, warm: everything built
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from twin import compiler
from twin.component import catalog
from twin.fmi.exporting import exporter
from twin.run import resolve_catalogs
from twin.scenario import group, load_scenario

SCENARIO = Path("scenarios/heart_wall_force.yaml")


def main() -> None:
    """The controller of the force experiment alone, and with the heart's estimate."""
    scenario = load_scenario(SCENARIO)
    case = scenario.cases(["PI+FF+BW"])[0]
    control = group("control", case, resolve_catalogs(scenario)[case.variant], list(scenario.groups["control"]))
    for name, cls in (("controller", catalog.component("pi_bouc_wen_control")), ("control_group", control)):
        for version in exporter.VERSIONS:
            with tempfile.TemporaryDirectory() as folder:
                for state in ("cold", "warm"):
                    begin = time.perf_counter()
                    path = exporter.export(
                        cls, version, Path(folder) / "x.fmu", Path(folder), tuple(compiler.PLATFORMS)
                    )
                    print(f"export_{name}_{version}_{state}_s: {time.perf_counter() - begin:.1f}")
                print(f"export_{name}_{version}_kB: {path.stat().st_size / 1000:.0f}")


if __name__ == "__main__":
    main()
