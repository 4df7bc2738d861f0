"""A session on drives: simulated ones in the run, and one in a process of its own that keeps the time of the wall."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks import hil
from hw_bridge.dictionary import State, state_of
from hw_bridge.master import SdoClient
from hw_bridge.wire import WireNetwork
from tests.hw_bridge.multicast import needed, own
from tests.live.test_live import FILE, SPEED, same_bits, until
from twin.live import HOLD, LiveSession, RefusedError
from twin.results import list_recorded_variables, read_variables

SIMULATED = """simulated: true
cycle: 5 ms
nodes: {servomotor: {node: 1, profile: faulhaber_v3, watch_contact: false}}
"""
FAULTY = """extends: {base}
variants: {{delayed: {{events: [{{at: 1 ms, fault: delay, node: servomotor, delay: 6 ms, duration: 20 ms}}]}}}}
"""
WIRED = """interface: udp_multicast
channel: {channel}
options: {{port: {port}}}
cycle: 5 ms
nodes:
  servomotor: {{node: 1, profile: faulhaber_v3, units: {{acceleration: 1 mm/s^2}}, watch_contact: false, heartbeat: {{every: 20 ms, lost_after: 100 ms}}}}
"""
VELOCITY = "servomotor.velocity_actual_value"


@pytest.fixture
def channel(monkeypatch):
    """A multicast group and a port of this test alone: a socket hears every group that anybody has joined on its port."""
    monkeypatch.setattr(hil, "PORT", 44000 + os.getpid() % 10000)
    return needed(own(76), port=hil.PORT)


@pytest.mark.slow
def test_simulated_drives_are_operated_like_any_member(build, tmp_path):
    """With a fault of another variant, by hand."""
    bench, file = tmp_path / "bench.yaml", tmp_path / "carriage.yaml"
    bench.write_text(SIMULATED)
    file.write_text(FAULTY.format(base=os.path.relpath(FILE, tmp_path)))
    options = {"variant": "quiet", "build": build, "runs": tmp_path / "runs", "hardware": bench, "running": True}
    with LiveSession.start(file, **options) as live:
        assert (live.catalog.hardware, live.catalog.wall_clock) == (True, False)
        assert live.catalog.members["servomotor"] == "Servomotor"
        until(lambda: live.state.time > 0.05, "the drive")
        while live.state.time < 0.4:
            live.hold(SPEED, 0.01, round(live.state.time * 5))  # a new press now and then: the machine may be busy
            time.sleep(0.03)
        until(lambda: live.state.hardware and live.state.hardware["nodes"], "the drive")
        drive = live.state.hardware["nodes"]["servomotor"]
        assert (drive["state"], drive["mode"]) == ("Operation enabled", "cyclic synchronous velocity (csv)")
        assert drive["statusword"].startswith("Operation enabled; voltage")
        assert [one["name"] for one in drive["limits"]] == ["position", "velocity", "force", "following error"]
        assert all(0 <= one["part"] < 1 for one in drive["limits"])
        assert (live.state.hardware["armed"], live.state.hardware["control"]) == (False, "this session")
        (fault,) = [one for one in live.catalog.events if one.kind == "fault"]
        assert (fault.text, fault.own) == ("fault delay, node servomotor, delay 6 ms, duration 20 ms", False)
        live.trigger(fault.key)
        struck = live.state.time
        until(lambda: live.state.time > struck + 0.1, "a tenth of a second")
        drive = live.state.hardware["nodes"]["servomotor"]
        live.pause()
        folder = live.stop()
    assert drive["late"] + drive["lost"] > 0
    speeds = values(folder, VELOCITY)
    assert max(speeds) == pytest.approx(0.01, rel=0.3)  # told in steps of 4 mm/s
    text = (folder / "operated.yaml").read_text()
    assert "set: {'command.live_speed[1]': 0.01}" in text
    assert "fault: delay, node: servomotor, delay: 6 ms, duration: 20 ms}" in text
    same_bits_on(bench, folder, build, tmp_path)


def same_bits_on(bench, folder, build, root):
    from twin.run import load_hardware

    same_bits(folder, build, root / "again", load_hardware(bench, False, build))


def values(folder, name):
    found = list_recorded_variables(folder / "signals.parquet")
    (signals,) = read_variables(folder / "signals.parquet", [found[name]]).values()
    return signals.values[name]


def state(channel):
    """What a drive says of itself when it is asked."""
    network = WireNetwork("udp_multicast", channel, 1_000_000, hil.options("udp_multicast"))
    client = SdoClient(1, network.send, lambda duration, done: network.advance(network.now + duration, done))
    network.hear = lambda frame: client.process_frame(frame.data) if frame.id == 0x581 else None
    try:
        return state_of(int.from_bytes(client.read(0x6041), "little"))
    finally:
        network.close()


def bench_of(channel, tmp_path):
    path = tmp_path / "bench.yaml"
    path.write_text(WIRED.format(channel=channel, port=hil.PORT))
    return path


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.skipif(sys.platform != "linux", reason="multicast")
def test_a_drive_moves_while_it_is_held(channel, build, tmp_path):
    options = {"variant": "quiet", "build": build, "runs": tmp_path / "runs", "hardware": bench_of(channel, tmp_path)}
    with hil.drive("faulhaber_v3", "udp_multicast", channel, build), LiveSession.start(FILE, **options) as live:
        assert live.catalog.wall_clock
        assert state(channel) is State.DISABLED  # nothing moves before somebody says so
        for ask in (lambda: live.pace(2.0), live.step, live.step_macro):
            with pytest.raises(RefusedError, match="the drives determine the time"):
                ask()
        live.resume()
        until(lambda: live.state.time > 0.2, "the drive")
        for ask in (live.pause, live.reset, lambda: live.trigger("event_2"), lambda: live.override(VELOCITY, 0.1)):
            with pytest.raises(RefusedError, match="drives"):
                ask()
        with pytest.raises(RefusedError, match="moves only while held"):
            live.set("servomotor.target_position", 0.01)
        begin = time.monotonic()
        while time.monotonic() < begin + 0.6:
            live.hold(SPEED, 0.01, 1)
            time.sleep(0.03)
        lost = live.state.time
        until(lambda: not live.state.held, "rest")
        time.sleep(0.4)
        watched = live.state.hardware
        assert watched["nodes"]["servomotor"]["state"] == "Operation enabled"
        assert 0.02 < watched["bus_load"] < 0.5
        assert watched["cycles"] > 200
        folder = live.stop()
        assert state(channel) is State.DISABLED
    speeds, times = values(folder, VELOCITY), values(folder, "command.catheter_velocity")
    assert max(speeds) == pytest.approx(0.01, rel=0.5)
    # the command is at rest 0.2 s after the last renewal and its own ramp, 10 mm/s at 0.1 m/s^2
    ends = max(k for k, one in enumerate(times) if abs(one) > 1e-9) * 1e-3
    assert ends - lost < 0.2 + 0.1
    assert ends - lost > HOLD - 0.1


SHOWS = """
import sys, time
from twin.live import LiveSession
if __name__ == "__main__":
    live = LiveSession.start(sys.argv[1], variant="quiet", runs=sys.argv[2], build=sys.argv[3], hardware=sys.argv[4], running=True)
    while live.state.time < 0.1:
        time.sleep(0.01)
    print(live.state.folder, flush=True)
    while True:
        live.hold("command.live_speed[1]", 0.01, 1)
        time.sleep(0.03)
"""


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.skipif(sys.platform != "linux", reason="multicast")
def test_the_drive_stops_when_who_shows_the_session_is_killed(channel, build, tmp_path):
    bench = bench_of(channel, tmp_path)
    line = [sys.executable, "-c", SHOWS, FILE, tmp_path / "runs", build, bench]
    with hil.drive("faulhaber_v3", "udp_multicast", channel, build):
        with subprocess.Popen(line, stdout=-1, text=True) as shows:
            folder = Path(shows.stdout.readline().strip())
            time.sleep(0.5)
            shows.send_signal(signal.SIGKILL)
        until((folder / "summary.json").exists, "the summary")
        assert state(channel) is State.DISABLED
    assert max(values(folder, VELOCITY)) == pytest.approx(0.01, rel=0.5)
