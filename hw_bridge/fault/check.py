"""Check whether a fault can be injected."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import NEVER
from hw_bridge.fault.action import ACTIONS
from hw_bridge.fault.fault import LARGEST, Cause

if TYPE_CHECKING:
    from hw_bridge.fault.fault import Fault
    from hw_bridge.profiles import Profile

HIGHEST = 0x7FF  # identifier
RANGES = {  # of a fault's numbers; not a number is outside all of them
    "code": (0, 0xFFFF),
    "duration": (0, NEVER),
    "share": (0.0, 1.0),
    "count": (1, NEVER),
    "delay": (0, NEVER),
    "jitter": (0, NEVER),
    "offset": (-LARGEST, LARGEST),
    "factor": (0.0, LARGEST),
}


def problem(fault: Fault, profile: Profile | None, master: bool = True) -> str:
    """Return why a fault cannot be injected into a drive of this profile (None: master or module), or an empty string."""
    for name, (low, high) in RANGES.items():
        value = getattr(fault, name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            return f"{name} is {value}: expected a number from {low:g} to {high:g}"
    ends = fault.identifiers
    if ends is not None and not (
        len(ends) == 2 and all(isinstance(end, int) for end in ends) and 0 <= ends[0] <= ends[1] <= HIGHEST
    ):
        return f"identifiers are {ends}: expected two of 0 to 0x7FF, the lower one first"
    if profile is None:
        own = fault.cause in ACTIONS or (master and fault.cause is Cause.RESET)
        return f"{fault.cause} is a fault of a drive. Name a drive" if own else ""
    if fault.cause is Cause.EMCY and fault.code not in profile.faults:
        codes = ", ".join(f"{code:04X}h" for code in sorted(profile.faults))
        return f"{profile.title} has no error {fault.code:04X}h. There are: {codes}"
    return ""
