"""What the panel of the drives shows, from a status that a test chooses."""

import pytest

from tests.every_case import every_case
from twin.console import safety


@pytest.mark.parametrize(
    ("status", "kind", "text"),
    [
        ({}, "good", "not armed"),
        ({"armed": True}, "warn", "armed: power may be on"),
        (
            {"armed": True, "simulated": True},
            "good",
            "simulated drives, in simulated time: pause, step and pace apply to them",
        ),
        ({"stopped": "limit <1>"}, "bad", "stopped: limit &lt;1&gt;"),
    ],
)
def test_whether_drives_may_move(status, kind, text):
    given = {
        "armed": False,
        "simulated": False,
        "stopped": "",
        "control": "this",
        "interface": "can",
        "channel": "0",
        "brought_up": True,
        "bus_load": 0.1234,
        "cycle": 0.005,
        "cycles": 9,
        "jitter_99": 1e-4,
        "jitter_max": 2.5e-4,
    } | status
    html = safety.heading(given)
    assert html.startswith(f'<p class="twin-state twin-{kind}">{text}</p>')
    assert "<dd>can 0, load 12.3 %</dd><dt>cycle</dt><dd>5 ms, 9 done</dd>" in html
    assert "<dd>0.10 ms (99 %), 0.25 ms at most</dd>" in html
    assert "<dt>bus</dt><dd>simulated</dd></dl>" in safety.heading(
        given | {"interface": "", "channel": "", "brought_up": False}
    )


@every_case(
    ("part", "kind", "width"),
    [
        (None, "good", 0),
        (-0.5, "good", 0),
        (0.5, "good", 50),
        (safety.WARNING_FRACTION, "warn", None),
        (0.999, "warn", 100),
        (1.0, "bad", 100),
        (3.0, "bad", 100),
    ],
)
def test_how_close_a_limit_is(part, kind, width):
    html = safety.bar({"part": part, "value": 1.0, "low": -2.0, "high": 2.5, "unit": "N", "name": "force"})
    assert f'class="twin-{kind}"' in html
    assert 'title="1 of -2 to 2.5 N"' in html
    assert width is None or f"width:{width}%" in html


def test_what_a_drive_says():
    node = {
        "errors": ["E"],
        "limits": [],
        "heartbeat_age": 0.02,
        "heartbeat_limit": 0.1,
        "state": "Operation enabled",
        "node": 3,
        "profile": "p",
        "mode": "csv",
        "lost": 1,
        "late": 2,
    }
    html = safety.drive("d", node)
    assert all(
        text in html
        for text in (
            "twin-good",
            "heartbeat 20 of 100 ms",
            "csv; ",
            "1 lost, 2 late",
            "node 3, p",
            '<li class="twin-bad">E</li>',
        )
    )
    for change, text in (
        ({"state": "Fault"}, "twin-state twin-bad"),
        ({"state": "Ready to switch on"}, "twin-state twin-soft"),
        ({"heartbeat_age": None}, "no heartbeat watched"),
        ({"heartbeat_limit": 0.0}, "no heartbeat watched"),
        ({"heartbeat_age": 0.0}, "heartbeat 0 of 100 ms"),
    ):
        assert text in safety.drive("d", node | change)
    monitor = {"force": 0.12345, "signal": "s", "above": 2.0, "retracts": "It retracts."}
    assert safety.watch(monitor) == "s is 0.123 N, stops above 2 N. It retracts"
    assert safety.watch(monitor, " at 1.50 s") == "s is 0.123 N at 1.50 s, stops above 2 N. It retracts"
    assert safety.watch(monitor | {"force": None, "retracts": ""}) == "s is not known, stops above 2 N"
    figures = {"position": 0.001, "velocity": None, "current": 0.5}
    residual = {"now": figures, "bands": figures, "largest": figures, "warnings": ["drifts"]}
    assert safety.shadow(residual) == (
        "position 1 mm (band 1 mm, largest 1 mm), velocity not known (band not known, largest not known), "
        "current 0.5 A (band 0.5 A, largest 0.5 A). drifts"
    )
    assert safety.shadow(residual, rotary=True).startswith("position 0.0573 deg (band")
    assert safety.words({"a": {"b": 1.23456}, "c": True}) == "a b 1.235, c True"
