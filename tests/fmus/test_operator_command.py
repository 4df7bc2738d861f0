"""An operator's command: recorded, live with a dead-man switch, and its recording from a file."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from fmus.operator_command import evaluate, recording
from fmus.operator_command.model import ROWS, OperatorCommand

H = 1e-3
SCENARIOS = Path(__file__).parents[2] / "scenarios"
SKETCH = SCENARIOS / "commands" / "femoral_to_arch.csv"
HEAD = "time [s],catheter_velocity [mm/s],wire_velocity [mm/s]\n"


def padded(values):
    return (*values, *(0.0,) * (ROWS - len(values)))


def recorded(native, instants, wire, held=None, **values):
    """A command with one trapezoid of the wire's speed."""
    table = {"instant": padded(instants), "wire_speed": padded(wire), "catheter_speed": 0.0, "wire_turn": 0.0}
    part = native(OperatorCommand, **table, hold=padded(held or [0] * len(instants)), rows=len(instants), **values)
    part.start(0.0)
    return part


def advance(part, seconds, t=0.0):
    rows = []
    for step in range(round(seconds / H)):
        assert part.advance(t + step * H, H) == 0
        rows.append((float(part.wire_velocity), float(part.wire_reference), int(part.origin), int(part.held)))
    return np.array(rows).T


def test_a_recording_is_played_and_its_integral_is_exact(native):
    part = recorded(native, (0.0, 0.5, 1.5, 2.0), (0.0, 0.03, 0.03, 0.0))
    speed, way, origin, held = advance(part, 2.5)
    time = H * np.arange(1, 2000)
    assert speed[:1999] == pytest.approx(np.interp(time, (0, 0.5, 1.5, 2), (0, 0.03, 0.03, 0)), abs=1e-9)
    assert way[-1] == pytest.approx(0.03 * 1.5, abs=1e-8)
    assert origin[1000] == 0
    assert origin[-1] == 3
    assert held[-1] == 3


def test_what_is_faster_than_the_rig_is_cut_and_speed_changes_gently(native):
    part = recorded(native, (0.0, 0.001, 5.0), (0.0, 0.1, 0.1))
    speed, *_ = advance(part, 1.0)
    assert speed.max() == pytest.approx(0.04)
    assert np.abs(np.diff(speed)).max() <= 0.1 * H + 1e-15
    assert speed[199] == pytest.approx(0.02, abs=2e-4)


def test_the_interlock_stops_what_is_held(native):
    part = recorded(native, (0.0, 0.5, 1.0, 3.0), (0.03, 0.03, 0.03, 0.03), held=(0, 0, 2, 2))
    speed, _, _, held = advance(part, 2.0)
    assert speed[900] == pytest.approx(0.03)
    assert held[1100] == 2
    assert not speed[1400:].any()


def live(native, **values):
    part = recorded(native, (0.0, 1.0, 9.0), (0.0, 0.02, 0.02))
    advance(part, 2.0)
    part.live, part.pressed = True, True
    part.live_speed[:] = 0.0, 0.03
    for name, value in values.items():
        setattr(part, name, value)
    return part


def test_live_is_followed_while_the_switch_is_pressed(native):
    part = live(native)
    speed, _, origin, _ = advance(part, 1.0, 2.0)
    assert speed[-1] == pytest.approx(0.03)
    assert origin[-1] == 1
    part.pressed = False
    speed, _, origin, held = advance(part, 1.0, 3.0)
    assert np.abs(np.diff(speed)).max() <= 0.1 * H + 1e-15
    assert not speed[300:].any()  # 30 mm/s at 0.1 m/s^2
    assert speed[298] > 0.0
    assert (origin[-1], held[-1]) == (2, 3)


@pytest.mark.parametrize(
    "values",
    [{"live_age": 0.201}, {"live_age": math.nan}, {"live_speed": (0.0, math.nan)}, {"live_turn": (math.inf, 0.0)}],
    ids=["old", "no age", "no number", "infinite"],
)
def test_a_command_that_is_none_stops(native, values):
    part = live(native, **values)
    speed, _, origin, _ = advance(part, 1.0, 2.0)
    assert not speed[300:].any()
    assert origin[-1] == 2
    assert np.isfinite(speed).all()


def test_the_recording_waits_and_goes_on(native):
    part = live(native, live_held=2)
    before = float(part.played)
    speed, *_ = advance(part, 1.5, 2.0)
    assert not speed[300:].any()  # the wire is held live
    assert part.played == before
    part.live = False
    advance(part, 1.0, 3.5)
    assert part.played == pytest.approx(before + 1.0)
    assert part.wire_velocity == pytest.approx(0.02)


def test_turning_is_followed_as_an_angle(native):
    part = native(
        OperatorCommand,
        catheter_turn=padded((0.0, 0.6, 0.6)),
        instant=padded((0.0, 1.0, 3.0)),
        rows=3,
        hold=0,
        catheter_speed=0.0,
        wire_speed=0.0,
        wire_turn=0.0,
    )
    part.start(0.0)
    advance(part, 2.0)
    assert part.catheter_angle == pytest.approx(0.6 * 1.5, abs=1e-6)
    assert part.wire_angle == 0.0


def test_the_scenario_has_the_table_of_its_file():
    made = recording.parameter_set(SKETCH)
    assert made == SKETCH.with_suffix(".yaml").read_text()
    values = yaml.safe_load(made)["operator_command"]
    assert values["rows"] == 41
    assert len(values["wire_speed"]) == ROWS


