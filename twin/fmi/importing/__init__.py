"""Third-party FMUs as members of a co-simulation."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.fmi.importing import csv_source

__getattr__, _, _ = lazy_loader.attach(__name__, submodules=["csv_source"])

__all__ = ["csv_source"]
