"""What clang and the linkers make of C: symbols, bytes, messages, values; on every platform, most without running it."""

import ctypes
import io
import math
import struct

import numpy as np
import pytest
from elftools.elf.dynamic import DynamicSection
from elftools.elf.elffile import ELFFile
from elftools.elf.gnuversions import GNUVerNeedSection

from twin.compiler import libm
from twin.compiler.toolchain import BARE, LIBM, PLATFORMS, compile_c, host, link
from twin.errors import BuildError
from twin.store import make_key

LINUX = [name for name, platform in PLATFORMS.items() if platform.format == "elf"]
ON_LINUX = pytest.mark.skipif(host() not in LINUX, reason="loads a Linux library")

EXPORT = """\
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
"""

# LuGre friction by Runge and Kutta: helpers within helpers, libm, and what becomes one instruction
FRICTION = (
    EXPORT
    + """
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

double exp(double), fabs(double), sqrt(double);

typedef struct { double v, f, z, der_z, peak; int64_t count; bool is_sliding; } record;

static double fade(double v) { return exp(-(v / 0.01) * (v / 0.01)); }
static double level(double v) { return 1.0 + 0.5 * fade(v); }

static void derivatives(record *self)
{
    self->der_z = self->v - 1.0e4 * fabs(self->v) / level(self->v) * self->z;
    self->f = 1.0e4 * self->z + 100.0 * self->der_z;
}

static double at(record *self, double z)
{
    self->z = z;
    derivatives(self);
    return self->der_z;
}

static void runge_kutta(record *self, double h)
{
    double z = self->z;
    double a = at(self, z), b = at(self, z + 0.5 * h * a), c = at(self, z + 0.5 * h * b), d = at(self, z + h * c);
    at(self, z + h / 6.0 * (a + 2.0 * b + 2.0 * c + d));
}

EXPORT int32_t component_initialize(void *record_, double t)
{
    record *self = record_;
    self->z = 0.0;
    derivatives(self);
    return 0;
}

EXPORT int32_t component_advance(void *record_, double t, double h)
{
    record *self = record_;
    for (int64_t i = 0; i < 10; i++) runge_kutta(self, h / 10.0);
    self->peak = sqrt(self->f * self->f);
    self->count += 1;
    self->is_sliding = self->peak > 0.99;
    return 0;
}
"""
)
SYMBOLS = ("component_initialize", "component_advance")

# loops that compilers like to make calls of memset, memcpy, memmove, bzero, memset_pattern16, strlen and memcmp
LOOPS = """\
#include <stdint.h>

typedef struct { double line[300], copy[300], rows[40][4]; int64_t k, key[8], lock[8]; char text[40]; } record;

int32_t component_advance(record *self, double t, double h)
{
    for (int64_t i = 0; i < 300; i++) self->copy[i] = self->line[i];
    for (int64_t i = 299; i > 0; i--) self->line[i] = self->line[i - 1];
    for (int64_t i = 0; i < 299; i++) self->copy[i] = self->copy[i + 1];
    for (int64_t i = 0; i < self->k; i++) self->line[i] = 0.0;
    for (int64_t i = 0; i < self->k; i++) self->copy[i] = 1.5;
    for (int64_t i = 0; i < self->k; i++) for (int64_t j = 0; j < 4; j++) self->rows[i][j] = 0.0;
    for (int64_t i = 0; i < 40; i++) { self->rows[i][0] = 0.0; self->rows[i][1] = 0.0; self->rows[i][2] = 0.0; }
    int64_t length = 0;
    while (self->text[length]) length++;
    int32_t same = 1;
    for (int64_t i = 0; i < 8; i++) if (self->key[i] != self->lock[i]) same = 0;
    if (self->key[0] == self->lock[0] && self->key[1] == self->lock[1] && self->key[2] == self->lock[2]) same += 2;
    return same + (int32_t)length;
}
"""
BLOCKS = (b"memset", b"memcpy", b"memmove", b"memclr", b"memcmp", b"bcmp", b"bzero", b"strlen")

ONE = sorted(LIBM - {"atan2", "copysign", "fma", "fmax", "fmin", "fmod", "frexp", "hypot", "ldexp", "modf", "pow"})
TWO = ("atan2", "copysign", "fmax", "fmin", "fmod", "hypot", "pow")
WHOLE_LIBM = "\n".join(
    [
        EXPORT,
        *(
            f"double {name}(double); EXPORT double of_{name}(double x, double y) {{ return {name}(x); }}"
            for name in ONE
        ),
        *(f"double {name}(double, double);" for name in TWO),
        *(f"EXPORT double of_{name}(double x, double y) {{ return {name}(x, y); }}" for name in TWO),
        "double fma(double, double, double), frexp(double, int *), ldexp(double, int), modf(double, double *);",
        "EXPORT double of_fma(double x, double y) { return fma(x, y, 1.0); }",
        "EXPORT double of_frexp(double x, double y) { int n; double f = frexp(x, &n); return f * 4096.0 + n; }",
        "EXPORT double of_ldexp(double x, double y) { return ldexp(x, (int)y); }",
        "EXPORT double of_modf(double x, double y) { double n, f = modf(x, &n); return f - n; }",
        "EXPORT double of_pair(double x, double y) { return sin(x) + 3.0 * cos(x); }",
    ]
)


