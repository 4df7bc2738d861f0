"""The object dictionary of CANopen, and the tables of CiA 301, 401 and 402."""

from hw_bridge.dictionary import cia301, cia401, cia402
from hw_bridge.dictionary.abort import Abort, Code, describe_abort_code
from hw_bridge.dictionary.cia301 import NmtState
from hw_bridge.dictionary.cia402 import Command, Mode, State, command_of, state_of, supported
from hw_bridge.dictionary.dictionary import Dictionary
from hw_bridge.dictionary.entry import (
    I8,
    I16,
    I32,
    OCTETS,
    TEXT,
    TYPES,
    U8,
    U16,
    U32,
    U64,
    Entry,
    NodeId,
    Value,
    record,
    sub,
    var,
)
from hw_bridge.dictionary.moves import BLOCKS_FAULHABER, BLOCKS_MAXON, METHODS, REVERSING, HomingEvent, Move

__all__ = [
    "BLOCKS_FAULHABER",
    "BLOCKS_MAXON",
    "I8",
    "I16",
    "I32",
    "METHODS",
    "OCTETS",
    "REVERSING",
    "TEXT",
    "TYPES",
    "U8",
    "U16",
    "U32",
    "U64",
    "Abort",
    "Code",
    "Command",
    "Dictionary",
    "Entry",
    "HomingEvent",
    "Mode",
    "Move",
    "NmtState",
    "NodeId",
    "State",
    "Value",
    "cia301",
    "cia401",
    "cia402",
    "command_of",
    "describe_abort_code",
    "record",
    "state_of",
    "sub",
    "supported",
    "var",
]
