"""Native code: same bits as interpreted, libm only, and build errors that teach."""

import ctypes
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.component.test_component import Everything
from twin import compiler
from twin.component import (
    Boolean,
    Component,
    Int32,
    Int64,
    PythonComponent,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    source,
)
from twin.errors import BuildError


class Noisy(Component):
    """Random numbers and helpers from other modules."""

    seed = parameter(1, "", "seed", type=Int64, fixed=True)
    stream = local((0,) * 6, "", "random stream", type=Int64)
    y = output("", "noise")

    def initialize(self):
        seed_stream(self.stream, self.seed)

    def step(self, t, h):
        self.y = normal(self.stream)


def native(cls, build):
    start, step = compiler.load_component(cls, build)
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)
    return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)(start), kind(step)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("cls", [Everything, Noisy])
def test_compiled_equals_interpreted_to_the_bit(build, cls):
    a, b = cls(), cls()
    start, step = native(cls, build)
    a.start()
    assert start(b.record.ctypes.data, 0.0) == 0
    for k in range(50):
        a.advance(k * 1e-3, 1e-3)
        step(b.record.ctypes.data, k * 1e-3, 1e-3)
        assert a.record.tobytes() == b.record.tobytes()


class Narrow(Component):
    """Whole numbers that C would compute in 32 bits: small fields, literals and Booleans."""

    n = input("", "operand", type=Int32)
    on = input("", "operand", type=Boolean)
    y = output("", "results", type=Int64, shape=(10,))

    def step(self, t, h):
        self.y[0] = self.n * 70000
        self.y[1] = self.n + 2147483647
        self.y[2] = -2147483648 * self.n
        self.y[3] = self.n * 2147483648
        self.y[4] = self.n * self.n
        self.y[5] = 2147483647 - -self.n
        self.y[6] = self.n - (65536 if self.on else -2147483647)
        self.y[7] = -self.n
        self.y[8] = self.n * (70000 * self.on)
        self.y[9] = self.n << 20


@pytest.mark.parametrize("n", [70000, -70001, 2**31 - 1, -(2**31)])
def test_whole_numbers_have_64_bits(build, n):
    part, (_, step) = Narrow(n=n, on=n > 0), native(Narrow, build)
    step(part.record.ctypes.data, 0.0, 1e-3)
    expected = Narrow(n=n, on=n > 0)
    expected.advance(0.0, 1e-3)
    assert part.y.tolist() == expected.y.tolist()
    assert part.y[:5].tolist() == [n * 70000, n + 2**31 - 1, -(2**31) * n, n * 2**31, n * n]


def test_start_values_in_c_are_those_of_the_record(build):
    (address,) = compiler.load_symbols(compiler.sources(Everything, "everything", build), build, ("everything_init",))
    part = Everything()
    part.record.view("u1")[:] = 255
    ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)(part.record.ctypes.data)
    assert part.record.tobytes() == Everything().record.tobytes()


def scaled(factor):
    def step(self, t, h):
        self.y = factor * t

    return type("Scaled", (Component,), {"y": output("", "y"), "step": step, "__doc__": "Scaled."})


@pytest.mark.slow
def test_what_is_kept_follows_content_not_time(tmp_path):
    first = compiler.component_object(scaled(2.0), "x86_64-linux", tmp_path, "scaled")
    assert compiler.component_object(scaled(2.0), "x86_64-linux", tmp_path, "scaled") == first
    assert len(list(tmp_path.glob("cache/*/*.o"))) == len(list(tmp_path.glob("cache/*/*.c"))) == 1
    assert compiler.component_object(scaled(3.0), "x86_64-linux", tmp_path, "scaled") != first


@pytest.mark.slow
def test_platforms_share_one_c_file(tmp_path):
    objects = {compiler.component_object(Noisy, target, tmp_path, "noisy") for target in compiler.PLATFORMS}
    assert len(objects) == len(compiler.PLATFORMS)
    assert len(list(tmp_path.glob("cache/*/noisy.c"))) == 1


@pytest.mark.slow
def test_the_text_is_the_same_wherever_it_is_made(tmp_path):
    """Also in another process, which meets the components in another order."""
    program = (
        "import sys, pathlib; from twin import compiler\nfrom twin.component import catalog\n"
        "for name in sys.argv[1:]: print(compiler.sources(catalog.component(name), name, pathlib.Path('build')).source)"
    )
    texts = []
    for names in (["wall", "sheath"], ["sheath", "wall"]):
        done = subprocess.run(
            [sys.executable, "-c", program, *names], capture_output=True, text=True, check=True, cwd=tmp_path
        )
        texts.append(done.stdout)
        shutil.rmtree(tmp_path / "build")
    assert texts[0] != texts[1]
    assert sorted(texts[0].splitlines()) == sorted(texts[1].splitlines())


class Bad(Component):
    """Everything one must not do."""

    u = input("m", "in")
    k = parameter(1.0, "", "gain")
    y = output("m", "out")
    z = local((0.0,) * 3, "m", "memory")

    def step(self, t, h):
        self.u = 1.0
        self.k += 1.0
        self.why = 2.0
        print(self.y)
        if t > 1.0:
            raise ValueError
        self.y = self.z.max()
        self.z = (1.0, 2.0, 3.0)


def test_the_linter_names_component_line_and_remedy():
    first = Bad.step.__code__.co_firstlineno
    problems = source.check(Bad)
    expected = [
        (1, "writes input `self.u`"),
        (2, "writes parameter `self.k`"),
        (3, "`self.why` is not declared"),
        (4, "`print()`"),
        (6, "`raise` is lost"),
        (7, "`.max()` of an array"),
        (8, "assigns the whole array `self.z`"),
    ]
    for line, text in expected:
        assert any(f"Bad (tests/compiler/test_native.py:{first + line}): " in p and text in p for p in problems), text
    assert len(problems) == len(expected)


@pytest.mark.slow
def test_what_only_the_compiler_finds_is_named_too(tmp_path, monkeypatch):
    class Allocates(Component):
        """An array expression."""

        z = local((0.0,) * 3, "m", "memory")

        def step(self, t, h):
            self.z[:] = self.z * t

    class Untyped(Component):
        """A variable of two types."""

        y = output("m", "out")

        def step(self, t, h):
            if t > 0.0:
                w = (1.0, 2.0)
            else:
                w = 1.0
            self.y = w

    monkeypatch.chdir(Path(__file__).parent)
    place = r"\(test_native\.py:\d+\)"
    with pytest.raises(
        BuildError, match=rf"^Allocates {place}: `self\.z` is an array \[3\], not a number\. Loop over its elements\.$"
    ):
        compiler.component_object(Allocates, "x86_64-linux", tmp_path, "allocates")
    wanted = rf"^Untyped {place}: `w` is 2 values here and a real number there\. Use two names\.\n"
    with pytest.raises(BuildError, match=wanted):
        compiler.component_object(Untyped, "x86_64-linux", tmp_path, "untyped")
    assert compiler.problems(Untyped)[0].startswith("Untyped (test_native.py:")
    monkeypatch.chdir(tmp_path)
    assert compiler.problems(Untyped)[0].startswith(f"Untyped ({__file__}:")
    with pytest.raises(BuildError, match="is Python-side"):
        compiler.component_object(type("P", (PythonComponent,), {}), "x86_64-linux", tmp_path, "p")
