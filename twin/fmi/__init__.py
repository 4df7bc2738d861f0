"""FMUs: description, export of components, import of anyone's."""

from twin.fmi import exporter, tables
from twin.fmi.archive import unpack
from twin.fmi.importer import FMUMember
from twin.fmi.simulate import plan, simulate
from twin.fmi.tables import Results

__all__ = [
    "FMUMember",
    "Results",
    "exporter",
    "plan",
    "simulate",
    "tables",
    "unpack",
]
