"""Execution of scenarios and reports of runs."""

import lazy_loader

from twin.callable_package import make_callable

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
make_callable(__name__)
