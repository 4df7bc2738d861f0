"""modelDescription.xml and model.c of two components, to the letter: compare with tests/fmi/expected when they change."""

from pathlib import Path

import pytest

import twin
from tests.every_case import every_case
from tests.fmi.described_parts import Counting, Swinging
from twin.component import Component, Int64, local, output, parameter
from twin.errors import BuildError
from twin.fmi.exporting import model_c_writer
from twin.fmi.exporting.model_description_writer import describe_2, describe_3, expose_arrays, expose_scalars, text

TOKEN = "{00112233-4455-6677-8899-aabbccddeeff}"
EXPECTED = Path(__file__).with_name("expected")


def described(file):
    """The text of a file: of a component and a version of FMI; FMI 3.0 of the sampled one has its clock."""
    name, _, kind = file.partition("_")
    cls = {"swinging": Swinging, "counting": Counting}[name]
    has_clock = cls is Counting and "3" in kind
    exposed = expose_arrays(cls) if "3" in kind else expose_scalars(cls)
    if kind.endswith(".c"):
        code = model_c_writer.source_code(cls, "part")
        return model_c_writer.model_c(cls, "part", TOKEN, exposed, "3" in kind, code, has_clock)
    made = (
        describe_3(cls, "part", TOKEN, exposed, has_clock=has_clock)
        if "3" in kind
        else describe_2(cls, "part", TOKEN, exposed)
    )
    return (
        made.decode().replace(f'"{twin.__version__}"', '"VERSION"').replace(f"twin {twin.__version__}", "twin VERSION")
    )


@every_case(
    "file", [f"{name}_{kind}" for name in ("swinging", "counting") for kind in ("2.xml", "3.xml", "2.c", "3.c")]
)
def test_what_an_fmu_says_of_itself(file):
    assert described(file) == (EXPECTED / file).read_text()


@every_case(
    ("given", "expected"),
    [
        ("plain", '"plain"'),
        ('a "b"', '"a \\"b\\""'),
        ("a\\b", '"a\\\\b"'),
        ("what??/", '"what\\?\\?/"'),  # no trigraph
        ("ä~ ", '"\\303\\244~ "'),
        ("\x1f\x7f", '"\\037\\177"'),
    ],
)
def test_texts_in_c(given, expected):
    assert model_c_writer.string(given) == expected


def test_comments_in_c():
    """They are one line, and end where they end."""
    assert model_c_writer.comment("a */ b /* c\n  d") == "/* a * / b / * c d */"


def test_numbers_in_xml():
    values = [1.0, 0.1 + 0.2, float("nan"), float("inf"), float("-inf"), True, False, 3, "a"]
    assert [text(value) for value in values] == [
        "1.0",
        "0.30000000000000004",
        "NaN",
        "INF",
        "-INF",
        "true",
        "false",
        "3",
        "a",
    ]


@pytest.mark.parametrize(
    ("start", "fits"), [(2**31 - 1, True), (2**31, False), (-(2**31), True), (-(2**31) - 1, False)]
)
def test_integers_of_version_2_have_32_bits(start, fits):
    class Large(Component):
        """Has a large number."""

        n = parameter(start, "", "number", type=Int64, source="assumed")
        more = output("", "may not fit later", type=Int64)
        stream = local(2**40, "", "is left out", type=Int64)

        def step(self, t, h):
            self.more = self.n

    if fits:
        assert next((one.name, one.start) for one in expose_scalars(Large)) == ("n", (start,))
        assert [one.name for one in expose_scalars(Large)] == ["n", "more"]
    else:
        with pytest.raises(
            BuildError, match=r"^Large\.n: start does not fit 32 bits of FMI 2\.0\. Export for FMI 3\.0\.$"
        ):
            expose_scalars(Large)
