"""The parts of a C file around its functions: prototypes, constants, helpers, structs, in the order in which C needs them."""

from tests.compiler.c_text import c_of, file_of
from tests.every_case import every_case
from twin.compiler.codegen.code import ATOM, UNARY, local_name, number, wrapped
from twin.compiler.names import safe

EXPECTED = """\
/* head */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    double x;
    double y;
    double z;
    int64_t a;
    int64_t b;
    int64_t n;
    int32_t c;
    int32_t d;
    bool on;
    bool off;
    uint8_t hidden0[6];
    double v[4];
    double m[3][2];
    int64_t k[3];
} r_t;

/* of the mathematical library */
double copysign(double, double);
double fmod(double, double);
double sin(double);

static const double GAIN = -0.5;
static const double TABLE[3] = {0.5, -2.0, 3.25};
static const int64_t ROWS[2][3] = {{1, 2, 3}, {4, 5, 6}};

_Static_assert(sizeof(r_t) == 168, "size of the record");
_Static_assert(offsetof(r_t, x) == 0, "place in the record");
_Static_assert(offsetof(r_t, a) == 24, "place in the record");
_Static_assert(offsetof(r_t, c) == 48, "place in the record");
_Static_assert(offsetof(r_t, on) == 56, "place in the record");
_Static_assert(offsetof(r_t, v) == 64, "place in the record");
_Static_assert(offsetof(r_t, m) == 96, "place in the record");
_Static_assert(offsetof(r_t, k) == 144, "place in the record");

typedef struct {
    double v0;
    int64_t v1;
} tuple_di_t;

static inline int64_t from_end(int64_t index, int64_t size)
{
    return index < 0 ? index + size : index; /* as Python: the last element is -1 */
}

static inline int64_t int_mod(int64_t a, int64_t b)
{
    /* as Python: the sign of b; 0 where b is 0 */
    if (b == 0 || b == -1) {
        return 0;
    }
    const int64_t rest = a % b;
    return (rest != 0 && (rest < 0) != (b < 0)) ? rest + b : rest;
}

static inline double real_mod(double a, double b)
{
    /* as Python: the sign of b */
    const double rest = fmod(a, b);
    if (rest != 0.0) {
        return ((rest < 0.0) != (b < 0.0)) ? rest + b : rest;
    }
    return b != 0.0 ? copysign(0.0, b) : rest;
}

/* A default value. (compiler/c_text.py:LINE) */
static double scaled(double x, double factor)
{
    return x * factor;
}

/* Two results. (compiler/c_text.py:LINE) */
static tuple_di_t both(int64_t a, double b)
{
    return (tuple_di_t){b, a};
}

/* An effect and a result. (compiler/c_text.py:LINE) */
static int64_t act(r_t *self)
{
    self->n += 1;
    return self->n;
}

/* An array as an argument. (compiler/c_text.py:LINE) */
static double first(const double values[4])
{
    return values[0];
}

/* An array as an argument. (compiler/c_text.py:LINE) */
static double first_2(const double values[3])
{
    return values[0];
}

/* cases */
static void run(r_t *self)
{
    self->x = sin(self->y) + scaled(GAIN, 2.0) + TABLE[from_end(self->a, 3)] + (double)ROWS[1][int_mod(self->b, 3)];
    self->y = real_mod(self->x, 2.0);
    const tuple_di_t part_1 = both(self->a, self->x);
    self->z = part_1.v0;
    const int64_t w = part_1.v1;
    self->a = act(self) + w;
    self->x = first(self->v) + first_2(TABLE);
}

int32_t r_run(r_t *self)
{
    run(self);
    return 0;
}
"""
PYTHON = """\
self.x = sin(self.y) + scaled(GAIN) + TABLE[self.a] + ROWS[1][self.b % 3]
self.y = self.x % 2.0
self.z, w = both(self.a, self.x)
self.a = act(self) + w
self.x = first(self.v) + first(TABLE)"""


def test_a_whole_file():
    made = file_of(PYTHON).split("\n")
    assert [line.partition(".py:")[0] for line in made] == [line.partition(".py:")[0] for line in EXPECTED.split("\n")]


def test_lines_that_are_too_long_are_broken_before_an_operator_or_behind_a_comma():
    fits = f"    x = {'a' * 107};"
    assert len(fits) == 116
    assert wrapped(fits) == [fits]
    calls = f"    x = f({', '.join(['argument'] * 15)});"
    assert wrapped(calls) == [
        f"    x = f({'argument, ' * 10}".rstrip(),
        f"        {', '.join(['argument'] * 5)});",
    ]
    total = f"    x = {'a' * 60} + {'b' * 60} - c;"
    assert wrapped(total) == [f"    x = {'a' * 60}", f"        + {'b' * 60} - c;"]
    quoted = f'    puts("{"a, " * 50}");'
    assert wrapped(quoted) == [quoted]
    assert wrapped(f"{fits}\n{total}") == [fits, *wrapped(total)]
    assert wrapped("a" * 200) == ["a" * 200]


@every_case(
    ("value", "text", "level"),
    [
        (True, "true", ATOM),
        (False, "false", ATOM),
        (3, "3", ATOM),
        (-3, "-3", UNARY),
        (0, "0", ATOM),
        (-(2**63), "(-9223372036854775807 - 1)", ATOM),
        (-(2**63) + 1, "-9223372036854775807", UNARY),
        (0.5, "0.5", ATOM),
        (-0.5, "-0.5", UNARY),
        (-0.0, "-0.0", UNARY),
        (1e22, "1e+22", ATOM),
        (1e-7, "1e-07", ATOM),
        (float("nan"), "(0.0 / 0.0)", ATOM),
        (float("inf"), "(1.0 / 0.0)", ATOM),
        (float("-inf"), "(-1.0 / 0.0)", ATOM),
    ],
)
def test_literals(value, text, level):
    """Each reads back as the same number; the smallest whole number has no literal of its own in C."""
    assert (number(value).text, number(value).level) == (text, level)


@every_case(("name", "own"), [("x", "x"), ("a__b", "a_b"), ("_x", "own_x"), ("power", "power_"), ("int", safe("int"))])
def test_names_of_variables(name, own):
    """None hides a helper or is a word of C, and two underscores in a row are left to compilers."""
    assert local_name(name) == own


def test_a_variable_named_like_a_helper_does_not_hide_it():
    assert (
        c_of("power = self.x\nself.y = power ** 2") == "const double power_ = self->x;\nself->y = power(power_, 2.0);"
    )
