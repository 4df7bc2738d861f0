"""The libraries for other platforms run here, under qemu and wine, and give the trajectories of this machine's.

What uses no function of libm but those that IEEE 754 defines to the last bit must agree to the bit: the code is compiled
without contraction and without a machine's own extensions. `exp` or `pow` are another library's on every platform and
may differ in the last place; what follows from that is bounded in units of the last place of a signal's largest value.
"""

import os
import shutil
import struct
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from functools import cache
from math import sin
from pathlib import Path

import numpy as np
import pytest

from tests.fmi.loaded import VERSIONS, symbols
from twin import compiler
from twin.component import Float64, catalog
from twin.fmi.exporting import exporter
from twin.run import resolve_catalogs
from twin.scenario import group, load_scenario

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCENARIO = ROOT / "scenarios" / "heart_wall_force.yaml"

# where Debian's libc6-arm64-cross puts the other machine's C library
SYSROOT = Path("/usr/aarch64-linux-gnu")
LIMITS = {"aarch64-linux": 60, "x86_64-windows": 120}  # for one run [s]; wine makes its prefix in the first one

# functions whose result IEEE 754 leaves no choice
EXACT = {"ceil", "copysign", "fabs", "floor", "fma", "fmax", "fmin", "fmod", "rint", "round", "sqrt", "trunc"}

# of a signal's largest value; seen: 31, where random noise (log, cos) is differentiated into a feedforward velocity
ULPS = 64

# platforms as `zig cc -target` calls them
TRIPLES = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
}


@dataclass(frozen=True, eq=False)
class Case:
    """What is simulated: a component or members of the scenario, its inputs as amplitude and rate [1/s] of a sine."""

    name: str
    inputs: dict[str, tuple[float, float]]
    h: float
    steps: int
    kind: str = "cs"
    variant: str = ""


CASES = [
    Case("servomotor", {"target_velocity": (0.02, 9.0), "load_force": (2.0, 31.0)}, 0.001, 1000),
    Case("pi_bouc_wen_control", {"force": (0.2, 5.0), "heart_position": (5e-3, 7.0)}, 0.005, 400),
    Case("sheath", {"gripper_position": (5e-3, 7.0), "contact_force": (0.3, 5.0)}, 0.001, 1000),
    Case("sheath", {"gripper_position": (5e-3, 31.0), "contact_force": (0.3, 5.0)}, 5e-5, 2000, "me"),
    Case("wall", {"tip_position": (5e-3, 7.0), "heart_position": (3e-3, 5.0)}, 1e-4, 1000, "me"),
    Case(
        "estimate,controller",
        {"estimate.fiber.twist": (1.0, 7.0), "controller.force": (0.2, 5.0)},
        0.001,
        1000,
        variant="PI+FF+BW",
    ),
]


@cache
def component(case):
    if not case.variant:
        return catalog.component(case.name)
    scenario = load_scenario(str(SCENARIO))
    catalogs = resolve_catalogs(scenario)
    chosen = case.name.split(",")
    return group("_".join(chosen), scenario.cases([case.variant])[0], catalogs[case.variant], chosen)


def rows(case):
    """The inputs at every communication point, as the importer reads them."""
    values = [[a * sin(rate * k * case.h) for a, rate in case.inputs.values()] for k in range(case.steps + 1)]
    return "\n".join(" ".join(struct.pack(">d", value).hex() for value in row) for row in values)