def elf(data):
    return ELFFile(io.BytesIO(data))


def functions(data, table=".symtab"):
    """(defined functions, undefined symbols) of an object or a library."""
    symbols = [symbol for symbol in elf(data).get_section_by_name(table).iter_symbols() if symbol.name]
    undefined = {symbol.name for symbol in symbols if symbol["st_shndx"] == "SHN_UNDEF"}
    return {s.name for s in symbols if s["st_info"]["type"] == "STT_FUNC"} - undefined, undefined


def needed(data):
    sections = [section for section in elf(data).iter_sections() if isinstance(section, DynamicSection)]
    return [tag.needed for section in sections for tag in section.iter_tags() if tag.entry.d_tag == "DT_NEEDED"]


def versions(data):
    sections = [section for section in elf(data).iter_sections() if isinstance(section, GNUVerNeedSection)]
    return {
        (file.name, entry.name)
        for section in sections
        for file, entries in section.iter_versions()
        for entry in entries
    }


def load_commands(data):
    """Numbers of a Mach-O library's load commands, and their bytes."""
    count, place, found = struct.unpack_from("<I", data, 16)[0], 32, {}
    for _ in range(count):
        number, size = struct.unpack_from("<II", data, place)
        found[number & 0x7FFFFFFF] = data[place : place + size]
        place += size
    return found


class Friction(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("v", "f", "z", "der_z", "peak")]
    _fields_ += [("count", ctypes.c_int64), ("is_sliding", ctypes.c_bool)]


def level(v):
    return 1.0 + 0.5 * math.exp(-(v / 0.01) * (v / 0.01))


def friction(v, h, steps):
    """The record after some steps, as Python computes it."""
    z = 0.0

    def der(z):
        return v - 1.0e4 * abs(v) / level(v) * z

    for _ in range(10 * steps):
        a = der(z)
        b = der(z + 0.5 * (h / 10.0) * a)
        c = der(z + 0.5 * (h / 10.0) * b)
        z += h / 10.0 / 6.0 * (a + 2.0 * b + 2.0 * c + der(z + (h / 10.0) * c))
    return 1.0e4 * z + 100.0 * der(z), z


def loaded(library, folder, symbols):
    """Addresses of the symbols of a library."""
    path = folder / f"{make_key(library)}.so"
    path.write_bytes(library)
    code = ctypes.CDLL(str(path))
    return tuple(ctypes.cast(code[symbol], ctypes.c_void_p).value for symbol in symbols)


@ON_LINUX
@pytest.mark.parametrize("newest", [False, True])
def test_loaded_code_computes_what_python_computes(newest, tmp_path):
    library = link(host(), [compile_c(FRICTION, host(), tmp_path)], tmp_path, newest=newest)
    start, advance = loaded(library, tmp_path, SYMBOLS)
    self = Friction(v=0.003, z=7.0)
    assert ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)(start)(ctypes.addressof(self), 0.0) == 0
    step = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)(advance)
    for k in range(20):
        assert step(ctypes.addressof(self), k * 1e-3, 1e-3) == 0
    assert (self.f, self.z) == friction(0.003, 1e-3, 20)
    assert (self.count, self.is_sliding, self.peak) == (20, self.f > 0.99, abs(self.f))


@pytest.mark.parametrize("target", [*LINUX, *BARE])
def test_helpers_are_inlined_and_only_libm_is_called(target, tmp_path):
    defined, undefined = functions(compile_c(FRICTION, target, tmp_path))
    assert defined == set(SYMBOLS)
    assert undefined == {"exp"}  # sqrt and fabs are instructions, also where no C library is


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", [*PLATFORMS, *BARE])
def test_loops_over_arrays_call_nothing(target, tmp_path):
    code = compile_c(LOOPS, target, tmp_path)
    assert b"component_advance" in code
    assert not [word for word in BLOCKS if word in code]
    if target in {*LINUX, *BARE}:
        assert functions(code)[1] == set()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", PLATFORMS)
def test_a_stray_call_is_not_linked(target, tmp_path):
    text = EXPORT + "double gamma_of(double); EXPORT double component_advance(double x) { return gamma_of(x); }"
    code = compile_c(text, target, tmp_path)
    with pytest.raises(BuildError, match=rf"^{target}: undefined symbol: _?gamma_of$"):
        link(target, [code], tmp_path)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", LINUX)
def test_linux_library_needs_the_oldest_libm_alone(target, tmp_path):
    library = link(target, [compile_c(WHOLE_LIBM, target, tmp_path)], tmp_path)
    defined, undefined = functions(library, ".dynsym")
    assert defined == {f"of_{name}" for name in {*LIBM, "pair"}}
    assert undefined <= LIBM | {"sincos"}
    assert needed(library) == ["libm.so.6"]
    assert versions(library) == {("libm.so.6", PLATFORMS[target].libm)}


