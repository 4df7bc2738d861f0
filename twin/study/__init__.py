"""Studies: one scenario many times, with factors that vary: Monte Carlo, sensitivity, worst case, tuning."""

import lazy_loader

from twin.callable_package import make_callable

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
make_callable(__name__)
