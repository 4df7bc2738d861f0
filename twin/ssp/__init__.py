"""SSP: systems of FMUs as others exchange them, System Structure and Parameterization 1.0 and 2.0, read and written."""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.ssp.flat import Flat, Member, Wire, flattened
    from twin.ssp.model import Linear
    from twin.ssp.names import element_name, member_name
    from twin.ssp.outputs import with_outputs
    from twin.ssp.own import told
    from twin.ssp.package import EXTRA, Package, Variant, opened
    from twin.ssp.written import Component, Outline, Port, Tie, Value, write

__all__ = [
    "EXTRA",
    "Component",
    "Flat",
    "Linear",
    "Member",
    "Outline",
    "Package",
    "Port",
    "Tie",
    "Value",
    "Variant",
    "Wire",
    "element_name",
    "flattened",
    "member_name",
    "opened",
    "told",
    "with_outputs",
    "write",
]

__getattr__ = late.names(
    __name__,
    {
        "Component": "written",
        "EXTRA": "package",
        "Flat": "flat",
        "Linear": "model",
        "Member": "flat",
        "Outline": "written",
        "Package": "package",
        "Port": "written",
        "Tie": "written",
        "Value": "written",
        "Variant": "package",
        "Wire": "flat",
        "element_name": "names",
        "flattened": "flat",
        "member_name": "names",
        "opened": "package",
        "told": "own",
        "with_outputs": "outputs",
        "write": "written",
    },
)
