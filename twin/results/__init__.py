"""Results of a run: signals, expressions over them, metrics and verdicts, plots, analyses, calibration, files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
