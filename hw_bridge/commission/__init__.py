"""Commissioning: scan a bus, read and write parameters, report status, enable and move a single drive."""

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
        nvm,
        object_texts,
        objects,
        power,
        step,
    )
    from hw_bridge.commission.axes import EXAMPLES, Axis, axis, parse_quantity
    from hw_bridge.commission.bus_scan import DUPLICATE_ID, ScannedNode, profile_name_of, profile_title_of, scan
    from hw_bridge.commission.deadman import HOLD, DeadMan, HeldKey, Keyboard
    from hw_bridge.commission.inspection import Inspection, inspect
    from hw_bridge.commission.page_watchdog import PageWatchdog
    from hw_bridge.commission.planned import PlannedRow, planned_rows, write_heading
    from hw_bridge.commission.sdo_session import BOOT, SdoSession, assert_not_driven, pending_error
    from hw_bridge.commission.single_axis_session import (
        SLOWEST_STOP,
        SingleAxisSession,
        check_bounded,
        restrict_to_node,
    )
    from hw_bridge.commission.status_report import Status, monitored_rows, status

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=[
        "dcf",
        "direction",
        "homing",
        "limit_effects",
        "limits",
        "lss",
        "nvm",
        "objects",
        "power",
        "step",
        "object_texts",
    ],
    submod_attrs={
        "page_watchdog": ["PageWatchdog"],
        "axes": ["Axis", "EXAMPLES", "axis", "parse_quantity"],
        "deadman": ["DeadMan", "HOLD", "HeldKey", "Keyboard"],
        "single_axis_session": ["SingleAxisSession", "SLOWEST_STOP", "restrict_to_node", "check_bounded"],
        "inspection": ["Inspection", "inspect"],
        "sdo_session": ["BOOT", "SdoSession", "assert_not_driven", "pending_error"],
        "planned": ["PlannedRow", "planned_rows", "write_heading"],
        "bus_scan": ["ScannedNode", "DUPLICATE_ID", "profile_title_of", "profile_name_of", "scan"],
        "status_report": ["Status", "monitored_rows", "status"],
    },
)

__all__ = [
    "BOOT",
    "DUPLICATE_ID",
    "EXAMPLES",
    "HOLD",
    "SLOWEST_STOP",
    "Axis",
    "DeadMan",
    "HeldKey",
    "Inspection",
    "Keyboard",
    "PageWatchdog",
    "PlannedRow",
    "ScannedNode",
    "SdoSession",
    "SingleAxisSession",
    "Status",
    "assert_not_driven",
    "axis",
    "check_bounded",
    "dcf",
    "direction",
    "homing",
    "inspect",
    "limit_effects",
    "limits",
    "lss",
    "monitored_rows",
    "nvm",
    "object_texts",
    "objects",
    "parse_quantity",
    "pending_error",
    "planned_rows",
    "power",
    "profile_name_of",
    "profile_title_of",
    "restrict_to_node",
    "scan",
    "status",
    "step",
    "write_heading",
]
