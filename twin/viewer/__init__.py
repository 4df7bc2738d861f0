"""Viewer of recorded runs, served or as a self-contained page: signals, overlays, differences, spectra, failed expectations."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
