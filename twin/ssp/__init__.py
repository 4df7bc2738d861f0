"""SSP: systems of FMUs as others exchange them, System Structure and Parameterization 1.0 and 2.0, read and written."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.ssp.flat import Flat, Member, Wire, flattened
    from twin.ssp.model import Linear
    from twin.ssp.names import element_name, member_name
    from twin.ssp.outputs import with_outputs
    from twin.ssp.package import EXTRA, Package, Variant, opened
    from twin.ssp.ssp_annotations import told
    from twin.ssp.writer import Component, Outline, Port, Tie, Value, write

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

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "flat": ["Flat", "Member", "Wire", "flattened"],
        "model": ["Linear"],
        "names": ["element_name", "member_name"],
        "outputs": ["with_outputs"],
        "package": ["EXTRA", "Package", "Variant", "opened"],
        "ssp_annotations": ["told"],
        "writer": ["Component", "Outline", "Port", "Tie", "Value", "write"],
    },
)
