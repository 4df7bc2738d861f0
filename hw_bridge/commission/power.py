"""Disable a drive by SDO that another program left enabled."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import Command, State, cia301, cia402, state_of
from hw_bridge.master import SilentError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.commission.sdo_session import SdoSession
    from hw_bridge.master import Node

STANDSTILL = 2_000 * MILLISECOND  # longest time of a quick stop [ns]
BRAKING = (State.ENABLED, State.QUICK_STOP, State.REACTION)  # it moves, or is on the way to a standstill
LOOK = 10 * MILLISECOND


def disable(sdo_session: SdoSession, node: Node) -> State:
    """Quick stop with its ramp (6085h), then disable the power stage; return the drive's state.

    A drive that does not answer may be in NMT Stopped, where it takes no SDO: it goes to Pre-operational first.
    """
    try:
        state = state_of(node.sdo.number(0x6041) & 0xFFFF)
    except SilentError:
        sdo_session.nmt(cia301.PRE_OPERATIONAL, node.number)
        state = state_of(node.sdo.number(0x6041) & 0xFFFF)
    if state in BRAKING:
        if state is State.ENABLED:
            _write(node, cia402.TYPICAL[Command.QUICK_STOP])
        end = sdo_session.network.now + STANDSTILL
        while sdo_session.network.now < end and state in BRAKING:
            speed = None
            with suppress(SimulationError):  # neither a lost answer nor a drive without 606Ch leaves its power on
                state = state_of(node.sdo.number(0x6041) & 0xFFFF)
                speed = int.from_bytes(node.sdo.read(0x606C), "little", signed=True)
            if state is State.QUICK_STOP and speed == 0:
                break
            sdo_session.wait(LOOK)
    _write(node, cia402.TYPICAL[Command.DISABLE_VOLTAGE])
    state = state_of(node.sdo.number(0x6041) & 0xFFFF)
    if state in (State.ENABLED, State.SWITCHED_ON, State.QUICK_STOP):
        raise SimulationError(
            f"{node.name}: is still in {state}: another program enables it again. End it, or press the emergency stop."
        )
    return state


def _write(node: Node, word: int) -> None:
    node.sdo.write(0x6040, 0, word.to_bytes(2, "little"))
