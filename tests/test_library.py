"""The static C library: linked, run, equal to the component to the bit; firmware objects are of the right machine."""

import subprocess
import sys

import pytest
from elftools.elf.elffile import ELFFile

from twin import catalog, compiled, library
from twin.errors import TwinError

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
    for name in ("sheath", "pi_control"):
        library.export(catalog.component(name), name, place, build, tuple(library.TRIPLES), force=False)
    return place


@pytest.mark.skipif(compiled.host() != "x86_64-linux", reason="the library of this machine is not built")
def test_two_libraries_in_one_program_equal_the_components_to_the_bit(folder):
    (folder / "main.c").write_text(MAIN)
    libraries = [f"x86_64-linux/lib{name}.a" for name in ("sheath", "pi_control")]
    zig = [sys.executable, "-m", "ziglang", "cc", "-std=c11", "-O2", "-Wall", "-Werror", "-ffp-contract=off"]
    subprocess.run([*zig, "main.c", *libraries, "-lm", "-o", "main"], cwd=folder, check=True)
    lines = subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout.splitlines()
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


def test_the_header_is_cpp_too(folder):
    (folder / "check.cpp").write_text('#include "sheath.h"\nint main() { return 0; }\n')
    zig = [sys.executable, "-m", "ziglang", "c++", "-std=c++17", "-c", "check.cpp", "-o", "check.o"]
    subprocess.run(zig, cwd=folder, check=True)


@pytest.mark.parametrize(
    ("target", "machine", "runtime"),
    [
        ("x86_64-linux", "EM_X86_64", set()),
        ("aarch64-linux", "EM_AARCH64", set()),
        (
            "cortex-m7",
            "EM_ARM",
            {"__fixdfdi", "__floatdidf", "__floatundidf", "__aeabi_d2lz", "__aeabi_l2d", "__aeabi_ul2d"},
        ),
        ("cortex-a53", "EM_AARCH64", set()),
    ],
)
def test_objects_need_libm_and_the_compilers_runtime_alone(folder, target, machine, runtime, tmp_path):
    archive = folder / target / "libsheath.a"
    subprocess.run([sys.executable, "-m", "ziglang", "ar", "x", str(archive)], cwd=tmp_path, check=True)
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
    assert defined == {f"sheath_{name}" for name in ("init", "start", "step", "initialize", "advance")}
    assert needed - defined <= compiled.LIBM | runtime


def test_nothing_is_overwritten(folder, build):
    with pytest.raises(TwinError, match=r"sheath\.h is there already"):
        library.export(catalog.component("sheath"), "sheath", folder, build, ("x86_64-linux",), force=False)
