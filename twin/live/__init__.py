"""Live sessions: a scenario that runs paced in its own process, controlled by an operator; its log reproduces it to the bit."""

import sys

import lazy_loader

from twin import CallablePackage

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
sys.modules[__name__].__class__ = CallablePackage
