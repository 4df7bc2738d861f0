"""Parts shared by the pages: a local server, charts, a tree of signals, one style.

Modules are imported when a page is served: NiceGUI takes a second.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
