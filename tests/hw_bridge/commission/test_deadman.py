"""The held key of a terminal: names of keys, directions, the times between which a key counts as held."""

import os
from types import SimpleNamespace

from hw_bridge.commission import deadman
from hw_bridge.commission.deadman import BEGIN, HOLD, DeadMan, HeldKey, Keyboard, split
from tests.every_case import every_case

MS = 1_000_000


@every_case(
    ("data", "names"),
    [
        (b"", []),
        (b"\x1b[C\x1b[D\x1b[A\x1b[B", ["right", "left", "up", "down"]),
        (b"\x1bOC\x1bOD\x1bOA\x1bOB", ["right", "left", "up", "down"]),
        (b"qQ", ["q", "q"]),
        (b"\x03\x04", ["quit", "quit"]),
        (b" x\x1b[C", ["space", "other", "right"]),
        (b"\x1b[", ["other", "other"]),
    ],
)
def test_names_of_keys(data, names):
    assert split(data) == names


@every_case(("key", "direction"), [("right", 1), ("up", 1), ("left", -1), ("down", -1), ("space", 0)])
def test_the_repeat_of_a_key_moves_in_its_direction(key, direction):
    dead = DeadMan()
    assert dead.look([key], 0) == 0
    assert dead.look([], HOLD) == 0
    assert dead.look([key], BEGIN - 1) == direction
    assert dead.look([], BEGIN - 1 + HOLD) == direction
    assert dead.look([], BEGIN + HOLD) == 0
    assert dead.look([], BEGIN + HOLD) == 0


def test_what_is_no_repeat_moves_nothing():
    """A key alone, one that comes too late, another direction, any other key; two at once are a repeat."""
    dead = DeadMan()
    assert dead.look(["right"], 0) == 0
    assert dead.look(["right"], BEGIN) == 0
    assert dead.look(["left"], BEGIN + MS) == 0
    assert dead.look(["left"], BEGIN + 2 * MS) == -1
    assert dead.look(["other"], BEGIN + 3 * MS) == 0
    assert dead.look(["left"], BEGIN + 4 * MS) == 0
    assert dead.look(["left", "right"], BEGIN + 5 * MS) == 0
    assert dead.look(["up", "up"], BEGIN + 6 * MS) == 1


def test_repeats_from_before_a_stall_or_before_the_drive_was_ready_move_nothing():
    """Whether the key is still held shows with the next one."""
    dead = DeadMan()
    assert dead.look(["right"] * 20, 0) == 0
    assert dead.look(["right"], 30 * MS) == 1
    assert dead.look(["right"] * 3, 30 * MS + HOLD) == 1
    assert dead.look(["right"] * 3, 31 * MS + 2 * HOLD) == 0
    assert dead.look([], 36 * MS + 2 * HOLD) == 0
    assert dead.look(["right"], 41 * MS + 2 * HOLD) == 1


def test_a_held_key_ends_for_good_by_q_or_a_closed_terminal(monkeypatch):
    now = [0]
    monkeypatch.setattr(deadman.time, "monotonic_ns", lambda: now[0])
    keys = []
    held = HeldKey(SimpleNamespace(pressed=lambda: [keys.pop(0)] if keys else []))
    keys += ["right", "right", "right"]
    assert held.deflection() == 0.0
    now[0] += 30 * MS
    assert held.deflection() == 1.0
    keys[:] = ["quit"]
    assert (held.deflection(), held.over) == (0.0, True)
    keys[:] = ["right", "right"]
    assert [held.deflection() for _ in range(2)] == [0.0, 0.0]
    assert held.over


def test_keys_that_were_pressed_since_the_last_look():
    reading, writing = os.pipe()
    keyboard = Keyboard(reading)
    assert keyboard.pressed() == []
    os.write(writing, b"\x1b[Cq")
    assert keyboard.pressed() == ["right", "q"]
    os.write(writing, b"x")
    os.close(writing)
    assert keyboard.pressed() == ["other", "quit"]
    assert keyboard.gone
    os.close(reading)
    assert keyboard.pressed() == ["quit"]  # hung up
