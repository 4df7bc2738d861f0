"""Drives on the page: the commands of the bench as its buttons, and the safety view in words."""

import time
from types import SimpleNamespace

import pytest

from hw_bridge.command.pages import PANEL, STEPS, options
from hw_bridge.command.typed import MOVES, settled
from tests.every_case import every_case
from twin.console import Host, safety
from twin.errors import TwinError

LIMITS = "{position: [-45 mm, 45 mm], velocity: 200 mm/s, force: 8 N, following_error: 3 mm, acceleration: 3 m/s^2}"
NODE = f"nodes: {{axis: {{node: 1, profile: faulhaber_v3, limits: {LIMITS}}}}}\n"
LIMIT = {"name": "force", "value": 4.5, "low": -5.0, "high": 5.0, "part": 0.9, "unit": "N"}
DRIVE = {
    "node": 1,
    "profile": "<b>",
    "state": "Fault",
    "mode": "csv",
    "errors": ["3210h overvoltage. Check the supply."],
    "limits": [LIMIT, {**LIMIT, "name": "velocity", "part": 1.2}],
    "heartbeat_age": 0.004,
    "heartbeat_limit": 0.06,
    "lost": 2,
    "late": 0,
}
TOLD = {
    "interface": "socketcan",
    "channel": "can0",
    "armed": True,
    "simulated": False,
    "stopped": "",
    "control": "this session",
    "brought_up": True,
    "bus_load": 0.109,
    "cycle": 0.005,
    "cycles": 7,
    "jitter_99": 2e-4,
    "jitter_max": 1e-3,
    "nodes": {"servomotor": DRIVE},
    "modules": {},
    "watches": {"servomotor": {"signal": "sensor.force", "force": 0.19062, "above": 0.4, "retracts": ""}},
    "shadow": {},
    "notes": ["n"],
}


@pytest.fixture
def typed(tmp_path, build):
    """Commands on a file, of a console that was armed or not."""
    made = []

    def of(bus="simulated: true", arm=False):
        file = tmp_path / "bench.yaml"
        file.write_text(f"{bus}\ncycle: 5 ms\n{NODE}")
        host = Host(hardware=file, build=build, runs=tmp_path / "runs", arm=arm)
        host.activities[PANEL.title] = PANEL.activity(host)
        made.append(host.activities[PANEL.title])
        return made[-1]

    yield of
    for one in made:
        one.close()


def until(condition, seconds=40.0, meanwhile=lambda: None):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        meanwhile()
        time.sleep(0.02)


@pytest.mark.slow
def test_a_button_runs_what_one_types(typed):
    one = typed()
    one.begin("status", "axis")
    assert one.busy == ""  # it only reads: a session may begin
    assert not one.attended
    with pytest.raises(TwinError, match=r"twin hil status goes on. End it first"):
        one.begin("scan")
    until(lambda: not one.running)
    assert "Switch on disabled" in one.text
    ((_, line, code),) = one.done
    assert (line, code) == (f"twin hil status axis -f {one.file}", 0)


@pytest.mark.slow
def test_a_jog_moves_while_it_is_renewed_and_ends_with_its_page(typed):
    """All of it in the process of the command: here is only who renews."""
    one = typed()
    one.begin("jog", "axis", ["--velocity=20 mm/s"], (20.0, "mm/s"))
    assert one.attended
    assert "twin hil jog has the drives" in one.busy
    assert one.controls == ()
    one.hold("jog axis", 1.0, 1, 0.0)  # not before it is up
    until(lambda: one.controls, meanwhile=lambda: one.here(0.0))
    assert one.controls == ("jog axis",)
    until(lambda: place(one) > 1.0, meanwhile=lambda: one.hold("jog axis", 1.0, 2, 0.0))
    assert one.held == {"jog axis": 1.0}
    one.release_hold()
    until(lambda: one.text.endswith(" A   ") and "  0.00 mm/s" in one.text, meanwhile=lambda: one.here(0.0))
    assert one.held == {}
    there = place(one)
    begun = time.monotonic()
    until(lambda: not one.running)  # and nobody says anything any more
    assert 0.2 < time.monotonic() - begun < 20.0
    assert "no page has shown it" in one.text
    assert place(one) == pytest.approx(there, abs=0.05)
    assert one.done[0][2] == 1


def place(one):
    """Where the jog tells that it is [mm]."""
    last = [line for line in one.text.splitlines() if line.endswith(" A   ") or " A   error" in line]
    return float(last[-1].lstrip("<> ").split()[0]) if last else 0.0


