"""What `twin drive` serves on an interface, in its order; without a bus and without a process."""

import signal
import threading
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner

from hw_bridge.command import drive
from hw_bridge.device import Module
from hw_bridge.dictionary import cia301
from hw_bridge.profiles import DRIVE_PROFILES, device, profile


@pytest.fixture
def served(monkeypatch, tmp_path):
    """Serve a device; `calls` has what was done. `answers`: whether another node answers on its ID."""
    calls = []
    state = SimpleNamespace(calls=calls, answers=False, devices=[], looks=[])

    class Wire:
        def __init__(self, slave, ends):
            state.devices.append(slave)
            self.look, self.stop, self.overruns, self.lost = (lambda: calls.append("look")), threading.Event(), 2, 3

        def run(self):
            slave = state.devices[-1]
            slave.port = SimpleNamespace(event_queue=SimpleNamespace(now=1_250_000_000))
            state.looks.append(self.look)
            self.look()
            calls.append("run")

    class Control:
        def __init__(self, port, slave, wire):
            self.port = port or 4711

        def look(self):
            calls.append("control")

        def close(self):
            calls.append("closed")

    def free(ends, node):
        calls.append(("free", node))
        if state.answers:
            raise OSError("answers")

    monkeypatch.setattr("hw_bridge.wire.Wire", Wire)
    monkeypatch.setattr("hw_bridge.wire.open_bus", lambda *given: calls.append(("open", *given)) or "bus")
    monkeypatch.setattr("hw_bridge.wire.link", lambda bus, interface: (bus, interface))
    monkeypatch.setattr("hw_bridge.wire.assert_node_id_free", free)
    monkeypatch.setattr("hw_bridge.wire.freeze_gc_and_set_fifo", lambda: None)
    monkeypatch.setattr("hw_bridge.wire.shut_down", lambda bus: calls.append(("down", bus)))
    monkeypatch.setattr("hw_bridge.command.control.Control", Control)
    monkeypatch.setattr("hw_bridge.device.Motor", lambda model, build: SimpleNamespace(model=model, unit="m"))
    monkeypatch.setattr("hw_bridge.device.Drive", FakeDrive)
    monkeypatch.setattr(
        "hw_bridge.plant.store_motor_parameters", lambda slave, motor: calls.append(("set up", motor.name))
    )
    monkeypatch.setattr(drive, "_stop_on_signals", lambda stop: None)

    def serve(chosen, node=3, **options):
        drive.serve(chosen, node, "virtual", "x", 500_000, tmp_path, **options)
        return state.devices[-1]

    state.serve = serve
    return state


class FakeDrive:
    """A drive of a profile without a simulation."""

    def __init__(self, chosen, node, motor):
        self.profile, self.node, self.motor = chosen, node, motor
        self.axis, self.stores = SimpleNamespace(switches=None), []

    def remember(self, store):
        self.stores.append(store)


@pytest.mark.parametrize(
    ("node", "port", "text"),
    [
        (3, None, "node 3 on virtual x. Ctrl-C ends it."),
        (3, 4703, "node 3 on virtual x. Faults: --control 4703. Ctrl-C ends it."),
        (3, 0, "node 3 on virtual x. Faults: --control 4711. Ctrl-C ends it."),
        (cia301.UNCONFIGURED, None, "no node-ID on virtual x. Ctrl-C ends it."),
    ],
)
def test_a_drive_is_served_until_it_is_stopped(served, capsys, node, port, text):
    served.serve(profile("mclm"), node, port=port, is_set_up=False, options={"a": 1})
    assert served.calls == [
        ("open", "virtual", "x", 500_000, {"a": 1}),
        *[("free", 3)] * (node == 3),
        "look" if port is None else "control",
        "run",
        *["closed"] * (port is not None),
        ("down", "bus"),
    ]
    title = profile("mclm").title
    assert capsys.readouterr().out.splitlines() == [
        f"{title}: {text}",
        "stopped after 1.2 s, 2 overruns, 3 frames lost",
    ]


