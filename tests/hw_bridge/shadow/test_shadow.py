"""The twin beside the drive: the same to the bit without a fault, and the right part with one."""

from math import copysign

import pytest

from hw_bridge.hardware import ShadowKeys
from hw_bridge.shadow.symptoms import SYMPTOMS, Figures, Sample, direction, explained, figures_of, mean
from tests.every_case import every_case
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge import NODES
from tests.matrix import covering

FAULTS = {
    "friction": ({"fault": "friction", "factor": 2.0}, "friction: guide rail"),
    "worn": ({"fault": "friction", "factor": 0.2}, "friction has fallen"),
    "grip": ({"fault": "grip", "factor": 0.2}, "the grip: sleeve slipping, or air low"),
    "slow": ({"fault": "slow", "factor": 0.2}, "the drive: gains"),
    "encoder": ({"fault": "encoder_offset", "offset": "0.5 mm"}, "the encoder"),
}
QUIET = Figures(jump=0.1, drift=0.1, lag=0.1, ahead=0.1, back=-0.1, both=True, relieved=0.1, by_load=False)


def to_and_fro(rig, seconds):
    """1 Hz, 20 mm/s, with a load that does not follow the motion."""
    for _ in range(round(1000 * seconds)):
        phase = rig.t % 1000
        slope = phase / 250 if phase < 250 else 2 - phase / 250 if phase < 750 else phase / 250 - 4
        rig.set(target_velocity=0.02 * slope, load_force=-4.0 + copysign(1.0, 500 - (rig.t + 250) % 1000))
        rig.go(1)


@pytest.mark.slow
@pytest.mark.parametrize("name", NODES)
def test_no_residual_without_a_fault(build, name):
    """Targets, load and bus are the same, and so is every increment."""
    rig = Rig(build, {"servomotor": NODES[name] | {"shadow": {"window": "0.2 s"}}})
    to_and_fro(rig, 0.6)
    (shadow,) = rig.session.observers.values()
    assert len(shadow.samples) == 40
    assert shadow.largest == {"position": 0.0, "velocity": 0.0, "current": 0.0}
    assert max(abs(one.speed) for one in shadow.samples) > 0.005
    rig.axis.close()
    assert rig.session.outcome.notes == []


@pytest.mark.slow
@pytest.mark.parametrize(("which", "inverted"), covering(FAULTS, [False, True]))
def test_a_fault_speaks_for_its_part(build, which, inverted):
    fault, part = FAULTS[which]
    keys = node(shadow={}, inverted=inverted, limits={"force": "30 N"})
    rig = Rig(build, {"servomotor": keys}, faults=[{"at": "1.5 s", "node": "servomotor", **fault}])
    to_and_fro(rig, 4.5)
    (shadow,) = rig.session.observers.values()
    assert len(shadow.warnings) == 1, shadow.warnings
    assert part in shadow.warnings[0]
    assert 1.5 < float(shadow.warnings[0].split("at ")[1].split(" s")[0]) < 4.5
    rig.axis.close()
    assert rig.session.outcome.notes == shadow.warnings
    assert rig.session.report()["shadow"]["servomotor"]["warnings"] == shadow.warnings


@pytest.mark.slow
def test_late_process_data_are_no_residual(build):
    """On a bus that is late half of the time the drive is compared where both are of the same SYNC."""
    late = {
        "at": "0.1 s",
        "node": "servomotor",
        "fault": "delay",
        "identifiers": [0x181, 0x2FF],
        "delay": "4.7 ms",
        "share": 0.5,
    }
    rig = Rig(build, {"servomotor": node(shadow={"window": "0.2 s"})}, faults=[late])
    to_and_fro(rig, 1.0)
    (shadow,) = rig.session.observers.values()
    assert rig.master.nodes["servomotor"].late > 20
    assert len(shadow.warnings) == 0
    assert shadow.largest["position"] < 1.2 * 0.02 * 5e-3  # at most one cycle's way


@pytest.mark.slow
def test_a_symptom_that_comes_back_is_told_again(build):
    jumps = [
        {"at": f"{at} s", "node": "servomotor", "fault": "encoder_offset", "offset": f"{x} mm"}
        for at, x in ((0.5, 0.4), (1.5, -0.4))
    ]
    rig = Rig(build, {"servomotor": node(shadow={"window": "0.3 s"})}, faults=jumps)
    to_and_fro(rig, 2.0)
    (shadow,) = rig.session.observers.values()
    assert [line.partition(" s ")[0] for line in shadow.warnings] == ["servomotor: at 0.505", "servomotor: at 1.505"]


