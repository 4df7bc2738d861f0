"""FMUs: description, export of components, import of anyone's."""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.fmi import built, exporter, pythonic, tables
    from twin.fmi.archive import unpack
    from twin.fmi.importer import FMUMember
    from twin.fmi.simulate import left, plan, simulate
    from twin.fmi.tables import Results

__all__ = [
    "FMUMember",
    "Results",
    "built",
    "exporter",
    "left",
    "plan",
    "pythonic",
    "simulate",
    "tables",
    "unpack",
]

__getattr__ = late.names(
    __name__,
    {
        "FMUMember": "importer",
        "Results": "tables",
        "built": "",
        "exporter": "",
        "left": "simulate",
        "plan": "simulate",
        "pythonic": "",
        "simulate": "simulate",
        "tables": "",
        "unpack": "archive",
    },
)
