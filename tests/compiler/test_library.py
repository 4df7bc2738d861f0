"""The static C library: linked and run here and under emulators, equal to the component; its header is C and C++."""

import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from elftools.elf.elffile import ELFFile

from tests.c_compilers import CLANG, linking
from tests.matrix import some
from twin import compiler
from twin.compiler import library, zig
from twin.component import Component, Int64, catalog, input, local, output, parameter
from twin.errors import BuildError, TwinError
from twin.run import resolve_catalogs
from twin.scenario import group, load_scenario

BARE = Path(__file__).with_name("bare")
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]

# machine to emulate, and how to link for it: zig's own libm and compiler library stand for newlib's and libgcc
MACHINES = {
    "cortex-m7": (
        ["qemu-system-arm", "-machine", "mps2-an500"],
        ["-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m7+fp_armv8d16+strict_align"],
    ),
    "cortex-a53": (
        ["qemu-system-aarch64", "-machine", "virt", "-cpu", "cortex-a53", "-net", "none"],
        ["-target", "aarch64-freestanding-none", "-mcpu=cortex_a53+strict_align"],
    ),
}

MAIN = """
#include <stdio.h>
#include "sheath.h"
#include "pi_control.h"

int main(void)
{
    static sheath_t sheath;
    static pi_control_t control;
    sheath_init(&sheath);
    pi_control_init(&control);
    sheath_start(&sheath, 0.0);
    pi_control_start(&control, 0.0);
    for (int k = 0; k < 200; k++) {
        double t = k / 1000.0;
        sheath.gripper_position = 0.01 * t;
        control.force = 10.0 * sheath.tip_position;
        if (sheath_step(&sheath, t, 0.001) || pi_control_step(&control, t, 0.001)) return 1;
        printf("%a %a\\n", sheath.tip_position, control.target_velocity);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, build):
    place = tmp_path_factory.mktemp("c")
    for name in ("sheath", "pi_control", "servomotor", "coordinate_feedforward"):
        library.export(catalog.component(name), name, place, build, tuple(library.TRIPLES), force=False)
    return place


def runner(target):
    """What runs a Linux program of a target; skips the test where there is nothing."""
    if target == compiler.host():
        return []
    if target != "aarch64-linux":
        pytest.skip(f"{target} is not this machine's")
    if not shutil.which("qemu-aarch64") or not Path("/usr/aarch64-linux-gnu/lib").exists():
        pytest.skip("Debian's qemu-user or libc6-arm64-cross is missing")
    return ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]


@pytest.mark.slow
@pytest.mark.parametrize("target", some(["x86_64-linux", "aarch64-linux"], ["x86_64-linux"]))
def test_two_libraries_in_one_program_equal_the_components_to_the_bit(folder, target, tmp_path):
    before = runner(target)
    (tmp_path / "main.c").write_text(MAIN)
    libraries = [str(folder / target / f"lib{name}.a") for name in ("sheath", "pi_control")]
    command = [*linking(target), "-std=c11", "-O2", *WARNINGS, "-ffp-contract=off"]
    subprocess.run([*command, f"-I{folder}", "main.c", *libraries, "-lm", "-o", "main"], cwd=tmp_path, check=True)
    done = subprocess.run([*before, tmp_path / "main"], capture_output=True, text=True, check=True, timeout=60)
    lines = done.stdout.splitlines()
    sheath, control = catalog.component("sheath")(), catalog.component("pi_control")()
    sheath.start()
    control.start()
    for k, line in enumerate(lines):
        t = k / 1000.0
        sheath.gripper_position = 0.01 * t
        control.force = 10.0 * sheath.tip_position
        sheath.advance(t, 0.001)
        control.advance(t, 0.001)
        found = [float.fromhex(word) for word in line.split()]
        assert found == [sheath.tip_position, control.target_velocity]
    assert len(lines) == 200
    assert sheath.tip_position > 0.0


GROUP = """
#include <stdio.h>
#include "control.h"