@every_case(
    ("seen", "part"),
    [
        ({}, ""),
        ({"jump": 2.0, "drift": 2.0}, "encoder"),
        ({"lag": 2.0, "ahead": 3.0}, "collision"),
        ({"lag": 2.0}, "gains"),
        ({"relieved": 1.5, "by_load": True, "ahead": -2.0, "back": 2.0}, "grip"),
        ({"ahead": 2.0, "back": -2.0}, "guide rail"),
        ({"ahead": -2.0, "back": 2.0}, "fallen"),
        ({"ahead": 2.0, "back": 2.0}, "load"),
        ({"ahead": 2.0, "both": False}, "load"),
        ({"drift": -3.0}, "scaling"),
        # none alone, and none at its band
        ({"relieved": 1.5}, ""),
        ({"by_load": True}, ""),
        ({"relieved": 1.0, "by_load": True}, ""),
        ({"jump": 1.0, "drift": 1.0, "lag": 1.0, "ahead": 1.0, "back": -1.0}, ""),
        ({"drift": -1.0}, ""),
        ({"lag": 2.0, "back": -3.0, "ahead": 0.0}, "collision"),
        ({"lag": 2.0, "back": 3.0, "ahead": -3.0}, "gains"),
        ({"lag": -2.0}, ""),
        ({"ahead": -2.0, "back": 0.0}, "load"),
        ({"ahead": -2.0, "back": 2.0, "both": False}, "load"),
        ({"ahead": 2.0, "back": -2.0, "both": False}, "load"),
        ({"ahead": 2.0, "back": -1.0}, "load"),
        ({"ahead": 1.0, "back": -2.0}, "load"),
        ({"ahead": -2.0, "back": 1.0}, "load"),
        ({"ahead": -1.0, "back": 2.0}, "load"),
        ({"lag": 2.0, "ahead": 1.0, "back": -1.0}, "gains"),
        ({"jump": 2.0, "lag": 2.0, "ahead": 2.0}, "encoder"),
    ],
)
def test_the_table(seen, part):
    found = next((one.part for one in SYMPTOMS if one.shows(QUIET._replace(**seen))), "")
    assert (part in found) if part else not found


def test_what_explains():
    assert explained([1.0, -2.0], [2.0, -4.0]) == pytest.approx(1.0)
    assert explained([1.0, 1.0], [1.0, -1.0]) == 0.0
    assert explained([0.0], [0.0]) == 0.0


def test_pure_functions_of_symptoms():
    assert [direction(speed, 0.1) for speed in (-2.0, -0.1, 0.0, 0.1, 2.0)] == [-1.0, 0.0, 0.0, 0.0, 1.0]
    assert mean([]) == 0.0
    assert mean([1.0, 2.0, 6.0]) == 3.0
    assert explained([0.0, 0.0], [1.0, 2.0]) == explained([1.0, 2.0], [0.0, 0.0]) == 0.0
    assert explained([1.0, -2.0], [-3.0, 6.0]) == pytest.approx(1.0)
    assert explained([1.0, 1.0], [1.0, -1.0]) == 0.0
    assert explained([1.0, 0.0], [1.0, 1.0]) == pytest.approx(0.5)


@pytest.mark.parametrize(("back", "both"), [(9, False), (10, False), (11, True)])
def test_a_tenth_of_a_window_is_too_few_for_a_direction(back, both):
    """The window has 100 samples: 50 forward, `back` backward, the others at rest."""
    speeds = [1.0] * 50 + [-1.0] * back + [0.0] * (50 - back)
    samples = [Sample(0.0, 0.0, 0.06 if speed > 0 else -0.03, speed, 0.0, gap=False) for speed in speeds]
    figures = figures_of(samples, ShadowKeys(), 0.005)
    assert figures.both is both
    assert figures.ahead == pytest.approx(1.0)
    assert figures.back == pytest.approx(-0.5 * both)


def test_signs_of_the_figures_of_a_window():
    """At 0.5 m/s: 2 mm/s slower than its twin is a lag of 1; steps of 0.1 mm against it are a jump of 1.1."""
    samples = [Sample(1e-4 * k, -2e-3, 0.12, 0.5, -3.0, gap=False) for k in range(4)]
    figures = figures_of(samples, ShadowKeys(), 0.005)
    assert figures.lag == pytest.approx(1.0)
    assert figures.drift == pytest.approx(3.0)
    assert figures.jump == pytest.approx(1.1)
    assert figures.relieved == pytest.approx(-2.0)
    reverse = figures_of([sample._replace(speed=-0.5) for sample in samples], ShadowKeys(), 0.005)
    assert reverse.lag == pytest.approx(-1.0)
    assert (reverse.ahead, reverse.back) == pytest.approx((0.0, 2.0))