@pytest.mark.slow
def test_an_orderly_end_and_a_stop(typed):
    one = typed()
    one.begin("enable", "axis")
    until(lambda: "Operation enabled" in one.text, meanwhile=lambda: one.here(0.0))
    one.end()
    until(lambda: not one.running, meanwhile=lambda: one.here(0.0))
    assert one.text.endswith("axis: stopped and disabled.\n")
    one.begin("enable", "axis")
    until(lambda: "Operation enabled" in one.text, meanwhile=lambda: one.here(0.0))
    one.console.stop()  # what STOP does
    until(lambda: not one.running)
    assert "interrupted" in one.text
    assert one.done[0][2] == 130


@pytest.mark.slow
def test_nothing_is_armed_that_the_command_line_did_not_arm(typed):
    real = "interface: socketcan\nchannel: can0"
    one = typed(real)
    for word in MOVES:
        with pytest.raises(TwinError, match=r"was not armed. End it, and start it with --arm"):
            one.begin(word, "axis")
    assert one.process is None
    one.begin("status", "axis")
    until(lambda: not one.running)
    assert "--arm" not in one.done[0][1]
    armed = typed(real, arm=True)
    armed.begin("move", "axis", ["--by=1 mm"])
    until(lambda: not armed.running)
    assert armed.done[0][1].endswith("--arm")
    assert armed.done[0][2] == 1  # there is no can0 here


def test_a_session_that_has_the_drives_keeps_them(typed):
    one = typed()
    going = SimpleNamespace(
        catalog=SimpleNamespace(wall_clock=True), state=SimpleNamespace(phase="running", hardware=None), resume=None
    )
    one.console.live = going
    for word in ("jog", "disable", "reset"):
        with pytest.raises(TwinError, match=r"the session uses the drives. Stop it first"):
            one.begin(word, "axis")
    going.state = SimpleNamespace(phase="paused", hardware={"brought_up": False})
    assert one.console.drives_in_use == ""
    one.begin("enable", "axis")
    with pytest.raises(TwinError, match="twin hil enable has the drives"):
        one.console.resume()
    one.close()
    one.console.live = None


@every_case("text", ["--arm", "1 mm; rm", "1 mm\n--arm", "x" * 41, "$(1)", "1 mm --arm"])
def test_what_a_field_holds_is_a_quantity(text):
    (move,) = [one for one in STEPS if one.word == "move"]
    with pytest.raises(TwinError, match="expected a number with its unit"):
        options(move, {"by": text})


def test_a_file_that_is_wrong_is_told_before_anything_is_served(tmp_path):
    with pytest.raises(TwinError, match=r"nowhere.yaml: cannot be read"):
        PANEL.activity(Host(hardware=tmp_path / "nowhere.yaml"))


def test_what_is_filled_in_is_what_is_typed():
    steps = {one.word: one for one in STEPS}
    assert options(steps["move"], {"by": " -1.5 mm ", "velocity": "", "homed": True, "arm": True}) == [
        "--by=-1.5 mm",
        "--homed",
    ]
    assert options(steps["jog"], {"acceleration": "0.5 m/s^2"}) == ["--acceleration=0.5 m/s^2"]
    assert settled("a\n\r1 mm\r2 mm") == "a\n2 mm"


def test_what_one_watches_over_stands_there_in_words():
    assert "armed: power may be on" in safety.heading(TOLD)
    assert "load 10.9 %" in safety.heading(TOLD)
    assert "stopped: EMCY &lt;1&gt;" in safety.heading({**TOLD, "stopped": "EMCY <1>"})
    assert "not armed" in safety.heading({**TOLD, "armed": False, "brought_up": False})
    told = safety.drives(TOLD)
    assert "&lt;b&gt;" in told
    assert "<b>" not in told.replace("<b>servomotor</b>", "")
    for text in ("3210h overvoltage. Check the supply.", "heartbeat 4 of 60 ms", "2 lost", "twin-warn", "twin-bad"):
        assert text in told
    assert "sensor.force is 0.191 N, stops above 0.4 N<" in safety.details(TOLD)
    residual = {"position": 1e-3, "velocity": None, "current": 0.5}
    shadow = {"now": residual, "bands": residual, "largest": residual, "warnings": ["Look at <it>."]}
    text = safety.details({**TOLD, "shadow": {"servomotor": shadow}})
    assert "position 1 mm (band 1 mm, largest 1 mm), velocity not known" in text
    assert "Look at &lt;it&gt;." in text
    assert "velocity not known (band not known, largest not known), current 0.5 A" in text
    assert "position 0.0573 deg" in safety.shadow(shadow, rotary=True)
