"""Drives on the page: commands that read them, and the safety view in words."""

import asyncio

from hw_bridge.command.pages import PANEL, said
from twin.console import safety

BENCH = "simulated: true\ncycle: 5 ms\nnodes: {servomotor: {node: 1, profile: faulhaber_v3, watch_contact: false}}\n"
LIMIT = {"name": "force", "value": 4.5, "low": -5.0, "high": 5.0, "part": 0.9, "unit": "N"}
DRIVE = {
    "node": 1, "profile": "<b>", "state": "Fault", "mode": "csv", "errors": ["3210h overvoltage. Check the supply."],
    "limits": [LIMIT, {**LIMIT, "name": "velocity", "part": 1.2}], "heartbeat_age": 0.004, "heartbeat_limit": 0.06,
    "lost": 2, "late": 0,
}  # fmt: skip
TOLD = {
    "interface": "socketcan", "channel": "can0", "armed": True, "simulated": False, "stopped": "", "control": "this session",
    "brought_up": True, "bus_load": 0.109, "cycle": 0.005, "cycles": 7, "jitter_99": 2e-4, "jitter_max": 1e-3,
    "nodes": {"servomotor": DRIVE}, "modules": {}, "watches": {"servomotor": {"signal": "sensor.force", "force": 0.19062, "above": 0.4, "retracts": ""}}, "shadow": {"servomotor": {"residual": 0.25}}, "notes": ["n"],
}  # fmt: skip


def test_a_command_of_the_bench_is_what_the_button_runs(tmp_path, build):
    bench = tmp_path / "bench.yaml"
    bench.write_text(BENCH)
    assert PANEL.hardware
    assert "FAULHABER" in asyncio.run(said(["scan", "-f", str(bench), "--build", str(build)]))
    assert "not in" in (told := asyncio.run(said(["status", "nobody", "-f", str(bench)]))) or "nobody" in told


def test_what_one_watches_over_stands_there_in_words():
    assert "armed: power may be on" in safety.heading(TOLD)
    assert "load 10.9 %" in safety.heading(TOLD)
    assert "stopped: EMCY &lt;1&gt;" in safety.heading({**TOLD, "stopped": "EMCY <1>"})
    assert "not armed" in safety.heading({**TOLD, "armed": False, "brought_up": False})
    told = safety.drives(TOLD)
    assert "&lt;b&gt;" in told
    assert "<b>" not in told.replace("<b>servomotor</b>", "")
    for text in ("3210h overvoltage. Check the supply.", "heartbeat 4 of 60 ms", "2 lost", "twin-warn", "twin-bad"):
        assert text in told
    assert "sensor.force is 0.191 N, stops above 0.4 N<" in safety.others(TOLD)
    assert "residual 0.25" in safety.others(TOLD)
