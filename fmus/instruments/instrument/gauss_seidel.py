"""A substep of both chains node by node: slower than by elimination, but it always ends, and grips may slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.instrument.elimination import FORCE, TORQUE, friction
from fmus.instrument.ellipse import multiplier

from fmus.dead_zone import dead_zone

if TYPE_CHECKING:
    from fmus.instrument.model import Instrument

SWEEPS = 40  # most sweeps in a substep
FORCE_TOLERANCE = 1e-4  # what a node may be off balance [N]
TORQUE_TOLERANCE = 1e-8  # the same in torsion [N*m]
TIP = 3  # the last node
LEAST = 1e-9  # limit of force [N] or torque [N*m] below which there is no grip


def sweep(self: Instrument, dt: float) -> None:
    """One implicit Euler step of `dt` [s]: forth and back until the nodes rest, then slip becomes permanent."""
    for i in range(TIP + 1):
        # beginning where steady motion would lead
        ahead = 2.0 * self.position[i] - self.position_last[i]
        self.position_last[i] = self.position[i]
        self.position[i] = ahead
        ahead = 2.0 * self.angle[i] - self.angle_last[i]
        self.angle_last[i] = self.angle[i]
        self.angle[i] = ahead
    for _ in range(SWEEPS):
        unrest = 0.0
        for i in range(TIP + 1):
            unrest = max(unrest, relax(self, i, dt))
        for i in range(TIP - 1, -1, -1):
            unrest = max(unrest, relax(self, i, dt))
        if unrest < 1.0:
            break
    for g in range(2):
        settle_grip(self, g)
    for i in range(1, TIP + 2):
        load_section(self, i)


def relax(self: Instrument, i: int, dt: float) -> float:
    """Move node i to where the energy of the substep is least, all others held; it sticks exactly within its friction.

    Returns what it was off balance, relative to what is allowed.
    """
    load_section(self, i)
    load_section(self, i + 1)
    force = self.thrust[i] - self.thrust[i + 1]
    torque = self.twist_torque[i] - self.twist_torque[i + 1]
    drag = self.drag_free
    limit = torque_limit = stiffness = torsional_stiffness = 0.0
    if i <= 0:
        for g in range(2):
            load_grip(self, g)
            force += self.grip_force[g]
            torque += self.grip_torque[g]
            stiffness += self.grip_stiffness[g]
            torsional_stiffness += self.grip_torsional_stiffness[g]
    else:
        j = i - 1
        stiffness += self.stiffness[j]
        torsional_stiffness += self.torsional_stiffness[j]
        drag = self.viscous[j]
        limit = friction(self, j, self.thrust[i], self.thrust[i + 1])
        torque_limit = self.radius * limit
    if i < TIP:
        stiffness += self.stiffness[i]
        torsional_stiffness += self.torsional_stiffness[i]

    rigidity = stiffness + drag / dt
    torsional_rigidity = torsional_stiffness + self.torsional_drag / dt
    moved = self.position[i] - self.position_last[i]
    turned = self.angle[i] - self.angle_last[i]
    force += stiffness * moved
    torque += torsional_stiffness * turned

    # friction is against the sliding, which has one direction: where the node slides both ways, they share it
    if force != 0.0 and torque != 0.0 and limit > FORCE and torque_limit > TORQUE:
        radius = torque_limit / limit
        m = multiplier(abs(force) / limit, abs(torque) / torque_limit, rigidity, torsional_rigidity / (radius * radius))
        force -= force / (1.0 + m * rigidity)
        torque -= torque / (1.0 + m * torsional_rigidity / (radius * radius))
    else:
        force, torque = dead_zone(force, limit), dead_zone(torque, torque_limit)
    change = force / rigidity - moved
    self.position[i] += change
    turn = torque / torsional_rigidity - turned
    self.angle[i] += turn
    return max(rigidity * abs(change) / FORCE_TOLERANCE, torsional_rigidity * abs(turn) / TORQUE_TOLERANCE)


def load_section(self: Instrument, i: int) -> None:
    """Thrust and torque that node i gets from the one before it; beyond the tip: the loads."""
    if i <= 0:
        return
    if i > TIP:
        self.thrust[i] = self.tip_force
        self.twist_torque[i] = self.tip_torque
        return
    j = i - 1
    thrust = self.stiffness[j] * dead_zone(self.position[j] - self.position[i], self.half_play[j])
    if i == 1:
        thrust = min(thrust, self.buckling_load)
    self.thrust[i] = thrust
    self.twist_torque[i] = self.torsional_stiffness[j] * (self.angle[j] - self.angle[i])


def load_grip(self: Instrument, g: int) -> None:
    """Force and torque of a gripper: elastic within an ellipse of its limits, else the nearest point on the ellipse.

    Nearest in elastic energy, so that slip follows the ellipse's normal: force and torque fade where the other one slips.
    """
    stiffness = self.grip_stiffness[g]
    torsional_stiffness = self.grip_torsional_stiffness[g]
    force = stiffness * (self.deflection[g] - (self.position[0] - self.position_last[0]))
    torque = torsional_stiffness * (self.twist[g] - (self.angle[0] - self.angle_last[0]))
    limit = self.limit_distal[g] if force > 0.0 else self.limit_proximal[g]
    torque_limit = self.torque_limit[g]
    a = b = p = q = 0.0
    if limit > LEAST:
        a = abs(force) / limit
        p = stiffness / (limit * limit)
    else:
        force = 0.0
    if torque_limit > LEAST:
        b = abs(torque) / torque_limit
        q = torsional_stiffness / (torque_limit * torque_limit)
    else:
        torque = 0.0
    self.grip_force[g] = force
    self.grip_torque[g] = torque
    if a * a + b * b <= 1.0:
        return

    m = multiplier(a, b, p, q)
    self.grip_force[g] = force / (1.0 + m * p)
    self.grip_torque[g] = torque / (1.0 + m * q)


def settle_grip(self: Instrument, g: int) -> None:
    """Take over the deflection that is left of a substep's motion; the rest has slipped."""
    load_grip(self, g)
    trial = self.deflection[g] - (self.position[0] - self.position_last[0])
    trial_twist = self.twist[g] - (self.angle[0] - self.angle_last[0])
    stiffness, torsional_stiffness = self.grip_stiffness[g], self.grip_torsional_stiffness[g]
    left = self.grip_force[g] / stiffness if stiffness > 0.0 else 0.0
    twist_left = self.grip_torque[g] / torsional_stiffness if torsional_stiffness > 0.0 else 0.0
    self.deflection[g] = left
    self.twist[g] = twist_left
    count_slip(self, g, trial - left, trial_twist - twist_left)


def count_slip(self: Instrument, g: int, lost: float, lost_twist: float) -> None:
    """Deflection [m] and twist [rad] that a grip has lost are slip if it counts as closed; rounding is none."""
    if holds(self, g) and (abs(lost) > 1e-12 or abs(lost_twist) > 1e-9):
        self.slipped[g] -= lost
        self.slipped_angle[g] -= lost_twist
        self.slipping[g] = True


def holds(self: Instrument, g: int) -> bool:
    """Whether a gripper counts as closed."""
    return max(self.limit_distal[g], self.limit_proximal[g]) > self.grip_least
