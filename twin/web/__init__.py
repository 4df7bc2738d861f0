"""Parts shared by the pages: a local server, charts, a tree of signals, one style.

Modules are imported when a page is served: NiceGUI takes a second.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.web import frames
    from twin.web.chart import Chart, ChartCurve, Pane
    from twin.web.embedding import PackedArrays, chart_script, embed_json, read_static
    from twin.web.operator_lock import OperatorLock
    from twin.web.server import STATIC, Site
    from twin.web.templates import page_templates, report_templates
    from twin.web.theme import page_frame
    from twin.web.tree import Leaf, Tree
    from twin.web.views import SIZES, build_views

__all__ = [
    "SIZES",
    "STATIC",
    "Chart",
    "ChartCurve",
    "Leaf",
    "OperatorLock",
    "PackedArrays",
    "Pane",
    "Site",
    "Tree",
    "build_views",
    "chart_script",
    "embed_json",
    "frames",
    "page_frame",
    "page_templates",
    "read_static",
    "report_templates",
]

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["frames"],
    submod_attrs={
        "chart": ["Chart", "ChartCurve", "Pane"],
        "embedding": ["PackedArrays", "chart_script", "embed_json", "read_static"],
        "operator_lock": ["OperatorLock"],
        "server": ["STATIC", "Site"],
        "templates": ["page_templates", "report_templates"],
        "theme": ["page_frame"],
        "tree": ["Leaf", "Tree"],
        "views": ["SIZES", "build_views"],
    },
)
