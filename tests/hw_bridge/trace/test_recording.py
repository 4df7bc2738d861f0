"""What one drive said in a trace, without a bus."""

from math import pi

import pytest

from hw_bridge.bus import bit_count
from hw_bridge.hardware import HardwareKeys, NodeKeys
from hw_bridge.trace.decoder import DecodedFrame, Decoder
from hw_bridge.trace.recording import Recording, Track
from hw_bridge.wire import read
from twin.errors import SimulationError

DISABLED, READY, ENABLED = 0x40, 0x21, 0x27  # statuswords of CiA 402


def track(**keys):
    return Track(NodeKeys.model_validate({"node": 3, "profile": "epos4", **keys}), "axis")


def hear(heard, time, **values):
    heard.hear(DecodedFrame(time, None, 3, "PDO", "", values))


def test_a_value_is_the_last_one_until_a_time():
    heard = track(scale=2.0)
    assert heard.at("velocity_actual_value", 5) is None
    for time, value in ((10, 1.0), (20, 2.0), (30, 4.0)):
        hear(heard, time, velocity_actual_value=value)
    assert [heard.at("velocity_actual_value", time) for time in (5, 10, 19, 20, 29, 99)] == [
        2.0,
        2.0,
        2.0,
        4.0,
        4.0,
        8.0,
    ]


def test_directions_and_scales():
    heard = track(scale=0.5, inverted=True)
    hear(heard, 1, position_actual_value=3.0, torque_actual_value=0.25, statusword=READY, other=1.0)
    hear(heard, 2, velocity_actual_value="7 rad/s")
    assert heard.values == {
        "position_actual_value": [-1.5],
        "velocity_actual_value": [],
        "current": [-0.25],
        "statusword": [float(READY)],
    }


def test_home_is_where_the_drive_stood_before_it_was_enabled():
    heard = track()
    for time, (word, position) in enumerate(
        ((DISABLED, 1.0), (DISABLED, 2.0), (READY, 3.0), (ENABLED, 4.0), (DISABLED, 5.0))
    ):
        hear(heard, time, position_actual_value=position, statusword=word)
        assert heard.home == pytest.approx(min(position, 2.0))
        assert heard.enabled is (word == ENABLED)


BENCH = {"simulated": True, "bit_rate": 500_000, "nodes": {"slide": {"node": 3, "profile": "epos4", "scale": 0.5}}}
INCREMENT = 2 * pi / 2000  # of the drive [rad]
MS = 1_000_000  # [ns]


def trace(folder, *rows, start=None):
    """A recording of these frames at times [ms]: an actual position with a statusword, or a target."""
    keys, lines = HardwareKeys.model_validate(BENCH), []
    routes = Decoder.of_bench(keys).parties[3].routes
    for time, *values in rows:
        objects = dict(zip((0x6064, 0x6041), values, strict=True)) if len(values) == 2 else {0x607A: values[0]}
        identifier, route = next(
            (identifier, route)
            for identifier, route in routes.items()
            if {entry.index for entry, _ in route.mapped} & objects.keys() - {0x6041}
        )
        data = b"".join(objects.get(entry.index, 0).to_bytes(bits // 8, "little") for entry, bits in route.mapped)
        lines.append(f"({time / 1000:.6f}) can0 {identifier:03X}#{data.hex()}\n")
    path = folder / "bus.log"
    path.write_text("".join(lines))
    return Recording(path, keys, start)


ROWS = [
    (1, 1000, DISABLED),
    (3, 2000, DISABLED),
    (4, 2000, READY),
    (5, 3000),
    (6, 2000, ENABLED),
    (8, 5000),
    (9, 4000, ENABLED),
]


def test_a_recorded_run_begins_with_the_first_target_of_enabled_drives(tmp_path):
    recorded = trace(tmp_path, *ROWS)
    targets = [frame for time, frame, _ in read(tmp_path / "bus.log") if time == 8 * MS]
    assert recorded.zero == 8 * MS - bit_count(targets[0]) * 2_000  # a frame has the time of its last bit; 2 us each
    assert recorded.end == 9 * MS


def test_recordings_that_tell_no_run(tmp_path):
    with pytest.raises(
        SimulationError, match=r"bus\.log: the drives are never enabled\. Name the beginning: bus\.log@SECONDS\.$"
    ):
        trace(tmp_path, *ROWS[:3], (5, 3000))
    with pytest.raises(
        SimulationError, match=r"bus\.log: says nothing of slide's position \(node 3\)\. Record it from the start"
    ):
        trace(tmp_path, (5, 3000))
    assert trace(tmp_path, *ROWS, (0, 0, ENABLED)).end == 9 * MS  # 9 ms: two channels in the wrong order
    late = [(time + 10, *values) for time, *values in ROWS]
    with pytest.raises(
        SimulationError, match=r"bus\.log: frame 8 is 0\.012 s earlier than the one before\. Sort them by time\.$"
    ):
        trace(tmp_path, *late, (7, 0, ENABLED))


def test_the_beginning_may_be_named(tmp_path):
    recorded = trace(tmp_path, *ROWS, start=0.0025)
    slide = recorded.tracks["slide"]
    assert (recorded.zero, recorded.end) == (2_500_000, 9 * MS)
    assert slide.times["position_actual_value"] == [1 * MS, 3 * MS, 4 * MS, 6 * MS, 9 * MS]
    assert slide.values["position_actual_value"] == pytest.approx(
        [0.5 * INCREMENT * n for n in (1000, 2000, 2000, 2000, 4000)]
    )
    assert (slide.home, slide.enabled) == (pytest.approx(1000 * INCREMENT), True)