int main(void)
{
    static control_t control;
    control_init(&control);
    control.controller_force = 0.1;
    control_start(&control, 0.0);
    for (int k = 0; k < 300; k++) {
        control.controller_setpoint = 0.2 + 0.1 * (k % 50) / 50.0;
        if (control_step(&control, k / 1000.0, 0.001)) return 1;
        printf("%a\\n", control.controller_target_velocity);
    }
    return 0;
}
"""


@pytest.mark.slow
def test_a_group_of_a_scenario_is_one_library(build, tmp_path):
    scenario = load_scenario(Path(__file__).parents[2] / "scenarios/heart_wall_force.yaml")
    case = scenario.cases(["PI+FF+BW"])[0]
    cls = group("control", case, resolve_catalogs(scenario)[case.variant], list(scenario.groups["control"]))
    target = compiler.host()
    library.export(cls, "control", tmp_path, build, (target,), force=False)
    (tmp_path / "main.c").write_text(GROUP)
    command = [*linking(target), "-std=c11", "-O2", *WARNINGS, "-ffp-contract=off"]
    archive = str(tmp_path / target / "libcontrol.a")
    subprocess.run([*command, "main.c", archive, "-lm", "-o", "main"], cwd=tmp_path, check=True)
    lines = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True, timeout=60).stdout.split()
    part = cls()
    part.views["controller.force"][...] = 0.1
    part.start()
    for k, line in enumerate(lines):
        part.views["controller.setpoint"][...] = 0.2 + 0.1 * (k % 50) / 50.0
        part.advance(k / 1000.0, 0.001)
        assert float.fromhex(line) == part.views["controller.target_velocity"]
    assert len(lines) == 300
    assert float.fromhex(lines[-1]) != float.fromhex(lines[0])


def moved(steps):
    """What bare/firmware.c computes: motor and sheath, each with the other's value of the last step."""
    sheath, motor = catalog.component("sheath")(), catalog.component("servomotor")()
    sheath.start()
    motor.start()
    rows = []
    for k in range(steps):
        t = k / 1000.0
        motor.target_velocity = 0.1 if k % 200 < 100 else -0.1
        motor.load_force = sheath.reaction_force
        sheath.gripper_position = motor.position
        sheath.advance(t, 0.001)
        motor.advance(t, 0.001)
        rows.append((sheath.tip_position, motor.position, motor.current))
    return np.array(rows)


def emulated(program, names, folder, target, place):
    """What a firmware prints on the emulated processor, one row of numbers per line."""
    (emulator, *machine), options = MACHINES[target]
    if not shutil.which(emulator):
        pytest.skip(f"{emulator} is missing: Debian's qemu-system-arm")
    libraries = [str(folder / target / f"lib{name}.a") for name in names]
    command = [
        str(zig.executable()),
        "cc",
        *options,
        "-std=c11",
        "-O2",
        "-ffreestanding",
        *WARNINGS,
        f"-I{folder}",
        "-o",
        "firmware",
    ]
    command += [str(BARE / program), *libraries, f"-Wl,-T,{BARE / target}.ld", "-Wl,-e,reset"]
    subprocess.run(command, cwd=place, check=True)
    silent = ["-display", "none", "-monitor", "none", "-serial", "none", "-semihosting", "-kernel", "firmware"]
    done = subprocess.run(
        [emulator, *machine, *silent], cwd=place, capture_output=True, text=True, timeout=60, check=True
    )
    lines = (done.stdout + done.stderr).splitlines()  # QEMU prints what comes through semihosting to its stderr
    return np.array([[struct.unpack(">d", bytes.fromhex(word))[0] for word in line.split()] for line in lines])


@pytest.mark.slow
@pytest.mark.parametrize("target", MACHINES)
def test_the_feedforward_controller_runs_on_a_microcontroller(folder, target, tmp_path):
    found = emulated("feedforward.c", ["coordinate_feedforward"], folder, target, tmp_path)
    part = catalog.component("coordinate_feedforward")()
    part.start()
    wanted = []
    for k in range(60):
        part.target_y, part.target_z = 0.0016 * (k * 7 % 11), 0.0015 * (k * 5 % 13)
        part.target_needle_length = 0.0004 * (k % 8)
        part.advance(0.01 * k, 0.01)
        wanted.append([part.handle_steps, part.wire_steps, part.needle_steps, part.refusal])
    assert found.tolist() == np.array(wanted, float).tolist()
    assert len(set(found[:, 1])) > 5
    assert set(found[:, 3]) > {0.0}


@pytest.mark.slow
@pytest.mark.parametrize("target", MACHINES)
def test_firmware_runs_on_the_emulated_processor(folder, target, tmp_path):
    found = emulated("firmware.c", ["sheath", "servomotor"], folder, target, tmp_path)
    wanted = moved(400)
    assert found.shape == wanted.shape
    assert (np.abs(wanted).max(axis=0) > [1e-3, 1e-3, 0.1]).all()

    # the motor's `exp` is another library's there; seen: no difference
    assert (np.abs(found - wanted).max(axis=0) <= 16 * np.spacing(np.abs(wanted).max(axis=0))).all()


class Awkward(Component):
    """Has the names that C, C++ or the header use otherwise."""

    default = parameter(2.0, "", "factor", source="assumed")
    register = input("", "input")
    I = input("", "input", start=3.0)
    hidden0 = output("", "product")
    new = output("", "sum")

    def step(self, t, h):
        self.hidden0 = self.default * self.register
        self.new = self.register + self.I


