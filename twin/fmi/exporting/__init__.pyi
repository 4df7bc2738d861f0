from . import exporter as exporter
from . import fmu_cache as fmu_cache
from . import pythonfmu_export as pythonfmu_export
