"""Functions that components may call, and operations of Python without an operator in C.

A word is a C function: one of libm, which is declared where it is used, or one of the short helpers below, whose text
becomes part of the file. Python's meaning is kept where C's differs: signs of `%` and `//`, which of equals `max`
takes, ties of `round`.
"""

from __future__ import annotations

import builtins
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from twin.compiler import machine
from twin.compiler.types import BOOLEAN, INTEGER, NOTHING, REAL, Scalar, Type


@dataclass(frozen=True, slots=True)
class Word:
    """A C function: its name, types of its arguments, its result, and its text if libm does not have it.

    `needs`: what its text calls. `reads`: it depends on memory; `acts`: it changes something.
    """

    name: str
    arguments: tuple[Scalar, ...]
    result: Type
    text: str = ""
    needs: tuple[str, ...] = ()
    reads: bool = False
    acts: bool = False


def _helper(head: str, body: str, *, needs: tuple[str, ...] = (), reads: bool = False, acts: bool = False) -> Word:
    kinds: dict[str, Type] = {"double": REAL, "int64_t": INTEGER, "bool": BOOLEAN, "void": NOTHING}
    result, _, rest = head.partition(" ")
    name, _, arguments = rest.partition("(")
    types = tuple(kinds[part.split()[0]] for part in arguments.rstrip(")").split(", "))
    lines = "\n".join(f"    {line}" for line in body.strip().splitlines())
    if len(head) > 100:
        head = head.replace(", int64_t count", ",\n    int64_t count")
    return Word(name, types, kinds[result], f"static inline {head}\n{{\n{lines}\n}}", needs, reads, acts)  # type: ignore[arg-type]


