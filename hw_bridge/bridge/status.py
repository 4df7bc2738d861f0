"""Live status of drives for the operator: states in words, limits and distance to them, watchdogs, the bus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hw_bridge.bus import bit_count
from hw_bridge.commission import object_texts
from hw_bridge.master import fault_report

if TYPE_CHECKING:
    from hw_bridge.bridge.hardware import Hardware
    from hw_bridge.bus import Frame
    from hw_bridge.master import Master, ModuleNode, Node
    from hw_bridge.session import Session

LAST = 2000  # cycles of the jitter statistics: ten seconds at 5 ms
SPAN = 1_000_000_000  # window of the bus load [ns]


class Load:
    """Bus load by sent and received frames, over a second."""

    def __init__(self, master: Master) -> None:
        self.master, self.bit_rate = master, master.keys.bit_rate
        master.network.observe(self.hear)
        self.share = 0.0
        self._bits = 0
        self._since: int | None = None

    def hear(self, time: int, frame: Frame | None) -> None:
        """Count a frame at a time [ns]."""
        if self._since is None:
            self._since = time
        self._bits += bit_count(frame) if frame is not None else 0
        if time - self._since >= SPAN:
            self.share = self._bits * 1e9 / ((time - self._since) * self.bit_rate)
            self._bits, self._since = 0, time


def status(hardware: Hardware, load: Load | None) -> dict[str, Any]:
    """Status as plain data, in SI; cheap enough for ten calls a second between two cycles."""
    keys, session = hardware.keys, hardware.present
    idle: dict[str, Any] = {
        "file": str(hardware.path), "interface": keys.interface, "channel": keys.channel, "armed": hardware.arm,
        "simulated": keys.simulated, "software": keys.is_software(), "cycle": keys.cycle / 1e9, "control": "no program",
        "brought_up": False, "stopped": "", "nodes": {}, "modules": {}, "watches": {}, "shadow": {}, "notes": [],
    }  # fmt: skip
    if session is None or session.master is None:
        return idle
    master, outcome = session.master, session.outcome
    reason = outcome.stopped[1] if outcome.stopped is not None else "stopped" if session.closed else ""
    if session.running and not session.closed:
        idle["control"] = "this session"
    if master.foreign_master.text:
        idle["control"] = master.foreign_master.text
    return idle | {
        "brought_up": session.running,
        "stopped": reason,
        "notes": list(outcome.notes),
        **cycles(master, session, load),
        "nodes": {name: drive(node, master) for name, node in master.nodes.items()},
        "modules": {name: module(node, master) for name, node in master.modules.items()},
        "watches": {
            name: {
                "signal": watch.keys.signal,
                "above": watch.keys.above,
                "retracts": watch.reason,
                "force": plain(session.orders.axes[name].views["contact_force"]),
            }
            for name, watch in session.watches.items()
        },
        "shadow": {name: observer.report() for name, observer in session.observers.items()},
    }


def cycles(master: Master, session: Session, load: Load | None) -> dict[str, Any]:
    """Cycle timing statistics and bus load."""
    sent = np.diff(np.array(master.timing.sent[-LAST:], np.int64))
    jitter = np.abs(sent - master.cycle) / 1e9 if len(sent) else np.zeros(1)
    return {
        "cycles": len(master.timing.sent),
        "jitter_99": float(np.quantile(jitter, 0.99)),
        "jitter_max": float(jitter.max()),
        "bus_load": load.share if load is not None else 0.0,
        "real_time_priority": session.real_time,
        **session.late_cycle_policy.report(),
    }


def drive(node: Node, master: Master) -> dict[str, Any]:
    """Status of one drive, with the distance to each limit."""
    keys, limits = node.keys, node.keys.limits
    low, high = node.position_limits
    length, force = ("rad", "N*m") if node.rotary else ("m", "N")
    span = 0.5 * (high - low)
    rows = [
        ("position", node.position, low, high, abs(node.position - 0.5 * (low + high)) / span if span else 1.0, length),
        *(
            (name, value, -limit, limit, abs(value) / limit, symbol)
            for name, value, limit, symbol in (
                ("velocity", node.velocity, limits.velocity, f"{length}/s"),
                ("force", node.force, limits.force, force),
                ("following error", node.following_error, limits.following_error, length),
            )
        ),
    ]
    return {
        "node": node.number, "profile": node.profile.title, "state": str(node.state), "word": node.word,
        "statusword": object_texts.statusword(node.word, int(node.own_mode)), "mode": object_texts.mode(int(node.own_mode)),
        "errors": [f"{fault_report.format_emergency(node, emergency)}. {object_texts.remedy(emergency.code)}"
                   for emergency in node.emergencies if emergency.code],
        "rotary": node.rotary, "position": node.position, "velocity": node.velocity, "force": node.force,
        "following_error": node.following_error,
        "limits": [
            {"name": name, "value": value, "low": least, "high": most, "part": part, "unit": symbol}
            for name, value, least, most, part, symbol in rows
        ],
        "heartbeat_age": (master.network.now - node.last_heartbeat_at) / 1e9, "heartbeat_limit": keys.heartbeat.lost_after / 1e9,
        "lost": node.lost, "late": node.late,
    }  # fmt: skip


def module(node: ModuleNode, master: Master) -> dict[str, Any]:
    """Status of one I/O module."""
    return {
        "node": node.number,
        "profile": node.profile.title,
        "outputs": node.outputs,
        "errors": [fault_report.format_emergency(node, emergency) for emergency in node.emergencies if emergency.code],
        "heartbeat_age": (master.network.now - node.last_heartbeat_at) / 1e9,
        "heartbeat_limit": node.keys.heartbeat.lost_after / 1e9,
        "lost": node.lost,
        "late": node.late,
    }


def plain(value: Any) -> float | None:
    """Convert to a number that JSON has; None if it is not finite."""
    return float(value) if np.isfinite(value) else None