def test_a_dense_recording_is_thinned_within_what_it_says(tmp_path, native):
    time = np.arange(0.0, 20.0, 0.02)
    place = 40.0 * (1.0 - np.cos(0.6 * time))  # [mm]
    text = "".join(f"{1e3 * t:.1f},{x:.6f},0\n" for t, x in zip(time, place, strict=True))
    path = tmp_path / "mine.csv"
    path.write_text("time [ms],wire_position [mm],catheter_velocity [m/s]\n" + text)
    made = recording.parameter_set(path)
    values = yaml.safe_load(made)["operator_command"]
    assert 10 < values["rows"] <= ROWS
    part = native(OperatorCommand, **values)
    part.start(0.0)
    _, way, *_ = advance(part, 19.9)
    told = float(re.search(r"within ([\d.e-]+) mm", made)[1])
    assert 1e3 * way[499::500] == pytest.approx(np.interp(0.5 + 0.5 * np.arange(39), time, place), abs=told + 0.3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "0 rows. Expected 2 or more"),
        (HEAD + "0,0,0\n", "1 rows. Expected 2 or more"),
        ("time [s],wire_velocity [mm/s]\n0,0\n1,0\n", "Expected time, catheter_velocity or catheter_position"),
        (
            "time,catheter_velocity [mm/s],wire_velocity [mm/s]\n0,0,0\n1,0,0\n",
            "column `time` has no unit. Write `time [s]`",
        ),
        ("time [s],catheter_velocity [N],wire_velocity [mm/s]\n0,0,0\n1,0,0\n", "does not convert to m/s"),
        ("time [s],time [s],wire_velocity [mm/s]\n0,0,0\n1,0,0\n", "column `time` is there twice"),
        ("time [s],speed [mm/s]\n0,0\n1,0\n", "unknown column `speed [mm/s]`"),
        (
            "time [s],wire_velocity [mm/s],wire_position [mm],catheter_velocity [mm/s]\n0,0,0,0\n1,0,0,0\n",
            "each axis once",
        ),
        (HEAD + "0,0,0\n1,nan,0\n", "row 2: catheter_velocity is `nan`. Expected a number"),
        (HEAD + "0,0,0\n1,0\n", "row 2: wire_velocity is ``. Expected a number"),
        (HEAD + "0,0,0\n2,0,0\n1,0,0\n", "row 3: time 1 s. Expected times from 0 on that rise"),
        (HEAD + "-1,0,0\n2,0,0\n", "row 1: time -1 s"),
        (HEAD + "0,0,0\n1,0,400\n", "row 2: wire_velocity asks for 400 mm/s. Expected at most 40 mm/s; check the unit"),
        (HEAD[:-1] + ",held\n0,0,0,wire\n1,0,10,none\n", "row 1: wire is held and moves by wire_velocity"),
        (HEAD[:-1] + ",held\n0,0,0,me\n1,0,0,none\n", "row 1: held is `me`. Expected none, catheter, wire, both"),
        (
            HEAD + "".join(f"{i},{30 * (i % 2)},0\n" for i in range(200)),
            "needs 200 rows after thinning, there is room for 96",
        ),
    ],
)
def test_a_bad_recording_is_told_in_one_line(tmp_path, text, message):
    path = tmp_path / "mine.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)) as told:
        recording.parameter_set(path)
    assert "\n" not in str(told.value)


def test_what_is_no_text_or_not_there_is_told(tmp_path):
    with pytest.raises(ValueError, match="no such file"):
        recording.read(tmp_path / "none.csv")
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ValueError, match="Expected a text file"):
        recording.read(tmp_path / "a.csv")


def test_moves_are_read_at_rest_and_held_motion_is_found():
    speed = np.zeros(600)
    speed[100:200], speed[350:450] = 0.02, -0.02
    true = np.cumsum(speed) * evaluate.STEP
    found = evaluate.moves(speed, true, 1.1 * true, true - 0.5, true)
    assert found["way"] == pytest.approx(1.1 * 0.04)
    assert found["difference"] == pytest.approx(0.1 * 0.04)
    assert found["fused_error"] == pytest.approx(0.0, abs=1e-12)

    held = np.where(speed == 0.0, 3.0, 2.0)
    tip = true + np.where(np.arange(600) > 550, 1e-3, 0.0)
    found = evaluate.still(held, speed, 0.0 * speed, tip, 0.0 * tip)
    assert found["catheter_moved"] == pytest.approx(1e-3)
    assert found["wire_moved"] == 0.0
    with pytest.raises(ValueError, match="1 moves of the catheter"):
        evaluate.moves(np.abs(speed) * (np.arange(600) < 300), true, true, true, true)


def test_registration_puts_a_shifted_and_turned_curve_back():
    along = np.arange(evaluate.GRATINGS + 1 + 13) * evaluate.PITCH
    curve = np.column_stack((0.05 * np.sin(9.0 * along), 0.02 * np.cos(14.0 * along), along))
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    before, after = curve[: evaluate.GRATINGS + 1], curve[13:] @ turn + 0.1
    speed = np.zeros(400)
    speed[50:100], speed[200:250] = 0.02, -0.02
    shape = np.where((np.arange(400) < 60)[:, None, None], before, after)
    shift = np.where(np.arange(400) < 60, 0.0, 0.13)
    found = evaluate.profiles(speed, shift, np.ones((400, evaluate.GRATINGS, 2)), shape)
    assert found["registered_rms"] < 1e-9
    assert found["travel"] == pytest.approx(0.13)
    assert found["last_along"][0] == pytest.approx(found["first_along"][13])
    assert np.isnan(found["first"][evaluate.GRATINGS :]).all()