CHECK = """
#include <assert.h>
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include "awkward.h"
int main(void)
{
    awkward_t part;
    awkward_init(&part);
    part.register_ = 4.0;
    awkward_start(&part, 0.0);
    if (awkward_step(&part, 0.0, 0.1) != TWIN_OK) return 1;
    printf("%g %g\\n", part.hidden0_, part.new_);
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.skipif(compiler.host() != "x86_64-linux", reason="the library of this machine is not built")
@pytest.mark.parametrize(("language", "standard"), [("c", "c11"), ("c", "gnu11"), ("c++", "c++17")])
def test_names_that_are_reserved_get_an_underscore_in_c_and_cpp(language, standard, build, tmp_path):
    library.export(Awkward, "awkward", tmp_path, build, ("x86_64-linux",), force=False)
    source = "main.c" if language == "c" else "main.cpp"
    (tmp_path / source).write_text(CHECK)
    command = [*linking("x86_64-linux", language), "-O2", f"-std={standard}", *WARNINGS, "-c", source, "-o", "main.o"]
    subprocess.run(command, cwd=tmp_path, check=True)

    # linked as C: nothing of the C++ library is used, and zig would first build it
    link = [*linking("x86_64-linux"), "main.o", "x86_64-linux/libawkward.a", "-lm", "-o", "main"]
    subprocess.run(link, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    assert done.stdout == "8 7\n"


def test_names_that_become_the_same_are_refused():
    class Twice(Component):
        """Its two inputs would be one field."""

        new = input("", "input")
        new_ = input("", "input")
        y = output("", "sum")

        def step(self, t, h):
            self.y = self.new + self.new_

    with pytest.raises(BuildError, match="two variables would be the C field 'new_'"):
        library.header(Twice, "twice")


@pytest.mark.slow
@pytest.mark.parametrize(("language", "standard"), [("c", "c11"), ("c", "c23"), ("c++", "c++11"), ("c++", "c++17")])
@pytest.mark.parametrize("name", ["sheath", "servomotor", "pi_control"])
def test_the_header_is_c_and_cpp(folder, language, standard, name, tmp_path):
    source = "check.c" if language == "c" else "check.cpp"
    (tmp_path / source).write_text(f'#include "{name}.h"\nint main(void) {{ return TWIN_OK; }}\n')
    command = [*CLANG, "-x", language, f"-std={standard}", *WARNINGS, f"-I{folder}", "-c", source, "-o", "check.o"]
    subprocess.run(command, cwd=tmp_path, check=True)


@pytest.mark.parametrize(
    ("target", "machine", "runtime"),
    [
        ("x86_64-linux", "EM_X86_64", set()),
        ("aarch64-linux", "EM_AARCH64", set()),
        ("cortex-m7", "EM_ARM", {"__aeabi_d2lz", "__aeabi_l2d", "__aeabi_ul2d"}),
        ("cortex-a53", "EM_AARCH64", set()),
    ],
)
def test_objects_need_libm_and_the_compilers_runtime_alone(folder, target, machine, runtime, tmp_path):
    archive = folder / target / "libsheath.a"
    subprocess.run([str(zig.executable()), "ar", "x", str(archive)], cwd=tmp_path, check=True)
    needed, defined = set(), set()
    for path in tmp_path.glob("*.o"):
        with path.open("rb") as file:
            elf = ELFFile(file)
            assert elf["e_machine"] == machine
            for symbol in elf.get_section_by_name(".symtab").iter_symbols():
                if symbol.name and symbol["st_shndx"] == "SHN_UNDEF":
                    needed.add(symbol.name)
                elif symbol.name and symbol["st_info"]["bind"] == "STB_GLOBAL":
                    defined.add(symbol.name)
    assert defined == {
        f"sheath_{name}" for name in ("init", "start", "step", "derivatives", "tangent", "first_tangent")
    }
    assert needed - defined <= compiler.LIBM | runtime


def test_nothing_is_overwritten(folder, build, tmp_path):
    (tmp_path / "README.txt").write_text("somebody's own")
    with pytest.raises(TwinError, match=r"README\.txt is there already"):
        library.export(catalog.component("sheath"), "sheath", tmp_path, build, ("x86_64-linux",), force=False)
    assert (tmp_path / "README.txt").read_text() == "somebody's own"
    with pytest.raises(TwinError, match=r"sheath\.h is there already"):
        library.export(catalog.component("sheath"), "sheath", folder, build, ("x86_64-linux",), force=False)


class Overflowing(Component):
    """Counts over the end of its type, where C has no rule of its own."""

    period = 1e-3
    count = local(2**63 - 4, "", "steps", type=Int64)
    is_over = output("", "whether the count has wrapped around", start=False)

    def step(self, t, h):
        count = self.count + 1
        self.is_over = count < self.count
        self.count = count


OVERFLOWING = """
#include "Overflowing.h"
#include <stdio.h>
int main(void) {
    Overflowing_t part;
    Overflowing_init(&part);
    Overflowing_start(&part, 0.0);
    for (int k = 0; k < 6; k++) { Overflowing_step(&part, 1e-3 * k, 1e-3); putchar('0' + part.is_over); }
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")
def test_from_source_whole_numbers_wrap_around_as_in_the_libraries(tmp_path, build):
    """With the command of README.txt."""
    library.export(Overflowing, "Overflowing", tmp_path, build, (compiler.host(),), force=False)
    (tmp_path / "main.c").write_text(OVERFLOWING)
    (command,) = (line.split() for line in library.README.splitlines() if "-c NAME.c" in line)
    for last in (["main.c", "Overflowing.c"], ["main.c", f"{compiler.host()}/libOverflowing.a"]):
        subprocess.run([*command[:-2], *last, "-lm", "-o", "main"], cwd=tmp_path, check=True)
        assert subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout == "000100"
