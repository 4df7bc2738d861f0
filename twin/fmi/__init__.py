"""FMUs: description, export of components, import of anyone's."""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.fmi import archive, built, driven, exporter, markup, outline, pythonic, tables
    from twin.fmi.archive import unpack
    from twin.fmi.exchange_sensitivity import watched
    from twin.fmi.importer import FMUMember
    from twin.fmi.interface import member
    from twin.fmi.simulate import left, plan, simulate
    from twin.fmi.tables import Results
    from twin.fmi.unpacked import digest

__all__ = [
    "FMUMember",
    "Results",
    "archive",
    "built",
    "digest",
    "driven",
    "exporter",
    "left",
    "markup",
    "member",
    "outline",
    "plan",
    "pythonic",
    "simulate",
    "tables",
    "unpack",
    "watched",
]

__getattr__ = late.names(
    __name__,
    {
        "FMUMember": "importer",
        "Results": "tables",
        "archive": "",
        "built": "",
        "digest": "unpacked",
        "driven": "",
        "exporter": "",
        "left": "simulate",
        "member": "interface",
        "markup": "",
        "outline": "",
        "plan": "simulate",
        "pythonic": "",
        "simulate": "simulate",
        "tables": "",
        "unpack": "archive",
        "watched": "exchange_sensitivity",
    },
)
