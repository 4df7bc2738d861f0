"""SDO abort codes of CiA 301, and the exception that carries one."""

from __future__ import annotations

from enum import IntEnum


class Code(IntEnum):
    """SDO abort codes."""

    TOGGLE = 0x05030000
    TIMEOUT = 0x05040000
    COMMAND_UNKNOWN = 0x05040001
    MEMORY = 0x05040005
    UNSUPPORTED_ACCESS = 0x06010000
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_LENGTH = 0x06040042
    PARAMETER_INCOMPATIBLE = 0x06040043
    HARDWARE = 0x06060000
    LENGTH = 0x06070010
    TOO_LONG = 0x06070012
    TOO_SHORT = 0x06070013
    NO_SUBINDEX = 0x06090011
    VALUE_RANGE = 0x06090030
    VALUE_TOO_HIGH = 0x06090031
    VALUE_TOO_LOW = 0x06090032
    CANNOT_STORE = 0x08000020
    DEVICE_STATE = 0x08000022
    NO_DATA = 0x08000024


class Abort(Exception):  # noqa: N818 - the word of CiA 301
    """Abort of an SDO transfer; the client gets the code."""

    def __init__(self, code: Code) -> None:
        super().__init__(f"{code:08X} {code.name.lower().replace('_', ' ')}")
        self.code = code


def describe_abort_code(code: int) -> str:
    """Describe an abort code."""
    try:
        return Code(code).name.lower().replace("_", " ")
    except ValueError:
        return "no code of CiA 301"
