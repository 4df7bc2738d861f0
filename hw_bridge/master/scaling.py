"""Objects from which the units of a drive follow: read from the drive, or assumed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import describe_abort_code
from hw_bridge.master.sdo import MISSING, SdoError
from hw_bridge.master.writes import read, upload
from hw_bridge.profiles import MOTORS, SCALING, disagreement, magnetic_pitch, motor_parameters, symbol

if TYPE_CHECKING:
    from hw_bridge.master.node import Node

POLARITY, OF_POSITIONS, OF_VELOCITIES = 0x607E, 0x80, 0x40
RATED_CURRENTS = ((0x6075, 0), (0x2329, 1))  # of CiA 402; of a FAULHABER V3.0, whose EDS has the first one not


def learn_scaling(node: Node) -> None:
    """Read the scaling objects of a drive; `node.own.assumed` then has a line for each that cannot be read.

    A value of `scaling` in the hardware file replaces an object that the drive does not have.
    """
    node.own.assumed = []
    for index in SCALING:
        for entry in tuple(node.mirror.objects.get(index, {}).values()):
            if index not in node.mirror or not entry.readable or (not entry.sub and entry.title):
                continue
            address = entry.index, entry.sub
            try:
                read(node, *address)
            except SdoError:
                if address in node.keys.scaling:
                    node.mirror.values[address] = node.keys.scaling[address]
                elif address in RATED_CURRENTS and _has_other_current(node, address):
                    node.mirror.remove(index)
                elif address in node.profile.scaling:
                    node.own.assumed.append(
                        f"{index:04X}h.{entry.sub} {entry.name} does not answer, {node.mirror.get(*address)} is assumed"
                    )
    for address in ((POLARITY, 0), *node.profile.optional_scaling):
        try:
            node.mirror.values[address] = int.from_bytes(upload(node, *address), "little")
        except SdoError as error:
            node.mirror.values.pop(address, None)
            if address in node.keys.scaling:
                node.mirror.values[address] = node.keys.scaling[address]
            elif error.code not in MISSING:
                node.own.assumed.append(
                    f"{address[0]:04X}h.{address[1]} cannot be read: {describe_abort_code(error.code)}"
                )
    node.own.assumed += _unequal_polarity(node.mirror.get(POLARITY), node.has_target_force)
    node.own.assumed += _unstated_units(node)
    try:
        node.own.assumed += node.profile.unsure(node.mirror, magnetic_pitch(node.keys.motor))
        node.use_units()
    except ZeroDivisionError:
        for index, sub in node.profile.scaling:
            default = node.mirror.entry(index, sub).default
            if default and not node.mirror.get(index, sub):
                node.mirror.values[index, sub] = default  # so that the rest of what a run would write can be shown
                node.own.assumed.append(f"{index:04X}h.{sub} is 0")
        node.use_units()


def _unequal_polarity(polarity: int, forces: bool) -> list[str]:
    """Return a line if 607Eh reverses positions but not velocities, or the reverse: a loop over both would diverge.

    Forces have no bit in it (CiA 402): a target force would push the other way, and away from where a loop wants it.
    """
    kinds = {bool(polarity & OF_POSITIONS): "positions", bool(polarity & OF_VELOCITIES): "velocities"}
    if len(kinds) == 1:
        reversed_motion = f"607Eh is {polarity:X}h: positions and velocities are reversed, target forces are not"
        return [reversed_motion] if forces and True in kinds else []
    return [f"607Eh is {polarity:X}h: {kinds[True]} are reversed, {kinds[False]} are not"]


def _unstated_units(node: Node) -> list[str]:
    """Return a line for each unit that neither an object of the drive nor the hardware file states.

    A drive on a bus in simulated time is simulated from the same profile, so that its units are the profile's.
    """
    if node.in_simulated_time:
        return []
    axis = node.profile.motor.unit
    return [
        f"no object states the unit of {kind}, nor does the hardware file; add it as the vendor's manual has it, such as "
        f"`units: {{{kind}: 1 m{symbol(kind, axis)}}}`"
        for kind in node.profile.unstated_units
    ]


def _has_other_current(node: Node, address: tuple[int, int]) -> bool:
    """Whether the drive has its rated current in another object than this one."""
    for other in RATED_CURRENTS:
        if other != address and node.mirror.find(*other):
            try:
                return int.from_bytes(upload(node, *other), "little") > 0
            except SdoError:
                continue
    return False


def wrong_motor(node: Node) -> str:
    """Problem text if the drive is set up for another motor than the hardware file names, else empty."""
    if node.keys.motor not in MOTORS:
        return ""
    motor = motor_parameters(node.profile, node.keys.motor)
    addresses = motor.scaling.get(node.profile.name, {})
    stored = {
        address: node.mirror.get(*address)
        for address in addresses
        if node.keys.scaling.get(address) != node.mirror.get(*address)
    }
    if not (text := disagreement(node.profile, motor, stored)):
        return ""
    return (
        f"{node.name}: the drive is set up for another motor than {motor.title}: {text}. Correct `motor` of the hardware "
        f"file, or set the drive up for its motor (twin hil set). It is not written."
    )


def unknown_scale(node: Node) -> str:
    """Problem text if a scale of the drive is only assumed, so that it is not moved; else empty."""
    if not node.own.assumed:
        return ""
    return (
        f"{node.name}: its scale is ASSUMED: {'; '.join(node.own.assumed)}. It is not moved. Give what is missing under `units`, "
        f"`motor` or `scaling` in the hardware file."
    )
