"""The C of every component: no compiler complains, nothing in it that a reader would stumble over."""

import re
import shutil
import subprocess
from functools import cache

import pytest

from tests.c_compilers import CLANG
from twin import compiler
from twin.compiler import zig
from twin.component import PythonComponent, catalog

CLEAN = [
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wmissing-prototypes",
    "-Wfloat-equal",
    "-pedantic",
    "-std=c11",
    "-Werror",
]
NAMES = [name for name in catalog.names() if not issubclass(catalog.component(name), PythonComponent)]


@pytest.fixture(scope="module")
def text(build):
    """The C of a component, made once."""
    return cache(lambda name: compiler.sources(catalog.component(name), name, build))


def compiled(made, folder, command):
    (folder / f"{made.name}.h").write_text(made.header)
    (folder / f"{made.name}.c").write_text(made.source)
    done = subprocess.run([*command, *CLEAN, f"{made.name}.c"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", NAMES)
def test_no_compiler_complains(name, text, tmp_path):
    compiled(text(name), tmp_path, [*CLANG, "-fsyntax-only"])


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("gcc"), reason="gcc is missing")
@pytest.mark.parametrize("name", NAMES)
def test_gcc_complains_of_nothing_that_it_sees_when_optimizing(name, text, tmp_path):
    compiled(text(name), tmp_path, ["gcc", "-O3", "-c", "-o", "it.o"])


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", NAMES)
def test_it_reads_like_c_of_a_person(name, text):
    cls, made = catalog.component(name), text(name)
    code = re.sub(r"/\*.*?\*/", "", made.source, flags=re.DOTALL)
    assert not re.search(r"^#\s*define", made.source, flags=re.MULTILINE)
    assert "goto" not in code
    assert (cls.__doc__ or "").strip().split("\n")[0].encode("ascii", "backslashreplace").decode() in made.source
    for variable in cls.variables:
        assert re.search(rf"\b{re.escape(variable.name)}_?(\[\d+\])*;", made.header), variable.name
        assert variable.description.split()[0].encode("ascii", "backslashreplace").decode() in made.header
    assert max(map(len, made.source.splitlines())) <= 140
    assert str(zig.executable().parent) not in made.source + made.header


def test_comments_and_lines_of_python_are_there(text):
    made = text("sheath")
    assert "/* a bend presses the instrument on the sheath by its angle times the thrust */" in made.source
    assert re.search(r"for \(int64_t i = 0; i < NODES; i\+\+\) \{ /\* line \d+ \*/", made.source)
    assert "static double dead_zone(double value, double limit)" in made.source
    assert "first: identified from the paper's tracking error" in made.header


def test_debuggers_are_told_the_python_on_request():
    made = compiler.translate(catalog.component("sheath"), "sheath", line_directives=True)
    assert re.search(r'^#line \d+ "sheath/model\.py"$', made.source, flags=re.MULTILINE)
