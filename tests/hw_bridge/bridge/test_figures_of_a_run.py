"""Figures of a run on drives: extremes of a dry run, live status with distances to limits, bus load, summary."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from hw_bridge.bridge import announcement, status, summary
from hw_bridge.bridge.dry import Extremes, switching
from hw_bridge.bridge.entry import load
from hw_bridge.bridge.hardware import Hardware
from hw_bridge.bridge.status import Load
from hw_bridge.bus import Frame, bit_count
from hw_bridge.commission import PlannedRow
from hw_bridge.dictionary import Mode, State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master.station import EmergencyMessage
from hw_bridge.master.timing import Timing
from tests.hw_bridge.axis import node as node_keys
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin import results
from twin.errors import ScenarioError, SimulationError

LIMITS = {"position": ["-20 mm", "30 mm"], "velocity": "100 mm/s", "force": "5 N", "following_error": "2 mm"}


def drive(position=0, velocity=0, current=0, mode=Mode.CSP, **more):
    """A drive in Operation enabled with these actual values; 0.01 N for one unit of its current."""
    node = unconnected_node(limits=LIMITS, force_constant=f"{0.01 / 0.79e-3} N/A", **more)
    node.word, node.goal, node.mode = WORDS[State.ENABLED], State.ENABLED, mode
    node.raw_position, node.raw_velocity, node.raw_current = position, velocity, current
    return node


def test_extremes_of_a_dry_run():
    node = drive()
    extremes = Extremes(node)
    for position, velocity, current, target in ((1000, 50, -100, 0.0015), (-2000, -80, 250, -0.0005), (0, 0, 0, 0.0)):
        node.raw_position, node.raw_velocity, node.raw_current, node.target_position = (
            position,
            velocity,
            current,
            target,
        )
        extremes.look(0)
    assert extremes.report() == {
        "position": pytest.approx([-2e-3, 1e-3]),
        "velocity": pytest.approx([-0.08, 0.05]),
        "force": pytest.approx([-1.0, 2.5]),
        "following_error": pytest.approx([0.0, 1.5e-3]),
        "target_position": [-0.0005, 0.0015],
    }
    assert extremes.warnings == [
        (
            "axis in csp: target_position -0.50 mm to 1.50 mm, position -2.00 mm to 1.00 mm of -20.00 mm to 30.00 mm, velocity "
            "80.00 mm/s of 100.00 mm/s (80 %), following_error 1.50 mm of 2.00 mm (75 %), force 2.50 of 5 N (50 %)."
        )
    ]


@pytest.mark.parametrize(
    ("mode", "target", "text"),
    [
        (Mode.CSV, "target_velocity", "target_velocity 0.00 mm/s to 20.00 mm/s"),
        (Mode.CST, "target_force", "target_force 0.00 N to 0.02 N"),
    ],
)
def test_targets_of_a_dry_run_in_other_modes(mode, target, text):
    node = drive(mode=mode)
    extremes = Extremes(node)
    for value in (0.0, 0.02):
        setattr(node, target, value)
        extremes.look(0)
    assert extremes.warnings[0].startswith(f"axis in {mode.name.lower()}: {text}, position")


def test_drives_and_modules_whose_outputs_a_set_up_writes():
    nodes = {
        "a": node_keys(),
        "b": node_keys(number=2, safe_outputs=0),
        "c": node_keys(number=3, objects={"2344h.4": 1}),
    }
    modules = {"valves": {"node": 9, "outputs": {0: "a.b"}, "safe_outputs": 0}}
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": nodes, "modules": modules})
    assert switching(keys) == ["b", "valves"]


@pytest.mark.parametrize(("rotary", "length", "force"), [(False, "m", "N"), (True, "rad", "N*m")])
def test_status_of_a_drive(rotary, length, force):
    node = drive(position=17_500, velocity=-25, current=250)
    node.rotary, node.target_position, node.last_heartbeat_at = rotary, 0.017, 4_000_000
    node.missing, node.late = 5, 2
    node.emergencies = [EmergencyMessage(0, 0x4310, 8), EmergencyMessage(0, 0)]
    found = status.drive(node, SimpleNamespace(network=SimpleNamespace(now=24_000_000)))
    rows = {row["name"]: row for row in found["limits"]}
    parts = {"position": 0.5, "velocity": 0.25, "force": 0.5, "following error": 0.25}
    assert {name: row["part"] for name, row in rows.items()} == pytest.approx(parts)
    assert [row["unit"] for row in found["limits"]] == [length, f"{length}/s", force, length]
    assert [(row["low"], row["high"]) for row in found["limits"]] == [
        (-0.02, 0.03),
        (-0.1, 0.1),
        (-5.0, 5.0),
        (-2e-3, 2e-3),
    ]
    values = {"position": 0.0175, "velocity": -0.025, "force": 2.5, "following_error": -0.5e-3}
    assert {name: found[name] for name in values} == pytest.approx(values)
    assert [row["value"] for row in found["limits"]] == pytest.approx(list(values.values()))
    assert (found["heartbeat_age"], found["heartbeat_limit"]) == pytest.approx((0.02, 0.06))
    assert (found["lost"], found["late"], found["node"], found["state"]) == (3, 2, 3, "Operation enabled")
    assert len(found["errors"]) == 1
    assert found["errors"][0].startswith("4310h temperature (1001h 08h temperature). ")


def test_a_drive_without_room_between_its_limits_is_at_its_limit():
    node = drive()
    node.keys.limits.position[:] = [0.01, 0.01]
    found = status.drive(node, SimpleNamespace(network=SimpleNamespace(now=0)))
    assert found["limits"][0]["part"] == 1.0


def test_bus_load_over_a_second():
    heard = []
    network = SimpleNamespace(observe=heard.append)
    load = Load(SimpleNamespace(network=network, keys=SimpleNamespace(bit_rate=10_000)))
    (hear,) = heard
    frame = Frame(0x181, bytes(8))
    hear(500, frame)
    hear(400_000_500, None)
    hear(999_999_999, frame)
    assert load.share == 0.0
    hear(1_000_000_500, frame)
    assert load.share == pytest.approx(3 * bit_count(frame) / 10_000)
    hear(1_500_000_500, frame)
    hear(3_000_000_500, frame)
    assert load.share == pytest.approx(2 * bit_count(frame) / 20_000)


def test_cycle_figures_of_the_live_status():
    master = SimpleNamespace(timing=Timing(5_000_000), cycle=5_000_000)
    policy = SimpleNamespace(report=lambda: {"overruns": 2})
    session = SimpleNamespace(real_time=True, late_cycle_policy=policy)
    expected = {
        "cycles": 0,
        "jitter_99": 0.0,
        "jitter_max": 0.0,
        "bus_load": 0.0,
        "real_time_priority": True,
        "overruns": 2,
    }
    assert status.cycles(master, session, None) == expected
    for time in (0, 5_000_100, 9_999_900, 15_000_000):
        master.timing.synced(time, 0)
    found = status.cycles(master, session, SimpleNamespace(share=0.4))
    assert (found["cycles"], found["bus_load"]) == (4, 0.4)
    assert (found["jitter_max"], found["jitter_99"]) == pytest.approx((200e-9, 198e-9 + 0.04e-9), rel=0.01)


def test_numbers_that_json_has():
    assert [status.plain(value) for value in (1, -2.5, float("nan"), float("inf"))] == [1.0, -2.5, None, None]


def session(lost=0, late=0, overruns=0, is_started=True, trace=None, variant="", notes=()):
    """A case that has ended."""
    nodes = {"a": {"lost_pdos": lost, "late_pdos": late}, "b": {"lost_pdos": 1, "late_pdos": 0}}
    report = {"nodes": nodes, "overruns": overruns, "frames": 7, "references": ["kept."], "restorations": ["restored."]}
    return SimpleNamespace(
        is_started=is_started, trace=trace, variant=variant, report=lambda: report, outcome=SimpleNamespace(notes=notes)
    )


@pytest.mark.parametrize("simulated", [True, False])
def test_the_summary_of_all_cases(simulated):
    bus = {"simulated": True} if simulated else {"interface": "virtual", "channel": "x"}
    keys = HardwareKeys.model_validate({**bus, "nodes": {"a": node_keys()}})
    sessions = [session(2, 3, 4), session(5, 6, 7, trace="run.blf"), session(90, is_started=False)]
    found = summary.report("bench.yaml", keys, sessions, np.array([1e-6, -3e-6]))
    name = "simulated bus" if simulated else "virtual x"
    own = [] if simulated else ["kept.", "restored."]
    first = f"{name}, cycle 5 ms: 9 PDOs lost, 9 late, 11 overruns, jitter 99 % below 0.003 ms, at most 0.003 ms"
    assert found["shown"] == [first, *own, "run.blf: 7 frames", *own]
    assert (found["file"], found["simulated"], found["cycle"], len(found["cases"])) == (
        "bench.yaml",
        simulated,
        0.005,
        2,
    )
    empty = summary.report("bench.yaml", keys, [], np.zeros(0))
    assert empty["shown"] == [f"{name}, cycle 5 ms: 0 PDOs lost, 0 late, 0 overruns"]


def test_the_jitter_is_drawn_in_milliseconds(monkeypatch):
    monkeypatch.setitem(results.__dict__, "histogram", lambda values, label: f"{label}: {values.tolist()}")
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"a": node_keys()}})
    assert summary.pictures(keys, np.zeros(0)) == []
    assert summary.pictures(keys, np.array([0.5e-3, -0.25e-3])) == [
        {
            "title": "Jitter of the cycle",
            "svg": "period - cycle [ms]: [0.5, -0.25]",
            "note": "periods between SYNCs minus 5 ms, 2 of them",
        }
    ]


def test_notes_name_their_variant_where_there_are_several():
    one, other = session(variant="fast", notes=["hot."]), session(notes=["cold."])
    assert summary.notes([one]) == ["hot."]
    assert summary.notes([one, other]) == ["fast: hot.", "cold."]


class Announced:
    """A master of one drive, whose plan has one row."""

    def __init__(self, simulated=False, cycle="5 ms"):
        bus = {"simulated": True} if simulated else {"interface": "virtual", "channel": "x"}
        self.keys = HardwareKeys.model_validate({**bus, "nodes": {"a": node_keys()}, "cycle": cycle})
        self.stations = {"a": SimpleNamespace(name="a")}
        self.plan = lambda station: SimpleNamespace(node=station, writes=[SimpleNamespace(index=0x6083, sub=0)])
        self.asking = lambda station: nullcontext()


def test_what_a_run_writes_is_printed_once_for_a_hardware_file(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("TWIN_STATE", str(tmp_path))
    row = PlannedRow("6083h.0", "Profile acceleration", "1", "2", "limits.acceleration")
    monkeypatch.setattr(announcement, "planned_rows", lambda _: [row])
    texts = []
    for master in (
        Announced(simulated=True),
        Announced(),
        Announced(),
        Announced(cycle="10 ms"),
        Announced(cycle="10 ms"),
    ):
        announcement.announce(master)
        texts.append(capsys.readouterr().err)
    printed = (
        "a: a run writes 1 objects, and restores them at its end:\n"
        "  6083h.0 Profile acceleration: 1 -> 2 (limits.acceleration)\n"
    )
    assert texts == ["", printed, "", printed, ""]


@pytest.mark.parametrize(
    ("bus", "arm", "armed"),
    [
        ("simulated: true", False, True),
        ("interface: virtual\nchannel: x", False, True),
        ("interface: socketcan\nchannel: can0", False, False),
        ("interface: socketcan\nchannel: can0", True, True),
    ],
)
def test_a_dry_run_is_armed_where_no_current_can_flow(tmp_path, bus, arm, armed):
    path = tmp_path / "bench.yaml"
    path.write_text(
        f"{bus}\nnodes:\n  a: {{node: 1, profile: faulhaber_v3, safe_outputs: 0, units: {{acceleration: 1 mm/s^2}}}}\n"
    )
    made = load(path, arm=arm, dry=True)
    assert (made.armed, made.keys.simulated, made.arm) == (armed, True, False)
    if not armed:
        with pytest.raises(ScenarioError, match=r"a dry run sets the outputs of a to their safe levels"):
            made.apply(None)
    ordinary = load(path, arm=arm)
    assert type(ordinary) is Hardware
    assert (ordinary.arm, ordinary.wall_clock, ordinary.takes_faults) == (
        arm,
        "simulated" not in bus,
        "simulated" in bus,
    )
    with pytest.raises(SimulationError, match=r"^--replay run@x: expected FILE@SECONDS"):
        load(path, replay="run@x")
    if not ordinary.keys.is_software() and not arm:
        with pytest.raises(ScenarioError, match=r"socketcan can0 may move real drives\. Add --arm"):
            ordinary.apply(None)
