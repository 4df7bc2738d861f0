"""The page's socket without a page: who may, what is refused, and that nothing that is sent does harm."""

import json

import pytest

from hw_bridge import eds
from hw_bridge.profiles import profile
from tests.console.served import CARRIAGE, console

INPUT = "command.live_speed[1]"
HOSTILE = {
    "": "not JSON",
    "[]": "expected one of",
    "{}": "expected one of",
    '{"hold": 1, "stop": true}': "expected one of",
    '{"hold": 1}': "is not a control",
    '{"hold": {"a": 1}}': "is not a control",
    f'{{"hold": "{INPUT}", "at": NaN, "press": 1, "tick": 1}}': "is not a number",
    f'{{"hold": "{INPUT}", "at": 1e999, "press": 1, "tick": 1}}': "from -1 to 1",
    f'{{"hold": "{INPUT}", "at": 1.01, "press": 1, "tick": 1}}': "from -1 to 1",
    f'{{"hold": "{INPUT}", "at": "1", "press": 1, "tick": 1}}': "from -1 to 1",
    f'{{"hold": "{INPUT}", "at": true, "press": 1, "tick": 1}}': "from -1 to 1",
    f'{{"hold": "{INPUT}", "at": 1, "press": 1.5, "tick": 1}}': "press: expected a whole number",
    f'{{"hold": "{INPUT}", "at": 1, "press": 1, "tick": []}}': "tick: expected a whole number",
    '{"watch": "servomotor.position"}': "expected up to",
    '{"watch": [1]}': "expected up to",
    '{"watch": ["../../etc/passwd"]}': "is not recorded",
    '{"release_hold": 5}': "is not a control",
    '{"stop": 1}': "expected true",
    "[" * 5000: "not JSON",
}


@pytest.fixture(scope="module")
def served(tmp_path_factory, build):
    with console(CARRIAGE, "--variant", "quiet", runs=tmp_path_factory.mktemp("runs"), build=build) as one:
        yield one


@pytest.mark.slow
def test_hands_and_eyes(served):
    with served.wire() as operator, served.wire() as watcher:
        tick = operator.ready()
        assert tick["operator"]
        assert not watcher.ready()["operator"]
        watcher.say(watch=["servomotor.position"])
        assert watcher.hear(lambda told: told.get("values"))["values"] == {"servomotor.position": 0.0}
        for message in (
            {"hold": INPUT, "at": 1, "press": 1, "tick": 1},
            {"release_hold": ""},
            {"here": True, "tick": 1},
        ):
            watcher.say(**message)
            assert watcher.refused() == "This page only watches: another page operates."
        for message, wrong in (({"here": 1, "tick": 1}, "expected true"), ({"here": True}, "tick: expected a whole")):
            operator.say(**message)
            assert wrong in operator.refused()
        operator.say(hold=INPUT, at=1, press=1, tick=10**6)  # a tick that was never sent
        operator.say(hold=INPUT, at=1, press=2, tick=1)  # one from long ago
        assert not operator.hear(lambda told: told.get("tick", 0) > tick["tick"] + 9)["held"]
        for _ in range(5):
            tick = operator.hear(lambda told: "tick" in told)
            operator.say(hold=INPUT, at=0.55, press=3, tick=tick["tick"])
        assert not operator.hear(lambda told: told.get("tick", 0) > tick["tick"] + 9)["held"]  # it is paused
        operator.say(release_hold="")
        operator.hear(lambda told: "tick" in told and not told["held"], timeout=5)


@pytest.mark.slow
def test_a_seat_that_is_left_is_free(served):
    with served.wire() as first:
        first.hear(lambda told: told.get("operator"), timeout=5)
    with served.wire() as next_one:
        next_one.hear(lambda told: told.get("operator"), timeout=5)


@pytest.mark.slow
def test_hostile_messages_are_told_off_and_then_sent_away(served):
    with served.wire() as wire:
        wire.ready()
        for message, wrong in HOSTILE.items():
            wire.socket.send(message)
            assert wrong in wire.refused(), message
        wire.socket.send("x" * 9000)
        with pytest.raises(Exception, match="1008"):
            while True:
                wire.hear(timeout=5)
    with served.wire() as other:
        assert other.ready()["phase"] == "paused"


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"\x00\xff" * 10, "x" * 200_000])
def test_what_is_no_message_ends_the_socket_alone(served, content):
    with served.wire() as wire, pytest.raises(Exception, match=r"10\d\d|close"):
        wire.socket.send(content)
        while True:
            wire.hear(timeout=5)
    assert served.get()[0] == 200


@pytest.mark.slow
def test_only_with_the_token_and_from_its_own_page(served):
    for path in (
        "/",
        "/data?name=servomotor.position",
        "/web/chart.js",
        "/_nicegui_ws/socket.io/?EIO=4&transport=polling",
    ):
        assert served.get(path, token=False)[0] == 403
    assert served.get("/", Origin="http://evil.example")[0] == 403
    assert served.get("/", Host="evil.example")[0] == 403
    with pytest.raises(Exception, match="403"), served.wire("00000000-0000-0000-0000-000000000000"):
        pass


@pytest.mark.slow
def test_charts_ask_for_what_there_is(served):
    with served.wire() as wire:
        wire.ready()
    assert served.get("/data?name=servomotor.nothing")[0] == 400
    assert served.get("/data?name=servomotor.position&points=1e9")[0] == 400


@pytest.mark.slow
def test_anybody_may_stop_and_the_end_is_told(tmp_path, build):
    with console(CARRIAGE, "--variant", "quiet", runs=tmp_path / "runs", build=build) as served:
        with served.wire() as operator, served.wire() as watcher:
            operator.ready()
            watcher.say(stop=True)
            operator.hear(lambda told: told.get("phase") == "stopped", timeout=20)
        served.process.send_signal(2)
        said, problems = served.process.communicate(timeout=20)
    assert said.splitlines()[0] == "The console is closed."
    assert said.splitlines()[1].startswith("results: ")
    assert (problems, served.process.returncode) == ("", 0)
    assert (
        json.loads((next((tmp_path / "runs").glob("*/2*")) / "summary.json").read_text())["scenario"]["name"]
        == "carriage"
    )


@pytest.mark.slow
def test_the_page_is_there_beside_a_drive_with_an_eds_file(tmp_path, build):
    """canopen, which reads the file, leaves an object whose class NiceGUI could not look at."""
    (tmp_path / "drive.eds").write_text(eds.export(profile("faulhaber_v3")))
    bench = tmp_path / "bench.yaml"
    bench.write_text("simulated: true\nnodes:\n  servomotor: {node: 1, profile: faulhaber_v3, eds: drive.eds}\n")
    with console(CARRIAGE, "--variant", "quiet", "--hardware", bench, runs=tmp_path / "runs", build=build) as served:
        assert served.get()[0] == 200
