"""From a drive in its box to first motion: who is there, what it holds, what it says, a hand that moves it."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from hw_bridge.commission import (
        dcf,
        direction,
        homing,
        limit_effects,
        limits,
        lss,
        memory,
        objects,
        power,
        step,
        words,
    )
    from hw_bridge.commission.attendance import Attendance
    from hw_bridge.commission.axes import EXAMPLES, Axis, axis, typed
    from hw_bridge.commission.deadman import HOLD, DeadMan, HeldKey, Keyboard
    from hw_bridge.commission.hand import SHARE, SLOWEST_STOP, Hand, alone, bounded
    from hw_bridge.commission.inspection import Inspection, inspect
    from hw_bridge.commission.line import BOOT, Line, refuse_moving, unfinished
    from hw_bridge.commission.planned import PlannedRow, planned_rows
    from hw_bridge.commission.survey import TWICE, Found, known, recognized, scan
    from hw_bridge.commission.telling import Status, glance, status

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=[
        "dcf",
        "direction",
        "homing",
        "limit_effects",
        "limits",
        "lss",
        "memory",
        "objects",
        "power",
        "step",
        "words",
    ],
    submod_attrs={
        "attendance": ["Attendance"],
        "axes": ["Axis", "EXAMPLES", "axis", "typed"],
        "deadman": ["DeadMan", "HOLD", "HeldKey", "Keyboard"],
        "hand": ["Hand", "SHARE", "SLOWEST_STOP", "alone", "bounded"],
        "inspection": ["Inspection", "inspect"],
        "line": ["BOOT", "Line", "refuse_moving", "unfinished"],
        "planned": ["PlannedRow", "planned_rows"],
        "survey": ["Found", "TWICE", "known", "recognized", "scan"],
        "telling": ["Status", "glance", "status"],
    },
)

__all__ = [
    "BOOT",
    "EXAMPLES",
    "HOLD",
    "SHARE",
    "SLOWEST_STOP",
    "TWICE",
    "Attendance",
    "Axis",
    "DeadMan",
    "Found",
    "Hand",
    "HeldKey",
    "Inspection",
    "Keyboard",
    "Line",
    "PlannedRow",
    "Status",
    "alone",
    "axis",
    "bounded",
    "dcf",
    "direction",
    "glance",
    "homing",
    "inspect",
    "known",
    "limit_effects",
    "limits",
    "lss",
    "memory",
    "objects",
    "planned_rows",
    "power",
    "recognized",
    "refuse_moving",
    "scan",
    "status",
    "step",
    "typed",
    "unfinished",
    "words",
]
