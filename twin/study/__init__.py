"""Studies: one scenario many times, with factors that vary: Monte Carlo, sensitivity, worst case, tuning."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