@pytest.mark.parametrize("target", LINUX)
def test_a_library_without_mathematics_needs_nothing(target, tmp_path):
    library = link(target, [compile_c(EXPORT + "EXPORT int one(void) { return 1; }", target, tmp_path)], tmp_path)
    assert needed(library) == []
    assert functions(library, ".dynsym") == ({"one"}, set())


def test_windows_library_needs_ucrtbase_alone(tmp_path):
    code = compile_c(WHOLE_LIBM, "x86_64-windows", tmp_path)
    library = link("x86_64-windows", [code], tmp_path)
    assert library.count(b".dll\0") == 2  # its own name, and
    assert b"ucrtbase.dll\0" in library
    assert not [word for word in (b"KERNEL32", b"msvcrt", b"api-ms", b"sincos") if word in library]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", ["x86_64-darwin", "aarch64-darwin"])
def test_macos_library_needs_libsystem_alone(target, tmp_path):
    named, loaded, signature, flags = 0xD, 0xC, 0x1D, 24
    library = link(target, [compile_c(WHOLE_LIBM, target, tmp_path)], tmp_path)
    commands = load_commands(library)
    assert library.count(b".dylib\0") >= 2
    assert b"@rpath/library.dylib\0" in commands[named]
    assert b"/usr/lib/libSystem.B.dylib\0" in commands[loaded]
    assert struct.unpack_from("<I", library, flags)[0] & 0x80  # two-level namespace
    assert (signature in commands) == (target == "aarch64-darwin")


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("target", PLATFORMS)
def test_large_frames_can_be_linked(target, tmp_path):
    text = (
        EXPORT
        + """
    EXPORT double component_advance(double *x, int n)
    {
        volatile double b[3000]; /* 24 kB: Windows probes a stack beyond a page */
        double sum = 0.0;
        for (int i = 0; i < 3000; i++) b[i] = x[i % n];
        for (int i = 0; i < 3000; i++) sum += b[i * 7 % 3000];
        return sum;
    }
    """
    )
    assert link(target, [compile_c(text, target, tmp_path)], tmp_path)


@pytest.mark.slow
@ON_LINUX
def test_oldest_and_newest_libm_give_the_same_bits_and_those_of_python(tmp_path):
    code = compile_c(WHOLE_LIBM, host(), tmp_path)
    names = [*sorted(LIBM), "pair"]
    symbols = tuple(f"of_{name}" for name in names)
    old, new = (
        [
            ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double)(one)
            for one in loaded(library, tmp_path, symbols)
        ]
        for library in (link(host(), [code], tmp_path, newest=newest) for newest in (False, True))
    )
    pythons = {
        name: getattr(math, name) for name in ("sin", "cos", "exp", "tan", "atan", "tanh", "pow", "atan2", "fmod")
    }
    pythons["pair"] = lambda x: math.sin(x) + 3.0 * math.cos(x)
    random = np.random.default_rng(1)
    for name, first, second in zip(names, old, new, strict=True):
        for x, y in random.uniform(0.0, 20.0, (500, 2)).tolist():
            found = struct.pack("<d", first(x, y))
            assert found == struct.pack("<d", second(x, y)), name
            if name in pythons:
                assert found == struct.pack("<d", pythons[name](x, y) if name in TWO else pythons[name](x)), name


@ON_LINUX
@pytest.mark.skipif(libm.newest() is None, reason="no glibc")
def test_newest_binds_beyond_the_oldest(tmp_path):
    code = compile_c(EXPORT + "double exp(double); EXPORT double f(double x) { return exp(x); }", host(), tmp_path)
    assert versions(link(host(), [code], tmp_path, newest=True)) == {("libm.so.6", "GLIBC_2.29")}


@pytest.mark.slow
@ON_LINUX
def test_rounded_as_python_rounds(tmp_path):
    text = (
        EXPORT
        + """
    double pow(double, double), sin(double);
    EXPORT double square(double x) { return pow(x, 2.0); }
    EXPORT double ten(double x) { return pow(10.0, x); }
    EXPORT double two(double x) { return pow(2.0, x); }
    EXPORT double root(double x) { return pow(x, 0.5); }
    EXPORT double constant(double x) { return sin(0.7) + pow(1.1, 2.3); }
    EXPORT double fused(double x) { return x * x + x; }
    """
    )
    names = ("square", "ten", "two", "root", "constant", "fused")
    addresses = loaded(link(host(), [compile_c(text, host(), tmp_path)], tmp_path), tmp_path, names)
    calls = [ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(address) for address in addresses]
    for x in np.random.default_rng(2).uniform(0.0, 30.0, 20000).tolist():
        expected = (x**2.0, 10.0**x, 2.0**x, x**0.5, math.sin(0.7) + 1.1**2.3, x * x + x)
        assert tuple(call(x) for call in calls) == expected
