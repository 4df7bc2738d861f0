"""What pages in the browser share: a server for this machine alone, charts, a tree of signals, one style.

Nothing here is imported until a page is served: the library of the pages takes a second.
"""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.web import frames
    from twin.web.chart import Chart, Curve, Pane
    from twin.web.look import framed, styled
    from twin.web.seats import Seats
    from twin.web.server import STATIC, Site, needed
    from twin.web.tree import Leaf, Tree

__all__ = ["STATIC", "Chart", "Curve", "Leaf", "Pane", "Seats", "Site", "Tree", "framed", "frames", "needed", "styled"]

__getattr__ = late.names(
    __name__,
    {
        "Chart": "chart",
        "Curve": "chart",
        "Leaf": "tree",
        "Pane": "chart",
        "STATIC": "server",
        "Seats": "seats",
        "Site": "server",
        "Tree": "tree",
        "framed": "look",
        "frames": "",
        "needed": "server",
        "styled": "look",
    },
)
