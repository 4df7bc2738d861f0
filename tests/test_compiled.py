"""Native code: same bits as interpreted, libm only, and build errors that teach."""

import ctypes

import pytest

from tests.test_component import Everything
from twin import compiled, source
from twin.component import Component, PythonComponent
from twin.errors import BuildError
from twin.noise import normal, seed_stream
from twin.variable import Int64, input, local, output, parameter


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
    initialize, advance = compiled.load_component(cls, build)
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)
    return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)(initialize), kind(advance)


@pytest.mark.parametrize("cls", [Everything, Noisy])
def test_compiled_equals_interpreted_to_the_bit(build, cls):
    a, b = cls(), cls()
    initialize, advance = native(cls, build)
    a.start()
    assert initialize(b.record.ctypes.data, 0.0) == 0
    for k in range(50):
        a.advance(k * 1e-3, 1e-3)
        advance(b.record.ctypes.data, k * 1e-3, 1e-3)
        assert a.record.tobytes() == b.record.tobytes()


def test_the_cache_follows_content_not_time(tmp_path):
    def scaled(factor):
        def step(self, t, h):
            self.y = factor * t

        return type("Scaled", (Component,), {"y": output("", "y"), "step": step, "__doc__": "Scaled."})

    first = compiled.component_object(scaled(2.0), "x86_64-linux", tmp_path)
    assert compiled.component_object(scaled(2.0), "x86_64-linux", tmp_path) == first
    assert len(list(tmp_path.glob("objects/*.o"))) == 1
    assert compiled.component_object(scaled(3.0), "x86_64-linux", tmp_path) != first


def test_platforms_and_symbols_share_the_way_to_llvm(tmp_path):
    whole = {
        compiled.component_object(Noisy, target, tmp_path, prefix)
        for target in ("x86_64-linux", "aarch64-linux")
        for prefix in ("component", "other")
    }
    assert len(whole) == 4
    assert len(list(tmp_path.glob("objects/*.ll"))) == 1
    alone = tmp_path / "alone"
    assert compiled.component_object(Noisy, "aarch64-linux", alone, "other") in whole
    assert b"other_advance" in compiled.component_object(Noisy, "aarch64-linux", alone, "other")


@pytest.mark.parametrize("target", compiled.TARGETS)
def test_every_platform_is_emitted(target, tmp_path):
    assert compiled.component_object(Noisy, target, tmp_path)[:4] in {
        b"\x7fELF", b"\x64\x86" + b"\x04\x00", b"\xcf\xfa\xed\xfe",
    } or target == "x86_64-windows"  # fmt: skip


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
        (1, "writes input `self.u`"), (2, "writes parameter `self.k`"), (3, "`self.why` is not declared"),
        (4, "`print()`"), (6, "`raise` is lost"), (7, "`.max()` of an array"), (8, "assigns the whole array `self.z`"),
    ]  # fmt: skip
    for line, text in expected:
        assert any(f"Bad (tests/test_compiled.py:{first + line}): " in p and text in p for p in problems), text
    assert len(problems) == len(expected)


def test_what_only_the_compiler_finds_is_named_too(tmp_path):
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

    with pytest.raises(BuildError, match=r"Allocates: .*Suspected: line \d+ `self.z\[:\] = self.z \* t`"):
        compiled.component_object(Allocates, "x86_64-linux", tmp_path)
    with pytest.raises(BuildError, match=r"Untyped: .*test_compiled.py.*cannot be compiled: Cannot unify"):
        compiled.component_object(Untyped, "x86_64-linux", tmp_path)
    with pytest.raises(BuildError, match="is Python-side"):
        compiled.component_object(type("P", (PythonComponent,), {}), "x86_64-linux", tmp_path)


def test_a_block_that_only_a_library_could_move_is_refused():
    text = """
        declare void @llvm.memmove.p0.p0.i64(ptr, ptr, i64, i1)
        define i32 @component_advance(ptr %record) {
            %next = getelementptr i8, ptr %record, i64 8
            call void @llvm.memmove.p0.p0.i64(ptr %next, ptr %record, i64 800, i1 false)
            ret i32 0
        }
    """
    with pytest.raises(BuildError, match=r"^Line: moving a block became a call of memmove"):
        compiled._object(text, "x86_64-linux", "Line", ())
    assert compiled._object(text.replace("memmove", "memcpy"), "x86_64-linux", "Line", ())[:4] == b"\x7fELF"
