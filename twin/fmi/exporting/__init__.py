"""Components exported as FMUs."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.fmi.exporting import exporter, fmu_cache, pythonfmu_export

__getattr__, _, _ = lazy_loader.attach(__name__, submodules=["exporter", "fmu_cache", "pythonfmu_export"])

__all__ = ["exporter", "fmu_cache", "pythonfmu_export"]
