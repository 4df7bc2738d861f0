"""Scenario files: runs and acceptance criteria in YAML with units; every error gives file and line."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
