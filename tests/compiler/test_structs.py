"""The C struct of a record, as others read it; names of models; what cannot be translated."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.compiler.native import is_translated, model_name, problems, sources
from twin.compiler.structs import (
    block_comment,
    clean,
    flat_struct,
    layout_checks,
    nested,
    part_name,
    struct_of,
    struct_of_dtype,
    struct_text,
)
from twin.compiler.types import Field, Struct
from twin.component import Component, Int32, PythonComponent, catalog, input, output, parameter, solver, state
from twin.component.component import resampled
from twin.errors import BuildError

LONG = "a position that is described at length, so that there is no room for it behind the field, nor in one line of 120 letters"


class Small(Component):
    """Variables of several types and roles."""

    u = input("N", "force")
    on = input("", "on /* or */ off", start=True)
    y = output("m", LONG)
    k = parameter((1.0, 2.0), "1", "gains", source="a book")

    def step(self, t, h):
        self.y = self.u


class Moving(Component):
    """Has a state."""

    method = solver.euler(1e-3)
    n = input("", "a number", type=Int32)
    x = state(0.0, "m", "position")
    y = output("m", "the same")

    def derivatives(self, t):
        self.der_x = 1.0 * self.n
        self.y = self.x


SMALL = """
typedef struct {
    /* inputs */
    double u;                                /* [N] force */
    bool on;                                 /* on / * or * / off */
    uint8_t hidden0[7];

    /* outputs */
    /* [m] a position that is described at length, so that there is no room for it behind the field, nor in one line
       of 120 letters */
    double y;

    /* parameters */
    double k[2];                             /* gains; source: a book */
} small_t;
"""

CHECKS = """
_Static_assert(sizeof(small_t) == 40, "size of the record");
_Static_assert(offsetof(small_t, u) == 0, "place in the record");
_Static_assert(offsetof(small_t, on) == 8, "place in the record");
_Static_assert(offsetof(small_t, y) == 16, "place in the record");
_Static_assert(offsetof(small_t, k) == 24, "place in the record");
"""


def test_a_struct_has_a_field_per_variable_and_no_padding_of_a_compiler():
    struct = struct_of(Small, "small")
    assert struct_text(struct) == SMALL.strip()
    assert layout_checks(struct) == CHECKS.strip().splitlines()
    assert {name: (f.name, f.offset, f.size, f.shape) for name, f in struct.fields.items()} == {
        "u": ("u", 0, 8, ()),
        "on": ("on", 8, 1, ()),
        "y": ("y", 16, 8, ()),
        "k": ("k", 24, 16, (2,)),
    }


def test_memory_of_the_solver_comes_last_and_vectors_of_states_overlay_them():
    struct = struct_of(Moving, "moving")
    titles = [line.strip(" /*") for line in struct_text(struct).splitlines() if line.startswith("    /* ")]
    assert titles == ["inputs", "outputs", "states", "derivatives of the states", "the solver's own"]
    assert {name: own.offset for name, own in struct.overlays.items()} == {
        "_x": struct.fields["x"].offset,
        "_dx": struct.fields["der_x"].offset,
    }
    assert struct.fields["_x0"].comment == "states at the begin of the substep"
    last = max(own.offset + own.size for own in struct.fields.values())
    assert last <= struct.size == Moving.layout.size


def test_a_plain_record_is_a_struct_too():
    dtype = np.dtype(
        {"names": ["a", "int", "c"], "formats": ["f8", "i4", ("i8", (2,))], "offsets": [0, 8, 16], "itemsize": 40}
    )
    expected = [
        "    double a;",
        "    int32_t int_;",
        "    uint8_t hidden0[4];",
        "    int64_t c[2];",
        "    uint8_t hidden1[8];",
    ]
    struct = struct_of_dtype(dtype, "plain")
    assert struct_text(struct).splitlines() == ["typedef struct {", *expected, "} plain_t;"]


def test_members_of_a_group_are_structs_inside_it_defined_before_it():
    inner = struct_of(Small, "group_a")
    outer = Struct("group_record_t", 96)
    outer.fields = {
        "b": Field("b", inner.name, (), 48, inner.size, struct=inner),
        "a": Field("a", inner.name, (), 0, inner.size, struct=inner),
    }
    assert nested(outer) == [inner, outer]
    assert struct_text(outer).splitlines() == [
        "typedef struct {",
        "    /* members */",
        "    group_a_t a;",
        "    uint8_t hidden0[8];",
        "    group_a_t b;",
        "    uint8_t hidden1[8];",
        "} group_record_t;",
    ]
    parts = {name: SimpleNamespace(component=cls) for name, cls in (("a", Small), ("b", Moving), ("c", Small))}
    assert [part_name("group", parts, name) for name in parts] == ["group_a", "group_b", "group_a"]


def test_the_header_shows_all_variables_with_their_roles():
    struct = flat_struct(Moving, "moving")
    assert (struct.name, struct.size) == ("moving_t", Moving.layout.size)
    assert [(f.name, f.comment, f.offset) for f in struct.fields.values()] == sorted(
        [
            ("n", "input: a number", Moving.layout.offset("n")),
            ("y", "output: [m] the same", Moving.layout.offset("y")),
            ("x", "state: [m] position", Moving.layout.offset("x")),
            ("der_x", "derivative: [m/s] derivative of x", Moving.layout.offset("der_x")),
        ],
        key=lambda one: one[2],
    )


@every_case(
    ("text", "expected"),
    [
        ("plain", "plain"),
        ("/* a */", "/ * a * /"),
        ("what??/", "what?/"),
        ("µ", "\\xb5"),
        ("a line goes on\\", "a line goes on"),
    ],
)
def test_comments_are_ascii_and_do_not_end_early(text, expected):
    assert clean(text) == expected


def test_long_comments_are_wrapped_at_the_width_of_the_file():
    assert block_comment("word", "    ") == ["    /* word */"]
    assert block_comment("") == ["/*  */"]
    words = " ".join(["four"] * 60)
    lines = block_comment(words, "  ")
    assert max(map(len, lines)) <= 120
    assert len(lines) == 3
    assert [line[:5] for line in lines] == ["  /* ", "     ", "     "]
    assert lines[-1].endswith(" */")
    assert " ".join(lines).replace("/*", "").replace("*/", "").split() == words.split()


def test_a_model_is_named_by_its_folder_or_its_class_and_by_another_period():
    cls = type("Model", (Small,), {"__module__": "fmus.some_model.model", "period": 0.001})
    assert model_name(Small) == "Small"
    assert model_name(cls) == "some_model"
    assert model_name(resampled(cls, 2_000_000)) == "some_model_2ms"
    for module in ("fmus.model", "fmus.some_model.other", "other.some_model.model", "fmus.a.b.model"):
        assert model_name(type("Model", (Small,), {"__module__": module})) == "Model"


def test_what_lives_in_python_is_not_translated(build):
    class Living(PythonComponent):
        """Lives in Python."""

        y = output("", "out")

        def step(self, t, h):
            self.y = t

    with pytest.raises(BuildError, match=r"Living: is Python-side and cannot be compiled. Derive it from Component"):
        sources(Living, "living", build)
    assert problems(Living) == []


def test_the_c_of_a_component_is_stored(tmp_path):
    cls = catalog.component("pi_control")
    assert not is_translated(cls, tmp_path)
    assert problems(cls) == []
    assert not is_translated(cls, tmp_path)
    assert problems(cls, tmp_path) == []
    assert is_translated(cls, tmp_path)
    made = sources(cls, "pi_control", tmp_path)
    assert struct_text(struct_of(cls, "pi_control")) in made.header


def test_a_component_that_cannot_be_translated_has_its_problems_one_by_one(tmp_path):
    class Failing(Component):
        """Raises."""

        y = output("", "out")

        def step(self, t, h):
            self.y = sum([t, h])
            raise ValueError

    found = problems(Failing)
    assert found
    assert all("\n" not in line and "Failing" in line for line in found)
    with pytest.raises(BuildError):
        sources(Failing, "failing", tmp_path)
    assert not is_translated(Failing, tmp_path)
