"""Parameters that 1010h stored are in a file, and hold when the drive is switched on again."""

import json
import subprocess
import sys

import canopen
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hw_bridge import eds
from hw_bridge.device import Store
from hw_bridge.device.storage import LOAD, SAVE
from hw_bridge.dictionary import Code
from hw_bridge.profiles import profile
from tests.hw_bridge.bench import NODE, AbortedError, Bench
from tests.hw_bridge.multicast import PORT, needed, own
from tests.hw_bridge.waiting import wait_for_node
from twin.errors import DeclarationError

KEPT = 0x1017  # an object that all profiles have


@pytest.fixture
def power_on(make, name, tmp_path):
    """A drive of each profile that is switched on, with its memory in a file."""

    def power_on(path=tmp_path / "memory.json"):
        bench = make(name)
        bench.drive.remember(Store(path, name, NODE))
        bench.go(110)
        return bench

    return power_on


def test_what_was_stored_holds_after_power_on(power_on, tmp_path):
    first = power_on()
    first.write(KEPT, 70)
    first.write(0x6083, 1234)
    first.write(0x1800, 2, 2)
    first.write(0x1010, SAVE, 1)
    first.write(KEPT, 80)
    again = power_on()
    assert (again.read(KEPT), again.read(0x6083), again.read(0x1800, 2)) == (70, 1234, 2)
    assert again.drive.tpdos[0].kind == 2
    assert (
        sum(line.strip().startswith('{"object"') for line in (tmp_path / "memory.json").read_text().splitlines()) > 20
    )


def test_what_was_not_stored_is_gone(power_on):
    power_on().write(KEPT, 70)
    assert power_on().read(KEPT) == 0


def test_restored_defaults_hold_after_power_on(power_on):
    first = power_on()
    first.write(KEPT, 70)
    first.write(0x1010, SAVE, 1)
    first.write(0x1011, LOAD, 1)
    assert power_on().read(KEPT) == 0


def test_a_file_that_cannot_be_written_is_told_to_the_master(power_on, tmp_path):
    (tmp_path / "there").mkdir()
    bench = power_on(tmp_path / "there" / "memory.json")
    bench.write(KEPT, 70)
    (tmp_path / "there").rmdir()
    (tmp_path / "there").write_text("no folder")
    with pytest.raises(AbortedError) as caught:
        bench.write(0x1010, SAVE, 1)
    assert caught.value.code is Code.HARDWARE
    assert bench.drive.storage.saved == {}


def whole(objects, **more):
    return json.dumps({"profile": "epos4", "node": NODE, "objects": objects, **more})


WRONG = {
    "text": ("hello", "is no memory of a simulated drive; it was left as it is."),
    "other JSON": ("[1, 2]", "is no memory of a simulated drive"),
    "nothing": ("", "is no memory of a simulated drive"),
    "bytes": ("\0\udcff", "is no memory of a simulated drive"),
    "other profile": (
        whole([], profile="mclm"),
        "is the memory of profile mclm, not epos4. Name another file or --profile.",
    ),
    "other node": (whole([], node=4), "is the memory of node 4, not 3. Name another file or --node."),
    "unknown object": (whole([{"object": "9999h.0", "value": 1}]), "epos4 has no object '9999h.0'. Remove its line."),
    "no object": (whole([{"object": 7, "value": 1}]), "epos4 has no object 7."),
    "wrong kind": (whole([{"object": "1017h.0", "value": "x"}]), "1017h.0 cannot be 'x': UNSIGNED16"),
    "truth": (whole([{"object": "1017h.0", "value": True}]), "1017h.0 cannot be True"),
    "too large": (whole([{"object": "1017h.0", "value": 65536}]), "1017h.0 cannot be 65536"),
    "read only": (whole([{"object": "6041h.0", "value": 1}]), "6041h.0 cannot be 1: UNSIGNED16, access ro."),
    "no such mode": (whole([{"object": "6060h.0", "value": 5}]), "6060h.0 cannot be 5"),
    "no such mapping": (
        whole([{"object": "1600h.1", "value": 0x99990020}, {"object": "1600h.0", "value": 1}]),
        "what is stored does not fit together (06020000 no object). Remove the file to begin anew.",
    ),
}


@pytest.mark.parametrize("which", WRONG)
def test_a_file_that_is_no_memory_is_refused_and_left(make, tmp_path, which):
    text, message = WRONG[which]
    path = tmp_path / "memory.json"
    path.write_text(text, errors="surrogateescape")
    before = path.read_bytes()
    with pytest.raises(DeclarationError) as caught:
        make("epos4").drive.remember(Store(path, "epos4", NODE))
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before


def test_places_that_cannot_be_a_file(make, tmp_path):
    for path, message in ((tmp_path / "no" / "memory.json", "there is no folder"), (tmp_path, "cannot be read")):
        with pytest.raises(DeclarationError, match=message):
            make("epos4").drive.remember(Store(path, "epos4", NODE))


@pytest.mark.slow
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_value_is_taken_or_refused_in_one_line(build, tmp_path, data):
    """Whatever stands in the file: the drive runs with it for a while, or says why not."""
    entries = [entry for entry in profile("epos4").objects if entry.access == "rw"]
    rows = [
        {"object": f"{entry.index:04X}h.{entry.sub}", "value": data.draw(st.integers(-5, 2**33) | st.integers(0, 300))}
        for entry in data.draw(st.lists(st.sampled_from(entries), max_size=6))
    ]
    path = tmp_path / "memory.json"
    path.write_text(whole(rows))
    bench, refused = Bench("epos4", build), ""
    try:
        bench.drive.remember(Store(path, "epos4", NODE))
    except DeclarationError as error:
        refused = str(error)
    assert refused.startswith(f"{path}: " if refused else "")
    if not refused:
        bench.go(120)
        bench.send(0, [1, NODE])
        bench.go(20)


@pytest.mark.slow
def test_two_runs_of_the_process(tmp_path, build):
    channel = needed(own(78), port=PORT)
    path = tmp_path / "mclm.eds"
    path.write_text(eds.export(profile("mclm")))
    line = [
        sys.executable,
        "-m",
        "hw_bridge.drive",
        "-p",
        "mclm",
        "-n",
        str(NODE),
        "-i",
        "udp_multicast",
        "-c",
        channel,
        "--option",
        f"port={PORT}",
        "--build",
        str(build),
        "--store",
        str(tmp_path / "memory.json"),
    ]
    network = canopen.Network()
    network.connect(channel=channel, interface="udp_multicast", port=PORT)
    found = []
    try:
        node = network.add_node(NODE, str(path))
        for run in range(2):
            process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
            try:
                assert "node 3" in process.stdout.readline()
                wait_for_node(node)
                found.append(node.sdo[0x6083].raw)
                if run == 0:
                    node.sdo[0x6083].raw = 777
                    node.sdo[0x1010][1].raw = SAVE
            finally:
                process.terminate()
                process.communicate(timeout=20)
    finally:
        network.disconnect()
    assert found == [30000, 777]
