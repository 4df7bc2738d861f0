"""What is told about a wrong name, and what of a text reaches a terminal."""

import difflib
import importlib.util
import os
import string
import unicodedata

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.every_case import every_case
from twin import load
from twin.errors import LIKE, ScenarioError, described, nearest, printable

NAMES = st.text(string.ascii_lowercase + "_", min_size=1, max_size=12)


@every_case(
    ("name", "known", "expected"),
    [
        ("pressure", ["pressure_ok", "supply_pressure", "valve"], "Did you mean 'pressure_ok' or 'supply_pressure'?"),
        ("rat", ["rate", "phase"], "Did you mean 'rate'?"),
        ("Rate", ["rate", "phase"], "Did you mean 'rate'?"),
        ("heart", ["three", "other"], "Known: other, three."),  # nothing in common
        ("sdt", ["std", "mean"], "Did you mean 'std'? Known: mean, std."),  # a guess
        ("x", [], "There are none."),
        ("q", [f"variable_{i:02}" for i in range(9)], f"Known: {', '.join(f'variable_{i:02}' for i in range(9))}."),
    ],
)
def test_what_may_have_been_meant(name, known, expected):
    assert nearest(name, known) == expected


def test_a_long_list_says_how_long():
    text = nearest("?", [f"variable_{i:05}" for i in range(50_000)])
    assert text.endswith(" more.")
    assert len(text) < 300


@given(NAMES, st.lists(NAMES, max_size=8))
@example("ab_cdef", ["zz_cdef"])
def test_a_hint_has_something_in_common(name, known):
    question, _, _ = nearest(name, known).partition("?")
    for meant in question.split("'")[1::2]:
        assert meant in known
        shared = {part for part in name.split("_") if len(part) > 2} & set(meant.split("_"))
        assert shared or difflib.SequenceMatcher(a=meant, b=name).ratio() >= LIKE


@given(st.text())
@example("\x1b[31m\x9b\u202e\n\r\udc80\u2028")
def test_nothing_controls_the_terminal(text):
    shown = printable(text)
    assert not any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in shown)
    assert not any(unicodedata.bidirectional(letter) in ("RLO", "LRO", "RLI", "LRI", "FSI") for letter in shown)
    assert printable(shown) == shown
    if text.isascii() and text.isprintable():
        assert shown == text


def test_an_error_inside_a_library_names_the_line_that_called_it(tmp_path):
    file = tmp_path / "controller.py"
    file.write_text("import numpy as np\n\n\ndef step():\n    return np.linalg.inv(np.zeros((2, 3)))\n")
    spec = importlib.util.spec_from_file_location("controller", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    with pytest.raises(np.linalg.LinAlgError) as caught:
        module.step()
    assert described(caught.value).startswith(f"{file}:5: LinAlgError: ")


def test_a_notebook_shows_the_lines_of_the_person_and_the_problems():
    """Not the sixty lines of the packages between them."""
    with pytest.raises(ScenarioError) as caught:
        load("no_such_scenario")
    lines = caught.value._render_traceback_()
    assert [line for line in lines if "twin" + os.sep in line] == []
    assert "test_errors.py" in lines[0]
    assert 'load("no_such_scenario")' in lines[0]
    assert lines[-1].startswith("ScenarioError: There is no scenario 'no_such_scenario'")
    assert len(lines) == 2
