"""The state machine against CiA 402 as python-canopen has it, and against random controlwords."""

import pytest
from canopen.profiles.p402 import State402
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hw_bridge.dictionary import Command, Mode, State, cia402
from tests.every_case import every_case
from tests.hw_bridge.bench import Bench


def test_masks_are_those_of_python_canopen():
    assert {state.upper(): tuple(pattern) for state, pattern in cia402.STATUS.items()} == State402.SW_MASK


@every_case(("source", "target"), [pair for pair in State402.TRANSITIONTABLE if "START" not in pair])
def test_transitions_are_those_of_python_canopen(source, target):
    word = State402.TRANSITIONTABLE[source, target]
    if source in ("NOT READY TO SWITCH ON", "FAULT REACTION ACTIVE"):
        assert any((one.source.upper(), one.target.upper()) == (source, target) for one in cia402.TRANSITIONS)
        return
    found = cia402.transition(State(source.capitalize()), word, 0)
    assert found is not None
    assert found.target.upper() == target


def test_every_number_is_there():
    assert {one.number for one in cia402.TRANSITIONS} == set(range(1, 17))


def test_bits_of_controlword_and_statusword():
    """Numbers of CiA 402-2, tables of 6040h and 6041h."""
    bits = {"VOLTAGE_ENABLED": 4, "WARNING": 7, "HALT": 8, "REMOTE": 9, "TARGET_REACHED": 10, "INTERNAL_LIMIT": 11,
            "BIT_12": 12, "BIT_13": 13}  # fmt: skip
    assert {name: getattr(cia402, name) for name in bits} == {name: 1 << bit for name, bit in bits.items()}


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_a_controlword_is_one_command(word, previous):
    fitting = [command for command, pattern in cia402.CONTROL.items() if pattern.fits(word)]
    assert len(fitting) <= 1
    command = cia402.command_of(word, previous)
    if word & 0x80:
        assert command is (Command.NONE if previous & 0x80 else Command.FAULT_RESET)
    else:
        assert [command] == fitting


def test_typical_words_are_their_commands():
    assert all(cia402.command_of(word, 0) is command for command, word in cia402.TYPICAL.items())


LEGAL = {(one.source, one.target) for one in cia402.TRANSITIONS}
# in one cycle the drive may go on by itself: 3 and 4 with one controlword, 11 or 16 and 12, and a stop at standstill
LEGAL |= {(State.READY, State.ENABLED), (State.ENABLED, State.DISABLED)}


@pytest.fixture(scope="module")
def long(build):
    """One bench for all examples: making a motor takes longer than they do."""
    return Bench("epos4", build)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(words=st.lists(st.one_of(st.sampled_from(list(cia402.TYPICAL.values())), st.integers(0, 0x1FF)), max_size=12))
def test_random_controlwords_take_legal_transitions(long, words):
    long.drive.power_on()
    long.go(2)
    for word in words:
        before = long.state
        long.write(0x6040, word)
        after = long.state
        if after is not before:
            assert (before, after) in LEGAL, f"{word:04X}"
        if after is State.ENABLED and before is not State.ENABLED:
            assert cia402.command_of(word, 0) is Command.ENABLE


@pytest.mark.parametrize(("name", "code"), [("faulhaber_v3", 0x5410), ("epos4", 0x2310)])
def test_fault_needs_a_rising_edge(make, name, code):
    bench = make(name)
    bench.enable(Mode.PV)
    bench.control(0x8F)
    bench.drive.inject(code)
    bench.go(3)
    assert bench.state is State.FAULT
    for word, state in ((0x8F, State.FAULT), (0x0F, State.FAULT), (0x80, State.DISABLED)):
        bench.control(word)
        assert bench.state is state


def test_a_lasting_cause_cannot_be_reset(make):
    bench = make("epos4")
    bench.drive.inject(0x8A88, lasting=True)
    bench.go(3)
    bench.control(0x80, 0x00)
    assert bench.state is State.FAULT
    bench.drive.remove(0x8A88)
    bench.control(0x80)
    assert bench.state is State.DISABLED