HELPERS = [
    _helper("double real_min(double a, double b)", "return b < a ? b : a;"),
    _helper("double real_max(double a, double b)", "return b > a ? b : a;"),
    _helper("int64_t int_min(int64_t a, int64_t b)", "return b < a ? b : a;"),
    _helper("int64_t int_max(int64_t a, int64_t b)", "return b > a ? b : a;"),
    _helper(
        "int64_t from_end(int64_t index, int64_t size)",
        "return index < 0 ? index + size : index; /* as Python: the last element is -1 */",
    ),
    _helper("int64_t int_abs(int64_t a)", "return a < 0 ? -a : a;"),
    _helper(
        "int64_t int_floor(double a)",
        """
const int64_t whole = (int64_t)a;
return (double)whole > a ? whole - 1 : whole;
""",
    ),
    _helper(
        "int64_t int_ceil(double a)",
        """
const int64_t whole = (int64_t)a;
return (double)whole < a ? whole + 1 : whole;
""",
    ),
    _helper("double real_minimum(double a, double b)", "return (a <= b || a != a) ? a : b; /* NaN stays NaN */"),
    _helper("double real_maximum(double a, double b)", "return (a >= b || a != a) ? a : b; /* NaN stays NaN */"),
    _helper("double real_sign(double a)", "return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : a == 0.0 ? 0.0 : a;"),
    _helper("bool real_isnan(double a)", "return a != a;"),
    _helper("bool real_isfinite(double a)", "return a - a == 0.0;"),
    _helper("bool real_isinf(double a)", "return a == a && a - a != 0.0;"),
    _helper(
        "int64_t int_mod(int64_t a, int64_t b)",
        """
/* as Python: the sign of b; 0 where b is 0 */
if (b == 0 || b == -1) {
    return 0;
}
const int64_t rest = a % b;
return (rest != 0 && (rest < 0) != (b < 0)) ? rest + b : rest;
""",
    ),
    _helper(
        "int64_t int_floor_div(int64_t a, int64_t b)",
        """
/* as Python: rounded down; 0 where b is 0 */
if (b == 0) {
    return 0;
}
if (b == -1) {
    return -a;
}
return a / b - ((a % b != 0 && (a < 0) != (b < 0)) ? 1 : 0);
""",
    ),
    _helper(
        "double real_mod(double a, double b)",
        """
/* as Python: the sign of b */
const double rest = fmod(a, b);
if (rest != 0.0) {
    return ((rest < 0.0) != (b < 0.0)) ? rest + b : rest;
}
return b != 0.0 ? copysign(0.0, b) : rest;
""",
        needs=("fmod", "copysign"),
    ),
    _helper(
        "double real_floor_div(double a, double b)",
        """
/* as Python: exact also where a / b is rounded up to a whole number */
if (b == 0.0) {
    return a / b;
}
double rest = fmod(a, b);
double quotient = (a - rest) / b;
if (rest != 0.0 && (rest < 0.0) != (b < 0.0)) {
    quotient -= 1.0;
}
if (quotient == 0.0) {
    return copysign(0.0, a / b);
}
const double whole = floor(quotient);
return quotient - whole > 0.5 ? whole + 1.0 : whole;
""".replace("double rest = fmod", "const double rest = fmod"),
        needs=("fmod", "copysign", "floor"),
    ),
    _helper(
        "int64_t int_power(int64_t base, int64_t exponent)",
        """
int64_t result = 1;
for (int64_t i = 0; i < exponent; i++) {
    result *= base;
}
return result;
""",
    ),
    _helper(
        "int64_t shift_left(int64_t a, int64_t b)",
        "return (b < 0 || b > 63) ? 0 : (int64_t)((uint64_t)a << b);",
    ),
    _helper("int64_t shift_right(int64_t a, int64_t b)", "return a >> ((b < 0 || b > 63) ? 63 : b);"),
    _helper("double real_degrees(double radians)", "return radians * 57.29577951308232;"),
    _helper("double real_radians(double degrees)", "return degrees * 0.017453292519943295;"),
    _helper(
        "double hypotenuse(double a, double b)",
        """
/* as Python: both legs are scaled, squared and summed in twice the digits; then one step of Newton's method */
const double split = 134217729.0; /* 2^27 + 1 */
const double far_power = 4.149515568880993e180; /* 2^600 */
double one = fabs(a);
double other = fabs(b);
double longest = real_max(one, other);
double unit = 1.0;
if (!(longest >= 1e-150 && longest <= 1e150 && other <= 1e150)) {
    if (real_isinf(a) || real_isinf(b)) {
        return real_isinf(a) ? one : other;
    }
    if (a != a || b != b || longest == 0.0) {
        return one + other;
    }
    unit = longest < 1.0 ? 1.0 / far_power : far_power;
    one /= unit;
    other /= unit;
    longest /= unit;
}
union {
    double value;
    uint64_t bits;
} scale = {longest};
scale.bits = (2045U - (scale.bits >> 52)) << 52; /* the power of 2 that brings the longest leg to 0.5 to 1 */
const double x = one * scale.value;
const double x_high = x * split - (x * split - x);
const double x_low = x - x_high;
const double x_cross = x_high * x_low + x_low * x_high;
const double x_square = x_high * x_high + x_cross;
const double x_rest = x_high * x_high - x_square + x_cross + x_low * x_low;
const double y = other * scale.value;
const double y_high = y * split - (y * split - y);
const double y_low = y - y_high;
const double y_cross = y_high * y_low + y_low * y_high;
const double y_square = y_high * y_high + y_cross;
const double y_rest = y_high * y_high - y_square + y_cross + y_low * y_low;
const double first = 1.0 + x_square;
const double sum = first + y_square;
double low = x_rest + y_rest;
double lost = (x_square - (first - 1.0)) + (y_square - (sum - first));
const double root = sqrt(sum - 1.0 + (low + lost));
const double r_high = root * split - (root * split - root);
const double r_low = root - r_high;
const double r_cross = -(r_high * r_low + r_low * r_high);
const double r_square = -(r_high * r_high) + r_cross;
low += -(r_high * r_high) - r_square + r_cross - r_low * r_low;
const double last = sum + r_square;
lost += r_square - (last - sum);
return unit * ((root + (last - 1.0 + (low + lost)) / (2.0 * root)) / scale.value);
""",
        needs=("fabs", "sqrt", "real_max", "real_isinf"),
    ),
    _helper(
        "double power(double base, double exponent)",
        """
/* an exponent that compilers cannot know: they would make x * x of pow(x, 2.0), which rounds otherwise */
const volatile double unknown = exponent;
return pow(base, unknown);
""",
        needs=("pow",),
    ),
]

# words of the co-simulation loop: memory at an address, a call of an address
_LOADS = [
    _helper(f"{kind} {word}(int64_t address)", f"return *(const {storage} *)address;", reads=True)
    for word, kind, storage in (
        ("read64", "int64_t", "int64_t"),
        ("read32", "int64_t", "int32_t"),
        ("read16", "int64_t", "int16_t"),
        ("read8", "int64_t", "int8_t"),
        ("read_float", "double", "double"),
        ("read_float32", "double", "float"),
    )
]
_STORES = [
    _helper(f"void {word}(int64_t address, {kind} value)", f"*({storage} *)address = ({storage})value;", acts=True)
    for word, kind, storage in (
        ("write64", "int64_t", "int64_t"),
        ("write32", "int64_t", "int32_t"),
        ("write16", "int64_t", "int16_t"),
        ("write8", "int64_t", "int8_t"),
        ("write_float", "double", "double"),
        ("write_float32", "double", "float"),
    )
]
_STEPS = """
typedef int32_t (*fmi3_t)(void *, double, double, bool, void *, void *, void *, void *);
typedef int32_t (*fmi2_t)(void *, double, double, int32_t);
typedef int32_t (*component_t)(void *, double, double);
if (signature == COMPONENT) return ((component_t)function)((void *)instance, t, h);
if (signature == FMI2) return ((fmi2_t)function)((void *)instance, t, h, FINAL);
return ((fmi3_t)function)((void *)instance, t, h, FINAL, (void *)flags, (void *)(flags + 8), (void *)(flags + 16),
                          (void *)(flags + 24));
"""


