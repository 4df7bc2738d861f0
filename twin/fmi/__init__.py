"""FMUs: description, export of components, import of third-party FMUs."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.fmi import archive, csv_tables, fmu_info, xml_checks
    from twin.fmi.archive import unpack
    from twin.fmi.csv_tables import Results
    from twin.fmi.exporting import exporter, fmu_cache, pythonfmu_export
    from twin.fmi.importing import csv_source
    from twin.fmi.importing.fmu_member import FMUMember
    from twin.fmi.importing.member_factory import member
    from twin.fmi.importing.restart import continuous_states, restart, restart_problem
    from twin.fmi.importing.unpacked import digest
    from twin.fmi.model_exchange.sensitivity import watched
    from twin.fmi.simulation import left, plan, simulate

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules={"archive", "csv_tables", "fmu_info", "xml_checks"},
    submod_attrs={
        "archive": ["unpack"],
        "csv_tables": ["Results"],
        "exporting": ["exporter", "fmu_cache", "pythonfmu_export"],
        "importing": ["csv_source"],
        "importing.fmu_member": ["FMUMember"],
        "importing.member_factory": ["member"],
        "importing.restart": ["continuous_states", "restart", "restart_problem"],
        "importing.unpacked": ["digest"],
        "model_exchange.sensitivity": ["watched"],
        "simulation": ["left", "plan", "simulate"],
    },
)

__all__ = [
    "FMUMember",
    "Results",
    "archive",
    "continuous_states",
    "csv_source",
    "csv_tables",
    "digest",
    "exporter",
    "fmu_cache",
    "fmu_info",
    "left",
    "member",
    "plan",
    "pythonfmu_export",
    "restart",
    "restart_problem",
    "simulate",
    "unpack",
    "watched",
    "xml_checks",
]