def test_what_a_drive_is_given_before_it_starts(served, tmp_path):
    closing = SimpleNamespace()
    found = served.serve(profile("mclm"), store=tmp_path / "a.json", switches=closing)
    assert ("set up", profile("mclm").motor_name) in served.calls
    assert found.axis.switches is closing
    assert len(found.stores) == 1
    found = served.serve(profile("mclm"), is_set_up=False)
    assert (found.axis.switches, found.stores) == (None, [])
    assert len([call for call in served.calls if call[0] == "set up"]) == 1


def test_an_id_that_is_taken_closes_the_bus(served):
    served.answers = True
    with pytest.raises(OSError, match="answers"):
        served.serve(profile("mclm"), port=5)
    assert served.calls[-1] == ("down", "bus")
    assert "run" not in served.calls


def test_outputs_of_a_module_are_printed_as_they_change(capsys):
    calls = []
    queue = SimpleNamespace(now=0)
    module = SimpleNamespace(outputs=0, port=SimpleNamespace(event_queue=queue))
    look = drive.switching(module, lambda: calls.append(1))
    for now, outputs in ((0, 0), (5_000_000, 0), (10_400_000, 0x1F), (20_000_000, 0x1F), (30_000_000, 0)):
        queue.now, module.outputs = now, outputs
        look()
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["0.000 s", "0.010 s", "0.030 s"]
    assert [int(line.split()[-1][:-1], 16) for line in lines] == [0, 0x1F, 0]
    assert len(calls) == 5


@pytest.mark.parametrize(("nohup", "stops"), [(False, True), (True, False)])
def test_a_drive_ends_with_the_process_that_started_it(monkeypatch, nohup, stops):
    handler = signal.SIG_IGN if nohup else signal.SIG_DFL
    monkeypatch.setattr(signal, "getsignal", lambda number: handler)
    parents = [7, 7, 1]
    monkeypatch.setattr(drive.os, "getppid", lambda: parents.pop(0))
    stop, calls = threading.Event(), []
    look = drive.ending_with_parent(stop, lambda: calls.append(1))
    look()
    assert not stop.is_set()
    look()
    assert stop.is_set() is stops
    assert len(calls) == 2


def test_signals_stop_a_drive_unless_they_are_ignored(monkeypatch):
    handlers = {}
    ignored = drive.SIGNALS[0]
    monkeypatch.setattr(signal, "getsignal", lambda number: signal.SIG_IGN if number == ignored else signal.SIG_DFL)
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    stop = threading.Event()
    drive._stop_on_signals(stop)
    assert set(handlers) == set(drive.SIGNALS[1:])
    assert not stop.is_set()
    handlers[drive.SIGNALS[1]](0, None)
    assert stop.is_set()


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_devices_by_name(name):
    assert drive.select_device(name, None, ()) is profile(name)
    assert drive.select_device("cia401", None, ()) is device("cia401")
    module = drive.made(device("cia401"), 9, None)
    assert (type(module), module.node) == (Module, 9)


@pytest.mark.parametrize(
    ("sizes", "text"),
    [
        (("position",), "--unit: "),
        (("position=1",), "--unit: 1 has no unit. Write it with one, such as 30 mm."),
        (("position=1 N",), "--unit: "),
    ],
)
def test_units_of_a_generic_drive_that_are_wrong(tmp_path, sizes, text):
    file = tmp_path / "a.eds"
    file.write_text("")
    with pytest.raises(click.UsageError) as caught:
        drive.generic_drive("cia402", file, sizes)
    assert str(caught.value.message).startswith(text)


def test_an_eds_file_is_written_without_a_bus(tmp_path):
    file = tmp_path / "a.eds"
    done = CliRunner().invoke(drive.command, ["-p", "mclm", "--write-eds", str(file)])
    assert (done.exit_code, done.output) == (0, "")
    assert "[DeviceInfo]" in file.read_text()