def _step(word: str, final: int) -> Word:
    text = _STEPS.replace("FINAL", str(final))
    for name in ("COMPONENT", "FMI2"):
        text = text.replace(f"signature == {name}", f"signature == {getattr(machine, name)}")
    return _helper(
        f"int64_t {word}(int64_t function, int64_t signature, int64_t instance, double t, double h, int64_t flags)",
        text,
        acts=True,
    )


_CALLS = [
    _helper(
        "int64_t call_access(int64_t function, int64_t instance, int64_t references, int64_t count, int64_t values, int64_t size)",
        f"""
typedef int32_t (*access_t)(void *, const void *, size_t, void *, size_t);
typedef int32_t (*fmi2_access_t)(void *, const void *, size_t, void *);
if (size == {machine.NO_SIZE})
    return ((fmi2_access_t)function)((void *)instance, (const void *)references, (size_t)count, (void *)values);
return ((access_t)function)((void *)instance, (const void *)references, (size_t)count, (void *)values, (size_t)size);
""",
        acts=True,
    ),
    _helper(
        "int64_t call_state(int64_t function, int64_t instance, int64_t state)",
        """
typedef int32_t (*state_t)(void *, void *);
return ((state_t)function)((void *)instance, (void *)state);
""",
        acts=True,
    ),
    _step("call_step", 1),
    _step("call_trial", 0),
]
MACHINE = {getattr(machine, word.name): word for word in (*_LOADS, *_STORES, *_CALLS)}

NAMED = {word.name: word for word in HELPERS}

# functions of libm, and Python's names for them
UNARY = (
    "acos",
    "acosh",
    "asin",
    "asinh",
    "atan",
    "atanh",
    "cbrt",
    "cos",
    "cosh",
    "erf",
    "erfc",
    "exp",
    "exp2",
    "expm1",
    "fabs",
    "log",
    "log10",
    "log1p",
    "log2",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
)
BINARY = ("atan2", "copysign", "fmod")
LIBM = {
    **{name: Word(name, (REAL,), REAL) for name in (*UNARY, "ceil", "floor", "rint", "trunc")},
    **{name: Word(name, (REAL, REAL), REAL) for name in (*BINARY, "pow", "hypot")},
}
NUMPY = {
    "arccos": "acos",
    "arccosh": "acosh",
    "arcsin": "asin",
    "arcsinh": "asinh",
    "arctan": "atan",
    "arctanh": "atanh",
    "arctan2": "atan2",
}


def _of_python() -> dict[Any, Word]:
    """Python function -> word, for `math` and numpy, where arguments are converted to real and the result is real."""
    words: dict[Any, Word] = {}
    for name in (*UNARY, *BINARY):
        for module in (math, np):
            function = getattr(module, name, None)
            if function is not None and function is not np.tanh:  # numpy's own tanh rounds otherwise
                words[function] = LIBM[name]
    words.update({getattr(np, name): LIBM[word] for name, word in NUMPY.items()})
    words.update({getattr(np, name): LIBM[name] for name in ("ceil", "floor", "rint", "trunc")})
    for module in (math, np):
        for name in ("isnan", "isfinite", "isinf"):
            words[getattr(module, name)] = NAMED[f"real_{name}"]
    words[math.pow] = words[np.power] = NAMED["power"]
    words[math.hypot], words[np.hypot] = NAMED["hypotenuse"], LIBM["hypot"]
    for module in (math, np):
        words.update({getattr(module, name): NAMED[f"real_{name}"] for name in ("degrees", "radians")})
    words[np.minimum], words[np.maximum] = NAMED["real_minimum"], NAMED["real_maximum"]
    words[np.sign] = NAMED["real_sign"]
    return words


PYTHON = _of_python()

# functions of one real argument with a whole result: what rounds
ROUNDING = {
    math.floor: "int_floor",
    math.ceil: "int_ceil",
    math.trunc: "",
    int: "",
    np.int64: "",
    builtins.round: "rint",
}
