"""Recordings and the model of each experiment, from the keys of an identify file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
