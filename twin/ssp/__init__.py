"""Reader and writer for System Structure and Parameterization (SSP) 1.0 and 2.0."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
