"""A recorded run: traces of the same run are the same, and its drives can be put back into the scenario."""

from pathlib import Path

import numpy as np
import pytest
from fmus.servomotor.model import Servomotor

from hw_bridge.bridge.entry import load
from hw_bridge.bridge.replay import Replay, replay
from hw_bridge.plant import start_position
from hw_bridge.wire import read
from tests.hw_bridge.axis import Rig
from tests.hw_bridge.bridge.test_bridge import NODES
from tests.matrix import covering
from twin.errors import SimulationError

SHOWN = ("position_actual_value", "velocity_actual_value", "current", "force")


class Traced(Rig):
    """A rig whose bus is recorded."""

    def __init__(self, build, nodes, path):
        super().__init__(build, nodes)
        self.session.trace = path
        self.hardware.trace = path


def drive(rig, milliseconds=400):
    """Move, and keep what is known from the bus after each step: a simulated motor tells its true current itself."""
    seen = []
    for step in range(milliseconds):
        rig.set(target_velocity=0.03 if step % 200 < 100 else -0.02, load_force=-2.0)
        rig.go(1)
        node = rig.master.nodes["servomotor"]
        seen.append([*(rig.get(name) for name in SHOWN[:2]), node.current, node.force])
    rig.axis.close()
    return seen


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "name"), covering([".blf", ".asc", ".log"], NODES))
def test_a_recorded_drive_shows_what_the_drive_showed(build, tmp_path, suffix, name):
    """Each value at the same step; to the bit, but for the screw's factor."""
    rig = Traced(build, {"servomotor": NODES[name] | {"inverted": name == "mclm"}}, tmp_path / f"run{suffix}")
    wanted = drive(rig)
    again = Replay(Path("bench.yaml"), rig.hardware.keys, rig.session.trace)
    assert again.recording.zero == pytest.approx(rig.session.origin, abs=2000)  # the file holds microseconds
    axis = again._component("servomotor", Servomotor)()
    axis.start()
    for step, values in enumerate(wanted):
        axis.advance(step / 1000, 1e-3)
        assert [float(axis.views[one]) for one in SHOWN] == pytest.approx(values, rel=1e-12, abs=1e-12), step
    assert int(axis.views["statusword"]) & 0x6F == 0x27
    assert float(axis.views["position"]) == float(axis.views["position_actual_value"])
    assert float(axis.views["overload"]) != float(axis.views["overload"])  # not in the trace
    axis.close()
    assert "from 0.4" in (text := again.report()["shown"][0]) or "from 0.5" in text


@pytest.mark.parametrize("outputs", [("motor_angle", "torque", "force", "limited"), ("position",)])
def test_values_that_follow_from_those_of_a_trace(build, tmp_path, outputs):
    """By scale and force constant; what the member does not have as an output is left out."""
    keys = {**NODES["faulhaber_v3"], "scale": 0.5, "force_constant": "4 N/A"}
    rig = Traced(build, {"servomotor": keys}, tmp_path / "run.log")
    drive(rig, 40)
    axis = Replay(Path("bench.yaml"), rig.hardware.keys, rig.session.trace)._component("servomotor", Servomotor)()
    track = axis._track
    axis.start()
    axis.views = {name: np.zeros(()) for name in outputs}
    for name, value in (("statusword", 0x0A27), ("current", 0.5)):
        track.values[name] = [value] * len(track.values[name])
    axis.advance(0.1, 1e-3)
    position = track.at("position_actual_value", 2**62) + start_position(axis) - track.home
    wanted = {
        "position": position,
        "motor_angle": position / 0.5,
        "force": 2.0,
        "torque": 1.0,
        "limited": 1.0,
    }
    assert {name: float(view) for name, view in axis.views.items()} == pytest.approx(
        {name: wanted[name] for name in outputs}
    )


