"""Reader and writer for System Structure and Parameterization (SSP) 1.0 and 2.0."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.ssp.flat import FlatConnection, FlatMember, FlatSystem, flatten
    from twin.ssp.model import Linear
    from twin.ssp.names import element_name, member_name
    from twin.ssp.outputs import promote_locals_to_outputs
    from twin.ssp.package import DEFAULT, EXTRA, Variant, open_package
    from twin.ssp.ssp_annotations import read_annotations
    from twin.ssp.writer import OutlineComponent, OutlineConnection, SystemOutline, write

__all__ = [
    "DEFAULT",
    "EXTRA",
    "FlatConnection",
    "FlatMember",
    "FlatSystem",
    "Linear",
    "OutlineComponent",
    "OutlineConnection",
    "SystemOutline",
    "Variant",
    "element_name",
    "flatten",
    "member_name",
    "open_package",
    "promote_locals_to_outputs",
    "read_annotations",
    "write",
]

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "flat": ["FlatSystem", "FlatMember", "FlatConnection", "flatten"],
        "model": ["Linear"],
        "names": ["element_name", "member_name"],
        "outputs": ["promote_locals_to_outputs"],
        "package": ["DEFAULT", "EXTRA", "Variant", "open_package"],
        "ssp_annotations": ["read_annotations"],
        "writer": ["OutlineComponent", "SystemOutline", "OutlineConnection", "write"],
    },
)
