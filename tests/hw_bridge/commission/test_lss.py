"""Node-ID by identity, on drives in simulated time that have LSS."""

import struct
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.command import hil
from hw_bridge.commission import BOOT, SdoSession, lss, scan
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import State, cia301
from hw_bridge.profiles import profile
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

BIT_TIMING = 0x13
V3, EPOS4 = lss.Identity(327, 11601, 1, 1), lss.Identity(0xFB, 0x61500000, 0x01700000, 1)


@pytest.fixture
def line(build, monkeypatch):
    """Two drives of different vendors; nobody sleeps between two requests."""
    monkeypatch.setattr("canopen.lss.time.sleep", lambda _: None)
    bus = Bus()
    for number, name in ((1, "faulhaber_v3"), (3, "epos4")):
        bus.attach(Drive(profile(name), number, Motor(profile(name).motor, build=build)))
    found = SdoSession(SimulatedNetwork(bus))
    found.wait(BOOT)
    return found


def test_the_one_of_this_identity_gets_another_node_id(line):
    assert lss.configure(line, V3, 17, None) == (V3, 1)
    assert [(one.node, one.title) for one in scan(line)] == [
        (3, "maxon EPOS4"),
        (17, "FAULHABER Motion Control V3.0"),
    ]
    node = line.drive("17")
    assert node.sdo.number(0x1400, 1) == 0x200 + 17  # what depends on it goes along
    assert lss.configure(line, EPOS4, None, 500_000) == (EPOS4, 3)


def test_a_device_that_a_killed_program_had_selected_is_released_first(line):
    with lss.selected(line, EPOS4):
        assert lss.configure(line, V3, 17, None) == (V3, 1)
    assert [one.node for one in scan(line)] == [3, 17]


def test_a_node_id_that_is_taken(line):
    with pytest.raises(SimulationError, match="node 3 is on the bus already"):
        lss.configure(line, V3, 3, None)


@pytest.mark.parametrize("asked", ["its own", "that of the other"])
def test_a_node_in_nmt_stopped_takes_no_sdo_but_is_there(line, asked):
    """It may move: its own node-ID stays, and no other device gets it."""
    node = line.drive("1")
    node.sdo.write(0x1017, 0, struct.pack("<H", 50))
    line.nmt(cia301.STOP, 1)
    identity, wanted, text = {
        "its own": (V3, 17, "node 1 is in NMT Stopped: whether it moves is not known"),
        "that of the other": (EPOS4, 1, "node 1 is on the bus already"),
    }[asked]
    line.wait(BOOT)
    with pytest.raises(SimulationError, match=text):
        lss.configure(line, identity, wanted, None)


def test_nobody_of_this_identity(line):
    with pytest.raises(SimulationError, match=r"serial 2h: .*Is it on the bus"):
        lss.configure(line, V3._replace(serial=2), 5, None)
    assert [one.node for one in scan(line)] == [1, 3]


def test_a_bit_rate_that_the_table_of_cia_305_has_not(line):
    """Row 5 of it, once 100 kbit/s, is reserved: a device may take it for anything."""
    requests = []
    line.network.observe(lambda _, frame: requests.append(frame.id))
    with pytest.raises(SimulationError, match=r"no bit rate 100000\. LSS has 1000000, .*125000, 50000, 20000, 10000"):
        lss.configure(line, V3, None, 100_000)
    assert requests == []


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("bit_rate", "row"), [(1_000_000, 0), (125_000, 4), (50_000, 6), (10_000, 8)])
def test_rows_of_the_table_of_bit_timings(line, bit_rate, row):
    requests = []
    line.network.observe(lambda _, frame: requests.append(bytes(frame.data)))
    lss.configure(line, V3, None, bit_rate)
    assert next(data[2] for data in requests if data[0] == BIT_TIMING) == row


def test_a_node_id_that_there_is_not(line):
    with pytest.raises(SimulationError, match="LSS Error: 1"), lss.selected(line, V3) as master:
        master.configure_node_id(200)
    assert [one.node for one in scan(line)] == [1, 3]


def test_without_an_identity_only_one_may_be_there(line):
    """All devices would get the same node-ID."""
    with pytest.raises(SimulationError, match="several devices answer: name one by its identity"):
        lss.configure(line, None, 17, None)
    assert [one.node for one in scan(line)] == [1, 3]


def delay_answers(line, number, time, commands=None):
    """Let a drive answer requests of LSS, or some of them, later by a time [ns]."""
    drive = next(port.station for port in line.network.bus._ports if getattr(port.station, "node", 0) == number)
    answer = drive.lss._answer

    def later(*data):
        if commands is None or data[0] in commands:
            queue = drive.port.event_queue
            queue.at(queue.now + time, lambda: answer(*data))
        else:
            answer(*data)

    drive.lss._answer = later


