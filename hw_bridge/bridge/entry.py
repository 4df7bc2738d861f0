"""Entry point of `twin run --hardware FILE`: drives on a bus, or those of a trace."""

from __future__ import annotations

from pathlib import Path

from hw_bridge.bridge.hardware import Hardware
from hw_bridge.bridge.replay import replay as recorded
from hw_bridge.hardware import load as load_keys


def load(
    path: Path,
    arm: bool = False,
    build: Path = Path("build"),
    trace: Path | None = None,
    replay: str | None = None,
    dry: bool = False,
) -> Hardware:
    """Read a hardware file. `arm`: real drives may move. `trace`: where to record. `replay`: a trace instead of drives.

    `dry`: the bus is brought up without power, and simulated drives receive the targets.
    """
    keys = load_keys(path)
    if dry:
        from hw_bridge.bridge.dry import DryHardware

        return DryHardware(path, keys, build, trace, arm)
    return Hardware(path, keys, arm, build, trace) if replay is None else recorded(path, keys, replay)
