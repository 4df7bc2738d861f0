"""A listener decodes process data in the member's scale and sends nothing."""

import time

import can
import pytest

from hw_bridge.bridge import load
from twin.errors import SimulationError

BENCH = """
title: A drive whose member moves the other way, at half the motor's
interface: virtual
channel: listener
nodes:
  slide: {node: 3, profile: faulhaber_v3, scale: 0.5, inverted: true}
"""
POSITION = 0x6064


def test_process_data_are_decoded_and_nothing_is_sent(tmp_path):
    (tmp_path / "bench.yaml").write_text(BENCH)
    listener = load(tmp_path / "bench.yaml").listen()
    try:
        routes = listener.decoder.parties[3].routes
        identifier, route = next((i, r) for i, r in routes.items() if POSITION in [e.index for e, _ in r.mapped])
        data = b"".join(
            (5000 if entry.index == POSITION else 0).to_bytes(bits // 8, "little") for entry, bits in route.mapped
        )
        with can.Bus(interface="virtual", channel="listener") as sender:
            sender.send(can.Message(arbitration_id=0x080, is_extended_id=False))
            sender.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            received = listener.receive(1.0) + listener.receive(1.0)
            ((arrival, values),) = received
            assert values["slide.position_actual_value"] == pytest.approx(-2.5e-3)
            assert 0.0 <= time.monotonic() - arrival < 5.0
            assert sender.recv(0.1) is None
    finally:
        listener.close()


def test_a_bus_in_simulated_time_has_no_listener(tmp_path):
    text = BENCH.replace("interface: virtual\nchannel: listener", "simulated: true")
    (tmp_path / "bench.yaml").write_text(text)
    with pytest.raises(SimulationError, match="`simulated: true`: this bus exists within a run only"):
        load(tmp_path / "bench.yaml").listen()