@pytest.mark.parametrize("delay", [1, 11, 60, 400])
def test_without_an_identity_also_a_slow_device_is_heard(line, delay):
    """[ms]. Both would store the same node-ID."""
    delay_answers(line, 3, delay * 1_000_000)
    with pytest.raises(SimulationError, match="LSS: the only device on the bus: "):
        lss.configure(line, None, 17, None)
    line.nmt(0x82, 0)
    line.wait(BOOT)
    assert [one.node for one in scan(line)] == [1, 3]


def test_a_device_may_take_seconds_to_store(line):
    delay_answers(line, 1, 2_000_000_000, (0x17,))
    assert lss.configure(line, V3, 17, None) == (V3, 1)


@pytest.mark.slow
def test_only_the_device_itself_is_reset(line, build):
    """Also where it had no node-ID: it begins by itself."""
    commands = []
    line.network.observe(lambda _, frame: commands.append(tuple(frame.data)) if frame.id == 0 else None)
    chosen = profile("mclm")
    line.network.bus.attach(Drive(chosen, 255, Motor(chosen.motor, build=build)))
    mclm = lss.Identity(*(int(one.default) for one in chosen.objects if one.index == 0x1018 and one.sub))
    line.wait(BOOT)
    assert [one.node for one in scan(line)] == [1, 3]
    lss.configure(line, mclm, 5, None)
    assert commands == []
    assert [one.node for one in scan(line)] == [1, 3, 5]
    lss.configure(line, V3, 17, None)
    assert commands == [(130, 1)]
    assert [one.node for one in scan(line)] == [3, 5, 17]


def test_the_command(build):
    bench = "hw_bridge/benches/simulated_force.yaml"

    def run(*words):
        return CliRunner().invoke(hil.command, ["lss", *words, "-f", bench, "--build", str(build)])

    assert "node 1." in run().output
    done = run("--node-id", "9")
    assert done.exit_code == 0, done.output
    assert "It is node 9 now" in done.output
    assert "Name all of" in run("--vendor", "327").output
    assert "LSS has 1000000" in str(run("--new-bitrate", "123").exception)
    assert "expected a number" in run("--vendor", "x").output


@pytest.mark.parametrize(
    ("before", "node", "bit_rate", "expected"),
    [
        (1, 17, None, [("id", 17), "store", "waiting", ("nmt", 130, 1)]),
        (127, 17, 500_000, [("id", 17), ("timing", 2), "store", "waiting", ("nmt", 130, 127)]),
        (255, 17, None, [("id", 17), "store", "waiting"]),  # it begins by itself
        (0, 17, None, [("id", 17), "store", "waiting"]),
        (5, None, 20_000, [("timing", 7), "store", "waiting"]),
        (5, None, None, ["waiting"]),
    ],
)
def test_steps_of_a_configuration(monkeypatch, before, node, bit_rate, expected):
    """Node-ID, bit rate, then they are stored; at last the device alone starts its communication anew."""
    calls = []
    master = SimpleNamespace(
        send_switch_state_global=lambda state: calls.append("waiting") if state == 0 else None,
        inquire_lss_address=lambda part: part,
        inquire_node_id=lambda: before,
        configure_node_id=lambda number: calls.append(("id", number)),
        configure_bit_timing=lambda row: calls.append(("timing", row)),
        store_configuration=lambda: calls.append("store"),
    )
    masters = type("Masters", (), {"CONFIGURATION_STATE": 1, "WAITING_STATE": 0, "__new__": lambda _: master})
    monkeypatch.setattr(lss, "LssMaster", masters)
    monkeypatch.setattr(lss, "Carrier", lambda *_: None)
    monkeypatch.setattr(lss, "answers", lambda session, number: False)
    monkeypatch.setattr(lss, "assert_not_running", lambda session, number: calls.append(("asked", number)))
    waits = []
    session = SimpleNamespace(
        states={before: 1, 17: 1},
        nmt=lambda *command: calls.append(("nmt", *command)),
        wait=lambda duration, done: waits.append((duration, done())),
    )
    assert lss.configure(session, None, node, bit_rate) == (lss.Identity(*lss.INQUIRE), before)
    assert calls == ["waiting", ("asked", before), *expected]
    assert waits == ([(1_000_000_000, True)] if node else [])
    assert (before in session.states) is (node is None)


@every_case(
    ("state", "driven"),
    [
        (State.ENABLED, True),
        (State.QUICK_STOP, True),
        (State.REACTION, True),
        (State.SWITCHED_ON, False),
        (None, False),
    ],
)
def test_a_device_that_somebody_drives_keeps_its_node_id(state, driven):
    node = unconnected_node(values={(0x6041, 0): WORDS[state or State.DISABLED]})
    if state is None:
        node.server.missing.add(0x6041)  # no drive
    session = SimpleNamespace(client=lambda number: node.sdo, states={3: 1})
    if driven:
        with pytest.raises(SimulationError, match=r"^LSS: node 3 is driven by somebody\. End that program first\.$"):
            lss.assert_not_running(session, 3)
    else:
        lss.assert_not_running(session, 3)
    assert lss.answers(session, 3)
    assert (node.sdo.attempts, session.states) == (1, {})
