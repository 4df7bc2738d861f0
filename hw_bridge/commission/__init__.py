"""Commissioning: scan a bus, read and write parameters, report status, enable and move a single drive."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
