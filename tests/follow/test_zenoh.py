"""A rig behind a Zenoh router: messages, a router that goes away and comes back, and what is refused."""

from __future__ import annotations

import json
import socket
import sys

import pytest

from tests.follow.test_live_processes import until
from twin.errors import SimulationError, TwinError
from twin.follow.publishing import Publisher
from twin.follow.schema import SourceKeys, topic_address, with_sources
from twin.follow.sources import Message
from twin.follow.sources.topics import TopicSource


@pytest.fixture
def port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture
def router(port):
    """Start a router at the port; what still runs at the end is closed."""
    zenoh = pytest.importorskip("zenoh")
    config = zenoh.Config()
    for key, value in (
        ("mode", "router"),
        ("listen/endpoints", [f"tcp/127.0.0.1:{port}"]),
        ("scouting/multicast/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    sessions = []

    def started():
        sessions.append(zenoh.open(config))
        return sessions[-1]

    yield started
    for session in sessions:
        session.close()


def source_of(port, key="rig/*"):
    return TopicSource("rig", topic_address(f"127.0.0.1:{port}/{key}", "zenoh"), "time")


def test_an_address_of_a_router():
    assert SourceKeys(zenoh="router.local/rig/**").zenoh == ("zenoh", "router.local", 7447, "rig/**")
    (source,) = with_sources("zenoh://127.0.0.1:7448/rig")["sources"].values()
    assert source == {"zenoh": ("zenoh", "127.0.0.1", 7448, "rig")}
    with pytest.raises(
        ValueError, match=r"expected host and topic such as zenoh://127\.0\.0\.1:7447/rig, not zenoh://a"
    ):
        SourceKeys(zenoh="zenoh://a")
    with pytest.raises(TwinError, match=r"^--publish: expected a topic without \* and \$, not rig/\*\.$"):
        Publisher("zenoh://127.0.0.1/rig/*")


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(TwinError, match=r"--publish: zenoh needs zenoh.*Run: pip install 'catheter-twin\[zenoh\]'\.$"):
        Publisher("zenoh://127.0.0.1/rig")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "reason"), [("rig", "Unable to connect to any of .*"), ("a//b", "Invalid Key Expr `a//b`: .*")]
)
def test_what_cannot_be_used_is_told_in_one_line(key, reason, port):
    pytest.importorskip("zenoh")
    with pytest.raises(
        SimulationError,
        match=rf"^rig: the Zenoh router 127\.0\.0\.1:{port} cannot be used \({reason}\)\. Start it, or correct its address\.$",
    ) as caught:
        source_of(port, key)
    assert ".rs" not in str(caught.value)


@pytest.mark.slow
def test_messages_of_a_router_that_goes_away_and_comes_back(router, port):
    first = router()
    source, publisher = source_of(port), Publisher(f"zenoh://127.0.0.1:{port}/rig/tip")
    try:
        until(lambda: publisher.sender.send(b'{"time": 1, "tip": 0.5}') or source.receive(0.1))
        publisher.sender.send(b'{"time": 2, "a": {"tip": 1}, "units": {"a.tip": "mm"}}')
        publisher.sender.send(b"[1]")
        messages = []
        until(lambda: messages.extend(source.receive(0.1)) or any(message.problem for message in messages))
        good, bad = messages[-2:]
        assert good == Message("rig", good.arrival, 2.0, {"a.tip": 1.0}, {"a.tip": "mm"})
        assert bad.problem.startswith("a message is no JSON object")
        first.close()
        lost = until(lambda: source.receive(0.1))[0]
        line = f"the connection to the router 127.0.0.1:{port} is lost; trying again."
        assert lost == Message("rig", lost.arrival, connection=line)
        until(lambda: publisher.problems == [line])
        publisher.sender.send(b'{"tip": 3}')  # nothing takes it
        router()
        until(
            lambda: (
                publisher.sender.send(b'{"tip": 4}') or any(one.values == {"tip": 4.0} for one in source.receive(0.1))
            )
        )
    finally:
        source.close()
        publisher.sender.close()
