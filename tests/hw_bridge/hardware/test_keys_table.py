"""docs/data/hardware_keys.csv lists every key of a hardware file."""

import csv
from collections import defaultdict
from pathlib import Path

from pydantic import BaseModel

from hw_bridge.hardware import keys

TABLE = Path(__file__).parents[3] / "docs" / "data" / "hardware_keys.csv"
SECTIONS: dict[str, type[BaseModel]] = {
    "file": keys.HardwareKeys,
    "drive": keys.NodeKeys,
    "limits": keys.LimitKeys,
    "heartbeat": keys.HeartbeatKeys,
    "homing": keys.HomingKeys,
    "follow": keys.FollowKeys,
    "contact": keys.ContactKeys,
    "shadow": keys.ShadowKeys,
    "units": keys.UnitKeys,
    "module": keys.ModuleKeys,
    "late_cycle": keys.LateCycleKeys,
}


def test_the_table_lists_every_key():
    listed = defaultdict(set)
    with TABLE.open(newline="") as file:
        for row in csv.DictReader(file):
            listed[row["section"]].add(row["key"])
    assert listed == {name: set(model.model_fields) for name, model in SECTIONS.items()}
