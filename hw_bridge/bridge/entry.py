"""What `twin run --hardware FILE` opens: drives on a bus, or those of a trace."""

from __future__ import annotations

from pathlib import Path

from hw_bridge.bridge.hardware import Hardware
from hw_bridge.bridge.replay import replay as recorded
from hw_bridge.hardware import load as load_keys


def load(
    path: Path, arm: bool = False, build: Path = Path("build"), trace: Path | None = None, replay: str | None = None
) -> Hardware:
    """Read a hardware file. `arm`: real drives may move. `trace`: where to record. `replay`: a trace instead of drives."""
    keys = load_keys(path)
    return Hardware(path, keys, arm, build, trace) if replay is None else recorded(path, keys, replay)
