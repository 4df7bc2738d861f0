"""From a drive in its box to first motion: who is there, what it holds, what it says, a hand that moves it."""

from typing import TYPE_CHECKING

from twin import late

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

__getattr__ = late.names(
    __name__,
    {
        "BOOT": "line",
        "EXAMPLES": "axes",
        "HOLD": "deadman",
        "SHARE": "hand",
        "SLOWEST_STOP": "hand",
        "TWICE": "survey",
        "Attendance": "attendance",
        "Axis": "axes",
        "DeadMan": "deadman",
        "Found": "survey",
        "Hand": "hand",
        "HeldKey": "deadman",
        "Inspection": "inspection",
        "Keyboard": "deadman",
        "PlannedRow": "planned",
        "Line": "line",
        "Status": "telling",
        "alone": "hand",
        "axis": "axes",
        "bounded": "hand",
        "dcf": "",
        "direction": "",
        "glance": "telling",
        "homing": "",
        "inspect": "inspection",
        "known": "survey",
        "limit_effects": "",
        "limits": "",
        "lss": "",
        "memory": "",
        "objects": "",
        "planned_rows": "planned",
        "power": "",
        "recognized": "survey",
        "refuse_moving": "line",
        "scan": "survey",
        "status": "telling",
        "step": "",
        "typed": "axes",
        "unfinished": "line",
        "words": "",
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