class Platforms:
    """The importer linked for each platform, the FMUs unpacked, and the programs that run another platform's code."""

    def __init__(self, build, folder):
        self.build, self.folder = build, folder
        self.results = {}

    def runner(self, platform):
        """Command and environment that run a program of a platform; skips the test where there is none."""
        if platform == compiler.host():
            return [], dict(os.environ)
        if platform == "aarch64-linux":
            if not (qemu := shutil.which("qemu-aarch64")):
                pytest.skip("qemu-aarch64 is missing: Debian's qemu-user")
            if not list(SYSROOT.glob("lib/ld-linux-aarch64*")):
                pytest.skip("no C library for AArch64: Debian's libc6-arm64-cross")
            return [qemu, "-L", str(SYSROOT)], dict(os.environ)
        if not (wine := shutil.which("wine") or shutil.which("wine64")):
            pytest.skip("wine is missing: Debian's wine and wine64")
        hidden = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
        return [wine], {**hidden, "WINEDEBUG": "-all", "WINEPREFIX": str(self.folder / "wine")}

    @cache  # noqa: B019 - one object per session
    def importer(self, platform):
        """The importer as a program of a platform."""
        path = self.folder / f"importer-{platform}.exe"
        command = [
            sys.executable,
            "-m",
            "ziglang",
            "cc",
            "-target",
            TRIPLES[platform],
            "-std=c11",
            "-O2",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-ffp-contract=off",
            str(Path(__file__).with_name("importer.c")),
            "-o",
            str(path),
        ]
        subprocess.run([*command, *(["-ldl"] if platform.endswith("linux") else [])], check=True, cwd=self.folder)
        return path

    def library(self, case, version, platform):
        """The library of the case's FMU for a platform, and the FMU's description."""
        wanted = (compiler.host(), "aarch64-linux", "x86_64-windows")
        path = exporter.build(component(case), version, self.build / "platforms", tuple(dict.fromkeys(wanted)))
        place = self.folder / version / path.stem
        with zipfile.ZipFile(path) as archive:
            archive.extractall(place)
        folder = place / "binaries" / exporter.VERSIONS[version].folder(platform)
        return folder / f"{path.stem}{compiler.PLATFORMS[platform].suffix}"

    def run(self, case, version, platform):
        """Outputs of a case on a platform, as a table with one row per communication point."""
        if (case, version, platform) not in self.results:
            before, environment = self.runner(platform)
            arguments = self.arguments(case, version, self.library(case, version, platform))
            command = [*before, str(self.importer(platform)), *arguments]
            files = [self.folder / name for name in ("inputs", "outputs", "errors")]
            files[0].write_text(rows(case))

            # files, not pipes: what wine leaves behind for a while holds its pipes open
            with files[0].open() as inputs, files[1].open("w") as outputs, files[2].open("w") as errors:
                done = subprocess.run(
                    command,
                    env=environment,
                    check=False,
                    stdin=inputs,
                    stdout=outputs,
                    stderr=errors,
                    timeout=LIMITS.get(platform, 60),
                    cwd=self.folder,
                )
            assert done.returncode == 0, files[2].read_text()
            lines = files[1].read_text().splitlines()
            table = [[struct.unpack(">d", bytes.fromhex(w))[0] for w in line.split()] for line in lines]
            self.results[case, version, platform] = np.array(table)
        return self.results[case, version, platform]

    @staticmethod
    def arguments(case, version, library):
        cls, words = component(case), exporter.VERSIONS[version]
        exposed = {e.variable.name: str(e.reference) for e in words.expose(cls)}
        inputs = [exposed[name] for name in case.inputs]
        outputs = [exposed[v.name] for v in cls.variables if v.role == "output" and v.type is Float64]
        states = sum(v.size for v in cls.variables if v.role == "state")
        token = exporter.plan(cls, version).token
        return [
            str(library),
            version[0],
            case.kind,
            token,
            repr(case.h),
            str(case.steps),
            str(states),
            str(len(inputs)),
            *inputs,
            str(len(outputs)),
            *outputs,
        ]


@pytest.fixture(scope="session")
def platforms(build, tmp_path_factory):
    return Platforms(build, tmp_path_factory.mktemp("platforms"))


@pytest.mark.parametrize("platform", LIMITS)
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.name}-{case.kind}")
def test_another_platform_gives_the_same_trajectory(platforms, case, version, platform):
    found = platforms.run(case, version, platform)
    native = platforms.run(case, version, compiler.host())
    size = np.abs(native).max(axis=0)
    assert found.shape == native.shape == (case.steps + 1, found.shape[1])
    assert (size > 0.0).all()  # every output moves
    _, needed = symbols(platforms.library(case, version, "aarch64-linux"))
    if needed <= EXACT:
        assert found.tobytes() == native.tobytes()
    else:
        assert (np.abs(found - native).max(axis=0) <= ULPS * np.spacing(size)).all()
