"""What pages in the browser share: a server for this machine alone, charts, a tree of signals, one style.

Nothing here is imported until a page is served: the library of the pages takes a second.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.web import frames
    from twin.web.chart import Chart, Curve, Pane
    from twin.web.operator_lock import OperatorLock
    from twin.web.server import STATIC, Site, needed
    from twin.web.theme import framed, styled
    from twin.web.tree import Leaf, Tree

__all__ = [
    "STATIC",
    "Chart",
    "Curve",
    "Leaf",
    "OperatorLock",
    "Pane",
    "Site",
    "Tree",
    "framed",
    "frames",
    "needed",
    "styled",
]

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["frames"],
    submod_attrs={
        "chart": ["Chart", "Curve", "Pane"],
        "operator_lock": ["OperatorLock"],
        "server": ["STATIC", "Site", "needed"],
        "theme": ["framed", "styled"],
        "tree": ["Leaf", "Tree"],
    },
)
