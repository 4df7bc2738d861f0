"""The compiled loop: its plan, tables, recording, profiling, and what is reported when a step fails."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
