"""Many cases: an engine that steps them in one process, processes and clusters that have it, and what is kept of them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