@pytest.mark.slow
@pytest.mark.parametrize("inverted", [False, True])
def test_a_drive_that_was_homed_shows_its_positions(build, tmp_path, inverted):
    """They count from where homing says, on the way back from the end stop, too."""
    homing = {"method": -4 if inverted else -3, "at": "-40 mm", "speed": "80 mm/s"}
    keys = {**NODES["faulhaber_v3"], "inverted": inverted, "homing": homing}
    rig = Traced(build, {"servomotor": keys}, tmp_path / "run.blf")
    wanted = drive(rig, 50)
    axis = Replay(Path("bench.yaml"), rig.hardware.keys, rig.session.trace, rig.session.origin / 1e9)._component(
        "servomotor", Servomotor
    )()
    axis.start()
    for step, values in enumerate(wanted):
        axis.advance(step / 1000, 1e-3)
        assert axis.views["position_actual_value"] == pytest.approx(values[0], abs=1e-9), step


@pytest.mark.slow
def test_the_same_run_gives_the_same_file(build, tmp_path):
    paths = [tmp_path / f"{number}.blf" for number in range(2)]
    for path in paths:
        drive(Traced(build, {"servomotor": NODES["faulhaber_v3"]}, path), 50)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_report_names_the_trace(build, tmp_path):
    rig = Traced(build, {"servomotor": NODES["faulhaber_v3"]}, tmp_path / "run.log")
    drive(rig, 20)
    frames = list(read(tmp_path / "run.log"))
    assert rig.session.report()["frames"] == len(frames)
    assert f"run.log: {len(frames)} frames" in "\n".join(rig.hardware.report()["shown"])
    assert rig.hardware._trace() == tmp_path / "run-2.log"


def test_another_beginning(build, tmp_path):
    rig = Traced(build, {"servomotor": NODES["faulhaber_v3"]}, tmp_path / "run.blf")
    drive(rig, 20)
    found = replay(Path("b"), rig.hardware.keys, f"{tmp_path}/run.blf@0.25")
    assert found.recording.zero == 250_000_000
    with pytest.raises(SimulationError, match="expected FILE@SECONDS"):
        replay(Path("b"), rig.hardware.keys, f"{tmp_path}/run.blf@soon")


@pytest.mark.slow
def test_a_trace_of_other_drives(build, tmp_path):
    rig = Traced(build, {"servomotor": NODES["faulhaber_v3"]}, tmp_path / "run.blf")
    drive(rig, 20)
    bench = tmp_path / "bench.yaml"
    bench.write_text("simulated: true\nnodes: {servomotor: {node: 9, profile: mclm}}\n")
    with pytest.raises(SimulationError, match=r"says nothing of servomotor's position \(node 9\)"):
        load(bench, replay=str(tmp_path / "run.blf"))


def test_a_real_interface_is_observed_both_ways():
    """What is sent and what is heard, in the order of time; an interface that echoes does not count twice."""
    import can

    from hw_bridge.bus import Frame
    from hw_bridge.wire import WireNetwork

    network = WireNetwork("virtual", "observed", 1_000_000, {})
    seen = []
    network.observe(lambda time, frame: seen.append((time, frame)))
    try:
        with can.Bus("observed", interface="virtual") as other:
            network.send(Frame(0x080))
            other.send(can.Message(arbitration_id=0x181, data=[1], is_extended_id=False))
            other.send(can.Message(is_error_frame=True))
            network.advance(network.now + 50_000_000)
            network._echoes = True
            network.send(Frame(0x201))
            for identifier in (0x201, 0x080):  # an echo, and another master's SYNC
                other.send(can.Message(arbitration_id=identifier, is_extended_id=False))
            network.advance(network.now + 50_000_000)
    finally:
        network.close()
    assert [frame for _, frame in seen] == [Frame(0x080), Frame(0x181, b"\1"), None, Frame(0x201), Frame(0x080)]
    assert [time for time, _ in seen] == sorted(time for time, _ in seen)


@pytest.mark.slow
def test_frames_out_of_order_are_refused(build, tmp_path):
    rig = Traced(build, {"servomotor": NODES["faulhaber_v3"]}, tmp_path / "run.log")
    drive(rig, 50)
    lines = (tmp_path / "run.log").read_text().splitlines(keepends=True)
    (tmp_path / "run.log").write_text("".join([*lines[500:], *lines[:500]]))
    with pytest.raises(SimulationError, match=r"run\.log: frame \d+ is [\d.]+ s earlier than the one before"):
        replay(tmp_path / "bench.yaml", rig.hardware.keys, str(tmp_path / "run.log"))
