"""The console: a live twin on a page of the browser, with charts, a picture that moves, hands on it, and a stop.

The engine is `twin.live`; what a page asks for is checked there again. Packages above add panels: see `panels`.
"""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.console.desk import Desk, control
    from twin.console.page import register
    from twin.console.session import Host, Panel

__all__ = ["Desk", "Host", "Panel", "control", "register"]

__getattr__ = late.names(
    __name__, {"Desk": "desk", "Host": "session", "Panel": "session", "control": "desk", "register": "page"}
)
