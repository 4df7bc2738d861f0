"""Residuals of a shadow without a bus: frames that its twin receives, signs, missing process data, reports over time."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import Frame
from hw_bridge.hardware import ShadowKeys
from hw_bridge.shadow import Shadow, shadow
from hw_bridge.shadow.symptoms import Sample, figures_of
from tests.hw_bridge.unconnected import unconnected_node

CYCLE = 5_000_000
BANDS = {"position": "0.1 mm", "velocity": "2 mm/s", "current": "79 mA", "window": "20 ms", "moving": "2 mm/s"}


class Twin:
    """A simulated drive whose values a test sets: position, velocity and current in units of the drive."""

    def __init__(self, *_):
        self.calls, self.values = [], {0x6064: 0, 0x606C: 0, 0x6077: 0}
        self.drive = SimpleNamespace(
            connect=lambda _: None,
            advance=lambda time: self.calls.append(("advance", time)),
            receive=lambda frame: self.calls.append(("receive", frame.id)),
            dictionary=SimpleNamespace(get=lambda index, sub=0: self.values[index] if sub == 0 else -1),
            port=SimpleNamespace(event_queue=SimpleNamespace(now=100)),
        )

    def update_load(self):
        self.calls.append(("load",))


@pytest.fixture
def make(monkeypatch):
    """Make a shadow of a drive with these keys; a cycle of it with residuals in the drive's units."""
    monkeypatch.setattr(shadow, "Plant", Twin)

    def make(views=None, **keys):
        node = unconnected_node(**keys)
        network = SimpleNamespace(observe=lambda hear: None, now=700)
        bands = ShadowKeys.model_validate(BANDS)
        axis = SimpleNamespace(views=views or {})
        made = Shadow(axis, node.keys, bands, node, network, 0.0, 127, CYCLE, None)
        made.twin = made.plant

        def cycle(number, position=0, velocity=0, current=0, speed=0, answered=1):
            made.twin.values.update({0x6064: 5000, 0x606C: speed, 0x6077: 10})
            made.hear(number * CYCLE, Frame(0x80))
            node.raw_position, node.raw_velocity, node.raw_current = 5000 + position, speed + velocity, 10 + current
            node.answered = answered
            made.look(number * CYCLE)

        made.cycle_with = cycle
        return made

    return make


def test_the_twin_receives_what_the_drive_receives(make):
    made = make()
    heard = [0x000, 0x080, 0x203, 0x303, 0x403, 0x503, 0x603, 0x77F]
    others = [0x183, 0x283, 0x583, 0x703, 0x204, 0x604, 0x083, 0x77E]
    for identifier in sorted(heard + others):
        made.hear(1000, Frame(identifier))
    made.hear(1000, None)
    assert [call[1] for call in made.twin.calls if call[0] == "receive"] == heard
    made.twin.calls.clear()
    made.hear(50, Frame(0x000))  # its time never goes back
    made.update_load()
    assert made.twin.calls == [("advance", 100), ("receive", 0), ("advance", 700), ("load",)]


@pytest.mark.parametrize(
    ("keys", "factor", "current"),
    [
        ({}, 1.0, 1.0),
        ({"inverted": True}, -1.0, -1.0),
        ({"scale": 2.0}, 2.0, 1.0),
        ({"scale": 2.0, "inverted": True}, -2.0, -1.0),
    ],
)
def test_residuals_are_those_of_the_member(make, keys, factor, current):
    """The drive's value minus its twin's: 30 um, 4 mm/s and 79 mA more than in the first cycle."""
    made = make({"load_force": -2.5}, **keys)
    made.cycle_with(1, position=200)  # both may have begun anywhere
    made.cycle_with(2, position=230, velocity=4, current=100, speed=7)
    assert made.samples[0] == Sample(0.0, 0.0, 0.0, 0.0, -2.5, gap=False)
    expected = (factor * 30e-6, factor * 4e-3, current * 0.079, factor * 7e-3, -2.5)
    assert made.samples[1][:5] == pytest.approx(expected)
    made.cycle_with(3, position=200, velocity=-1)
    report = made.report()
    assert report["now"] == pytest.approx({"position": 0.0, "velocity": -factor * 1e-3, "current": 0.0})
    largest = {"position": abs(factor) * 30e-6, "velocity": abs(factor) * 4e-3, "current": 0.079}
    assert report["largest"] == pytest.approx(largest)
    assert report["bands"] == pytest.approx({"position": 1e-4, "velocity": 2e-3, "current": 0.079})
    assert report["warnings"] == []


def test_a_shadow_without_a_sample(make):
    assert make().report()["now"] == {"position": None, "velocity": None, "current": None}


def test_process_data_that_are_missing_or_late_are_left_out(make):
    """After a cycle without an answer, one answer belongs to the SYNC before; two make up for it."""
    made = make()
    for number, answered in enumerate([1, 0, 1, 1, 0, 2, 1, 0, 0, 1, 1]):
        made.cycle_with(number, position=number, answered=answered)
    places = [(round(sample.position * 1e6), sample.gap) for sample in list(made.samples)]
    assert made.samples.maxlen == 4
    assert places == [(3, True), (5, True), (6, False), (10, True)]


def test_a_step_across_a_gap_is_no_jump():
    """While four cycles are missing, a drive that is slower than its twin falls behind by more than a band."""
    samples = [Sample(-1e-5 * k, -2e-3, 0.0, 0.1, 0.0, gap=False) for k in (1, 2, 13, 14)]
    bands = ShadowKeys.model_validate(BANDS)
    assert figures_of(samples, bands, 0.005).jump == pytest.approx(1.0)
    samples[2] = samples[2]._replace(gap=True)
    assert figures_of(samples, bands, 0.005).jump == pytest.approx(0.0, abs=1e-9)
    assert figures_of([sample._replace(gap=True) for sample in samples], bands, 0.005).jump == 0.0


def test_a_jump_is_reported_at_once_and_again_after_a_window_without_it(make):
    made = make()
    positions = [0, 0, 0, 0, 150, 150, 150, 150, 150, 150, 150, 150, 150, 0, 0, 0]
    for number, position in enumerate(positions):
        made.cycle_with(number, position=position)
    text = "axis: at {} s position jumps, velocity does not (jump 1.5, drift {} of the band). Look at the encoder, its scale or its mounting."
    assert made.warnings == [text.format("0.020", "1.5"), text.format("0.065", "-1.5")]


def test_a_symptom_that_has_lasted_for_a_window_is_reported_once(make):
    """A drive that is 3 mm/s slower with 158 mA more, while its twin moves to positive positions at 50 mm/s."""
    made = make()
    for number in range(30):
        made.cycle_with(number, position=-15 * number, velocity=-3, current=200, speed=50)
    text = (
        "axis: at 0.035 s slower than its twin, with more current (lag 1.5, ahead 2.0 of the band). Look at something "
        "holds it: a collision, a jam, a guide."
    )
    assert made.warnings == [text]
