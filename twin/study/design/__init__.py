"""What varies from case to case: distributions with units, how they are sampled, and what that means for a case's members."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
