"""Names that C, C++, their common headers and compilers keep for themselves, and how a Python name becomes one of C."""

from __future__ import annotations

import re

# keywords of C up to C23 and of C++ up to C++20, macros of common headers and compilers
RESERVED = frozenset(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t class co_await
    co_return co_yield compl concept const consteval constexpr constinit const_cast continue decltype default delete do
    double dynamic_cast else enum explicit export extern false float for friend goto if inline int long mutable namespace
    new noexcept not not_eq nullptr operator or or_eq private protected public register reinterpret_cast requires restrict
    return short signed sizeof static static_assert static_cast struct switch template this thread_local throw true try
    typedef typeid typename typeof typeof_unqual union unsigned using virtual void volatile wchar_t while xor xor_eq
    fortran linux unix i386 arm complex imaginary noreturn I NULL EOF NAN INFINITY HUGE_VAL assert errno offsetof
    setjmp signbit isnan isinf isfinite isnormal stdin stdout stderr near far min max
    int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t size_t uintptr_t
    """.split()  # noqa: SIM905 - as a list it takes a line per word
)

# functions that compilers know without a header: no function or table of ours may have their names
BUILTIN = frozenset(
    """
    abort abs acos acosh alloca asin asinh atan atan2 atanh bcmp bcopy bzero calloc cbrt ceil clog copysign cos cosh erf
    erfc exit exp exp10 exp2 expm1 fabs fdim ffs floor fma fmax fmin fmod fputs free frexp gamma gammaf hypot ilogb index
    islower isupper j0 j1 jn labs ldexp lgamma llabs llrint llround log log10 log1p log2 logb longjmp lrint lround main
    malloc memchr memcmp memcpy memmove memset modf nearbyint nextafter pow pow10 printf putchar puts realloc remainder
    remquo rindex rint round scalb scalbln scalbn significand sin sincos sinh snprintf sprintf sqrt sscanf strcat strchr
    strcmp strcpy strlen strncmp tan tanh tgamma tolower toupper trunc y0 y1 yn
    """.split()  # noqa: SIM905
)


HIDDEN = re.compile(r"hidden\d+")  # what lies between the fields of a struct


def safe(name: str) -> str:
    """A name for a field or a local variable: reserved ones get an underscore behind them."""
    return f"{name}_" if name in RESERVED or HIDDEN.fullmatch(name) else name


def safe_global(name: str) -> str:
    """A name for a function or a constant."""
    return f"{name}_" if name in RESERVED or name in BUILTIN else name


class Names:
    """Names of one C file, each given once."""

    def __init__(self) -> None:
        self.taken: set[str] = set()

    def take(self, wanted: str) -> str:
        """The name, or with a number behind it if it is taken."""
        name, number = wanted, 1
        while name in self.taken:
            number += 1
            name = f"{wanted}_{number}"
        self.taken.add(name)
        return name
