"""A rig behind an MQTT broker, in a process of its own: messages, a broker that dies and comes back, and what is refused."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time

import pytest

from tests.follow.test_live_processes import WAIT, saved, start, until, words
from twin.errors import SimulationError, TwinError
from twin.face import open_run
from twin.follow.publishing import Publisher
from twin.follow.schema import RigKeys, SourceKeys, topic_address
from twin.follow.sources import Message
from twin.follow.sources.topics import TopicSource

BROKER = """
import asyncio, sys
from amqtt.broker import Broker

async def serve():
    listener = {"type": "tcp", "bind": f"127.0.0.1:{sys.argv[1]}", "max_connections": 10}
    plugins = {
        "amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": sys.argv[2] == "open"},
        "amqtt.plugins.topic_checking.TopicTabooPlugin": {},
    }
    await Broker({"listeners": {"default": listener}, "plugins": plugins}).start()
    print("ready", flush=True)
    await asyncio.Event().wait()

asyncio.run(serve())
"""

__all__ = ["start"]  # a fixture


@pytest.fixture
def port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture
def broker(port):
    """Start a broker at the port; what still runs at the end is killed."""
    pytest.importorskip("amqtt")
    pytest.importorskip("paho")
    processes = []

    def started(access="open"):
        words = [sys.executable, "-c", BROKER, str(port), access]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        processes.append(process)
        assert process.stdout.readline() == "ready\n"
        return process

    yield started
    for process in processes:
        process.kill()
        process.communicate()


def source_of(port, topic="rig/+"):
    return TopicSource("rig", topic_address(f"127.0.0.1:{port}/{topic}", "mqtt"), "time")


def taken(source, count):
    messages = []
    until(lambda: messages.extend(source.receive(0.1)) or len(messages) >= count)
    return messages


def test_an_address_of_a_broker():
    assert SourceKeys(mqtt="mqtt://broker.local/rig/tip").mqtt == ("mqtt", "broker.local", 1883, "rig/tip")
    assert SourceKeys(mqtt="127.0.0.1:1884/rig/#").mqtt == ("mqtt", "127.0.0.1", 1884, "rig/#")
    for wrong in ("mqtt://broker", "mqtt://broker:0/rig", "mqtt://broker:99999/rig", "mqtt:///rig", "mqtt://b/a b"):
        with pytest.raises(ValueError, match=r"expected host and topic such as mqtt://127\.0\.0\.1:1883/rig, not mqtt"):
            SourceKeys(mqtt=wrong)
        with pytest.raises(TwinError, match=r"^--publish: expected host and topic"):
            Publisher(wrong)
    with pytest.raises(TwinError, match=r"^--publish: expected a topic without \+ and #, not rig/#\.$"):
        Publisher("mqtt://127.0.0.1/rig/#")
    assert SourceKeys(mqtt="b/+/a/#").mqtt == ("mqtt", "b", 1883, "+/a/#")
    for wrong in ("b/#/a", "b/a+", "b/a/b#"):
        with pytest.raises(ValueError, match=r"expected \+ as a whole level of a topic and # as its last one, not "):
            SourceKeys(mqtt=wrong)
    with pytest.raises(ValueError, match="expected one of udp, such as udp: 4710, mqtt or zenoh, "):
        SourceKeys(mqtt="127.0.0.1/rig", udp=4710)
    assert RigKeys.model_validate({"sources": {"a": {"mqtt": "b/c"}}}).sources["a"].mqtt == ("mqtt", "b", 1883, "c")


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "paho", None)
    monkeypatch.setitem(sys.modules, "paho.mqtt.client", None)
    with pytest.raises(TwinError, match=r"--publish: mqtt needs paho.*Run: pip install 'catheter-twin\[mqtt\]'\.$"):
        Publisher("mqtt://127.0.0.1/rig")


def test_a_broker_that_is_not_there_is_told(port):
    pytest.importorskip("paho")
    with pytest.raises(
        SimulationError,
        match=rf"^rig: the MQTT broker 127\.0\.0\.1:{port} cannot be used \(Connection refused\)\. Start it, or correct its address\.$",
    ):
        source_of(port)


@pytest.mark.slow
def test_a_broker_that_refuses_is_told(broker, port):
    broker("closed")
    with pytest.raises(SimulationError, match=rf"^rig: the MQTT broker 127\.0\.0\.1:{port} cannot be used \("):
        source_of(port)


@pytest.mark.slow
def test_a_topic_that_is_refused_is_told(broker, port):
    broker()
    source = source_of(port, "prohibited")
    try:
        (message,) = taken(source, 1)
    finally:
        source.close()
    assert message.connection.startswith(f"the broker 127.0.0.1:{port} refuses the topic prohibited (")


@pytest.mark.slow
def test_messages_of_a_broker_that_dies_and_comes_back(broker, port):
    first = broker()
    source, publisher = source_of(port), Publisher(f"mqtt://127.0.0.1:{port}/rig/tip")
    begin = time.monotonic()
    try:
        until(lambda: publisher.sender.send(b'{"time": 1, "tip": 0.5}') or source.receive(0.1))
        for data in (b'{"time": 2, "a": {"tip": 1}, "units": {"a.tip": "mm"}}', b"[1]", b"\xff", b"{"):
            publisher.sender.send(data)
        good, *bad = [message for message in taken(source, 4) if message.stamp != 1.0]
        assert good == Message("rig", good.arrival, 2.0, {"a.tip": 1.0}, {"a.tip": "mm"})
        assert begin < good.arrival <= time.monotonic()
        assert [message.problem for message in bad] == [
            "a message is no JSON object such as {'time': 1.25, 'tip': 0.1}",
            "a message is no JSON ('utf-8' codec can't decode byte 0xff in position 0)",
            "a message is no JSON (Expecting property name enclosed in double quotes)",
        ]
        first.kill()
        (lost,) = taken(source, 1)
        line = f"the connection to the broker 127.0.0.1:{port} is lost; trying again."
        assert lost == Message("rig", lost.arrival, connection=line)
        until(lambda: publisher.problems == [line])
        publisher.sender.send(b'{"tip": 3}')  # nothing takes it
        broker()
        until(
            lambda: (
                publisher.sender.send(b'{"tip": 4}') or any(one.values == {"tip": 4.0} for one in source.receive(0.1))
            )
        )
    finally:
        source.close()
        publisher.sender.close()


@pytest.mark.slow
@pytest.mark.real_time
def test_a_twin_follows_another_one_over_a_broker_that_dies(tmp_path, build, start, broker, port):
    address = f"mqtt://127.0.0.1:{port}/rig"
    publish, follow = [words(line, **{"udp://127.0.0.1:4710": address}) for line in saved(tmp_path) if "udp://" in line]
    rig_file = tmp_path / "rig.yaml"
    rig_file.write_text(rig_file.read_text().replace("20 s", "300 s"))
    first = broker()
    follower = start(*follow[: follow.index("--duration")], "--build", str(build))
    rig = start(*publish, "--build", str(build))
    rows = until(lambda: list(tmp_path.glob("runs/sheath/*/.recording/0.rows")))[0]

    def wait_for_measurements():
        size = rows.stat().st_size
        until(lambda: rows.stat().st_size > size + 20_000)  # a prediction each second is far less

    wait_for_measurements()
    first.kill()
    time.sleep(2.0)
    broker()
    wait_for_measurements()
    follower.send_signal(signal.SIGINT)
    out, errors = follower.communicate(timeout=WAIT)
    assert "sheath.play[3]" in out, errors
    rig.send_signal(signal.SIGINT)
    _, rig_errors = rig.communicate(timeout=WAIT)
    lines = errors.splitlines()
    lost = f"the connection to the broker 127.0.0.1:{port} is lost; trying again."
    assert lines.count(f"rig: {lost}") == 1
    assert sum(line.startswith("rig: no message for 1 s.") for line in lines) == 1
    assert sum(line.startswith("rig is back after") for line in lines) == 1
    summary = open_run(tmp_path / "runs" / "sheath" / "latest").summary
    assert summary["follow"]["measurements"] > 200
    run = json.loads(next((tmp_path / "runs" / "rig").glob("2*/summary.json")).read_text())
    assert any(f"--publish: {lost}" in note for note in run["notes"]), rig_errors
