"""The console: a live session on a page of the browser, with charts, an animation, controls and a stop button.

The session runs in `twin.live`, which checks every command again. Packages above the engine add panels: see `panels`.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.console.joysticks import Desk, control
    from twin.console.page import register
    from twin.console.session import Host, Panel

__all__ = ["Desk", "Host", "Panel", "control", "register"]

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "joysticks": ["Desk", "control"],
        "page": ["register"],
        "session": ["Host", "Panel"],
    },
)
