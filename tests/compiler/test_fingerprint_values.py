"""Whatever a component can read changes its fingerprint: values two by two, in milliseconds. See test_edits.py for files."""

import textwrap

from tests.compiler.value_pairs import PAIRS
from tests.every_case import every_case
from twin.compiler.fingerprint import Trace, fingerprint
from twin.compiler.introspection import descriptor_names


@every_case("what", PAIRS)
def test_what_differs_has_another_fingerprint(what):
    made = PAIRS[what]
    first, second = fingerprint(made(0)), fingerprint(made(1))
    assert first is not None
    assert second is not None
    assert first != second
    assert (fingerprint(made(0)), fingerprint(made(1))) == (first, second)  # the same once more: nothing by address


def test_the_order_of_a_set_is_none():
    assert fingerprint({"a", "b", "c"}) == fingerprint({"c", "a", "b"})


def test_what_does_not_show_what_it_holds_is_untraceable():
    def generator():
        yield 1

    assert fingerprint(generator()) is None


@every_case("function", [fingerprint, textwrap.dedent])
def test_functions_of_the_engine_and_of_python_count_by_their_name(function):
    trace = Trace(frozenset())
    trace.function(function)
    assert trace.texts == [repr(("function", function.__module__, function.__qualname__))]
    assert (trace.objects, trace.modules) == ([], {})


def test_a_function_counts_once():
    """Its code refers to itself by a closure."""

    def outer():
        return outer

    trace = Trace(frozenset())
    trace.function(outer)
    before = len(trace.texts)
    trace.function(outer)
    assert [text.startswith(("('function'", "('known'")) for text in trace.texts[before:]] == [True, True]
    assert before > 2


def test_arguments_do_not_run_into_each_other():
    assert len({fingerprint("ab", "c"), fingerprint("a", "bc"), fingerprint("abc")}) == 3


def test_names_that_run_code_when_they_are_read():
    class Base:
        gain, slots = 1.0, staticmethod(len)

        @property
        def doubled(self):
            return 2.0 * self.gain

        def method(self):
            return self.gain

    class Computed(Base):
        def __getattr__(self, name):
            return 1.0

    assert descriptor_names(type("Derived", (Base, int), {})) - {"__dict__", "__weakref__"} == {"doubled"}
    assert descriptor_names(Computed) is None
    assert descriptor_names(int) == set(), "those of the language do not change"
