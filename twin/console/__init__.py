"""The console: a live session on a page of the browser, with charts, an animation, controls and a stop button.

The session runs in `twin.live`, which checks every command again. Packages above the engine add panels: see `panels`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
