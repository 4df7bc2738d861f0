"""Scenes: environments of instruments, read from drawings, pictures of runs in them, and scenes in three dimensions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
