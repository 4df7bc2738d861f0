"""Solve a substep of both chains by elimination with the stick/slip active set of the previous substep.

Thrust is linear in motion as long as each section stays pressed, pulled, within its play or buckled, and each node sticks
or slides one way. What a solution contradicts is corrected, and the chains are eliminated again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fmus.instrument.model import Instrument

TRIALS = 16  # most solutions in a substep

# state of a section: -1 pulled, 0 within its play, 1 pressed, and
BUCKLED = 2.0

# contradictions below these are rounding: positions [m] and forces [N], angles [rad] and torques [N*m]
SHIFT, FORCE = 1e-14, 1e-9
TURN, TORQUE = 1e-13, 1e-13

# what a solution turned out to be; SHARED: a grip slips, or a node's axial and torsional friction share one limit
AGREES, CONTRADICTS, SHARED = 0, 1, 2


def eliminate(self: Instrument, rate: float) -> bool:
    """One implicit Euler step of 1 / `rate` [s]; False, and nothing has moved, if limits are shared or no solution agrees."""
    for _ in range(TRIALS):
        outcome = solve(self)
        if outcome != CONTRADICTS:
            return outcome == AGREES
        factor(self, rate)
    return False


def begin(self: Instrument, rate: float) -> None:
    """Update the section states and refactor after a change of sections or grips."""
    for j in range(3):
        self.section_state[j] = state(self, j, self.position[j] - self.position[j + 1])
    factor(self, rate)


def update_active_set(self: Instrument) -> None:
    """Initialize the stick/slip active set from the last Gauss-Seidel result."""
    for j in range(3):
        self.slide[j] = sign(self.position[j + 1] - self.position_last[j + 1])
        self.turn[j] = sign(self.angle[j + 1] - self.angle_last[j + 1])


def factor(self: Instrument, rate: float) -> None:
    """Thrusts and torques while nothing moves, and each node's motion as a function of the node before it, from the tip on."""
    pressed = sign(self.tip_force)
    behind = behind_angle = 0.0  # stiffness of all that is behind a node
    for j in range(2, -1, -1):
        pressed_behind, pressed = pressed, min(self.section_state[j], 1.0)
        spring = self.stiffness[j] if abs(self.section_state[j]) == 1.0 else 0.0
        gap = self.position[j] - self.position[j + 1] - pressed * self.half_play[j]
        self.thrust[j + 1] = self.buckling_load if self.section_state[j] == BUCKLED else spring * gap

        # a bend's friction is a part of the thrusts on both sides
        capstan = self.slide[j] * self.capstan[j]
        into, out = 1.0 - capstan * pressed, 1.0 + capstan * pressed_behind
        compliance = moves(self.slide[j], rate * self.viscous[j] + into * spring + out * behind)
        self.spring[j] = spring
        self.per_thrust[j] = compliance * into
        self.per_load[j] = compliance * out
        self.per_friction[j] = compliance * self.slide[j] * self.dry[j]
        self.along[j] = spring * self.per_thrust[j]
        self.passed_load[j] = spring * self.per_load[j]
        self.passed_friction[j] = spring * self.per_friction[j]
        behind = spring - spring * self.along[j]

        spring = self.torsional_stiffness[j]
        self.twist_torque[j + 1] = spring * (self.angle[j] - self.angle[j + 1])
        self.per_torque[j] = moves(self.turn[j], rate * self.torsional_drag + spring + behind_angle)
        self.along_angle[j] = spring * self.per_torque[j]
        behind_angle = spring - spring * self.along_angle[j]
    self.thrust[4] = self.tip_force
    self.twist_torque[4] = self.tip_torque
    self.per_push = 1.0 / (rate * self.drag_free + behind + self.grip_stiffness[0] + self.grip_stiffness[1])
    stiffness = self.grip_torsional_stiffness[0] + self.grip_torsional_stiffness[1]
    self.per_turn = 1.0 / (rate * self.torsional_drag + behind_angle + stiffness)


def moves(slide: float, rigidity: float) -> float:
    """Compliance of a node: none if it sticks."""
    return 1.0 / rigidity if slide != 0.0 else 0.0


def solve(self: Instrument) -> int:
    """Apply the solution if it is consistent with its active set; otherwise correct the active set."""
    agreed, moved_0, moved_1, moved_2, moved_3, thrust_1, thrust_2, thrust_3 = shifted(self)
    if not agreed:
        return CONTRADICTS
    agreed, turned_0, turned_1, turned_2, turned_3, torque_1, torque_2, torque_3 = turned(
        self, thrust_1, thrust_2, thrust_3
    )
    if not agreed:
        return CONTRADICTS
    is_separate = (
        separate(self, 0, thrust_1, thrust_2, torque_1 - torque_2)
        and separate(self, 1, thrust_2, thrust_3, torque_2 - torque_3)
        and separate(self, 2, thrust_3, self.tip_force, torque_3 - self.tip_torque)
    )
    if not is_separate:
        return SHARED

    # within rounding: a position that does not change by rounding is no motion of a grip either
    x, angle = self.position[0] + moved_0, self.angle[0] + turned_0
    moved_0, turned_0 = x - self.position[0], angle - self.angle[0]
    if not (sticks(self, 0, moved_0, turned_0) and sticks(self, 1, moved_0, turned_0)):
        return SHARED
    for g in range(2):
        self.deflection[g] -= moved_0
        self.twist[g] -= turned_0
    for i in range(4):
        self.position_last[i] = self.position[i]
        self.angle_last[i] = self.angle[i]
    self.position[0] = x
    self.position[1] += moved_1
    self.position[2] += moved_2
    self.position[3] += moved_3
    self.angle[0] = angle
    self.angle[1] += turned_1
    self.angle[2] += turned_2
    self.angle[3] += turned_3
    self.thrust[1], self.thrust[2], self.thrust[3] = thrust_1, thrust_2, thrust_3
    self.twist_torque[1], self.twist_torque[2], self.twist_torque[3] = torque_1, torque_2, torque_3
    return AGREES


def shifted(self: Instrument) -> tuple[bool, float, float, float, float, float, float, float]:
    """Whether the axial solution agrees, how far each node moves, and the thrusts after that."""
    thrust_1, thrust_2, thrust_3, tip = self.thrust[1], self.thrust[2], self.thrust[3], self.tip_force

    # from the tip: what each node does alone, and the thrust that is left in the section before it
    alone_3 = self.per_thrust[2] * thrust_3 - self.per_friction[2] - self.per_load[2] * tip
    load_3 = thrust_3 - self.spring[2] * alone_3
    alone_2 = self.per_thrust[1] * thrust_2 - self.per_friction[1] - self.per_load[1] * load_3
    load_2 = thrust_2 - self.along[1] * thrust_2 + self.passed_friction[1] + self.passed_load[1] * load_3
    alone_1 = self.per_thrust[0] * thrust_1 - self.per_friction[0] - self.per_load[0] * load_2
    load_1 = thrust_1 - self.along[0] * thrust_1 + self.passed_friction[0] + self.passed_load[0] * load_2

    # and back from the grips
    push = self.grip_stiffness[0] * self.deflection[0] + self.grip_stiffness[1] * self.deflection[1]
    moved_0 = self.per_push * (push - load_1)
    moved_1 = alone_1 + self.along[0] * moved_0
    moved_2 = alone_2 + self.along[1] * moved_1
    moved_3 = alone_3 + self.along[2] * moved_2
    thrust_1 += self.spring[0] * (moved_0 - moved_1)
    thrust_2 += self.spring[1] * (moved_1 - moved_2)
    thrust_3 += self.spring[2] * (moved_2 - moved_3)

    force_1, limit_1 = thrust_1 - thrust_2, friction(self, 0, thrust_1, thrust_2)
    force_2, limit_2 = thrust_2 - thrust_3, friction(self, 1, thrust_2, thrust_3)
    force_3, limit_3 = thrust_3 - tip, friction(self, 2, thrust_3, tip)
    agreed = (
        is_consistent(self, 0, thrust_1, moved_0 - moved_1)
        and is_consistent(self, 1, thrust_2, moved_1 - moved_2)
        and is_consistent(self, 2, thrust_3, moved_2 - moved_3)
        and agrees(self.slide[0], moved_1, force_1, limit_1, SHIFT, FORCE)
        and agrees(self.slide[1], moved_2, force_2, limit_2, SHIFT, FORCE)
        and agrees(self.slide[2], moved_3, force_3, limit_3, SHIFT, FORCE)
    )
    if not agreed:
        self.section_state[0] = state(self, 0, self.position[0] - self.position[1] + moved_0 - moved_1)
        self.section_state[1] = state(self, 1, self.position[1] - self.position[2] + moved_1 - moved_2)
        self.section_state[2] = state(self, 2, self.position[2] - self.position[3] + moved_2 - moved_3)
        self.slide[0] = slides(self.slide[0], moved_1, force_1, limit_1, SHIFT, FORCE)
        self.slide[1] = slides(self.slide[1], moved_2, force_2, limit_2, SHIFT, FORCE)
        self.slide[2] = slides(self.slide[2], moved_3, force_3, limit_3, SHIFT, FORCE)
    return agreed, moved_0, moved_1, moved_2, moved_3, thrust_1, thrust_2, thrust_3


def turned(
    self: Instrument, thrust_1: float, thrust_2: float, thrust_3: float
) -> tuple[bool, float, float, float, float, float, float, float]:
    """The same in torsion, with the friction that these thrusts give."""
    torque_1, torque_2, torque_3 = self.twist_torque[1], self.twist_torque[2], self.twist_torque[3]
    tip = self.tip_torque
    limit_1 = self.radius * friction(self, 0, thrust_1, thrust_2)
    limit_2 = self.radius * friction(self, 1, thrust_2, thrust_3)
    limit_3 = self.radius * friction(self, 2, thrust_3, self.tip_force)
    free_1 = torque_1 - self.turn[0] * limit_1
    free_2 = torque_2 - self.turn[1] * limit_2
    free_3 = torque_3 - self.turn[2] * limit_3
    alone_3 = self.per_torque[2] * (free_3 - tip)
    load_3 = torque_3 - self.along_angle[2] * (free_3 - tip)
    alone_2 = self.per_torque[1] * (free_2 - load_3)
    load_2 = torque_2 - self.along_angle[1] * free_2 + self.along_angle[1] * load_3
    alone_1 = self.per_torque[0] * (free_1 - load_2)
    load_1 = torque_1 - self.along_angle[0] * free_1 + self.along_angle[0] * load_2

    push = self.grip_torsional_stiffness[0] * self.twist[0] + self.grip_torsional_stiffness[1] * self.twist[1]
    turned_0 = self.per_turn * (push - load_1)
    turned_1 = alone_1 + self.along_angle[0] * turned_0
    turned_2 = alone_2 + self.along_angle[1] * turned_1
    turned_3 = alone_3 + self.along_angle[2] * turned_2
    torque_1 += self.torsional_stiffness[0] * (turned_0 - turned_1)
    torque_2 += self.torsional_stiffness[1] * (turned_1 - turned_2)
    torque_3 += self.torsional_stiffness[2] * (turned_2 - turned_3)

    force_1, force_2, force_3 = torque_1 - torque_2, torque_2 - torque_3, torque_3 - tip
    agreed = (
        agrees(self.turn[0], turned_1, force_1, limit_1, TURN, TORQUE)
        and agrees(self.turn[1], turned_2, force_2, limit_2, TURN, TORQUE)
        and agrees(self.turn[2], turned_3, force_3, limit_3, TURN, TORQUE)
    )
    if not agreed:
        self.turn[0] = slides(self.turn[0], turned_1, force_1, limit_1, TURN, TORQUE)
        self.turn[1] = slides(self.turn[1], turned_2, force_2, limit_2, TURN, TORQUE)
        self.turn[2] = slides(self.turn[2], turned_3, force_3, limit_3, TURN, TORQUE)
    return agreed, turned_0, turned_1, turned_2, turned_3, torque_1, torque_2, torque_3


def separate(self: Instrument, j: int, near: float, far: float, torque: float) -> bool:
    """Whether the friction of a node is only axial or only torsional, or holds both together."""
    force = near - far
    limit = friction(self, j, near, far)
    if abs(force) <= FORCE or abs(torque) <= TORQUE or limit <= 0.0 or self.radius <= 0.0:
        return True
    if self.slide[j] != 0.0 or self.turn[j] != 0.0:
        return False
    arm = torque / self.radius
    return force * force + arm * arm <= (limit + FORCE) * (limit + FORCE)


def sticks(self: Instrument, g: int, moved: float, turned: float) -> bool:
    """Whether a grip is within its ellipse; sets its force and torque."""
    force = self.grip_stiffness[g] * (self.deflection[g] - moved)
    torque = self.grip_torsional_stiffness[g] * (self.twist[g] - turned)
    self.grip_force[g] = force
    self.grip_torque[g] = torque
    limit = self.limit_distal[g] if force > 0.0 else self.limit_proximal[g]
    torque_limit = self.torque_limit[g]
    a, b, c = force * torque_limit, torque * limit, limit * torque_limit
    return abs(force) <= limit and abs(torque) <= torque_limit and a * a + b * b <= c * c


def sign(value: float) -> float:
    """-1, 0 or 1."""
    if value > 0.0:
        return 1.0
    return -1.0 if value < 0.0 else 0.0


def is_consistent(self: Instrument, j: int, thrust: float, moved: float) -> bool:
    """Whether a section is still in the state that its thrust was computed for."""
    if abs(self.section_state[j]) == 1.0:
        return self.section_state[j] * thrust >= -FORCE and (j > 0 or thrust <= self.buckling_load)
    return state(self, j, self.position[j] - self.position[j + 1] + moved) == self.section_state[j]


def state(self: Instrument, j: int, gap: float) -> float:
    """State of a section at a difference of its ends' positions [m]: as it was, but for more than rounding."""
    before, play = self.section_state[j], self.half_play[j]
    side = min(before, 1.0)
    if side == 0.0 or side * gap < play - SHIFT:
        side = 0.0 if abs(gap) <= play + SHIFT else sign(gap)
    if j == 0 and side == 1.0:
        beyond = self.stiffness[0] * (gap - play) - self.buckling_load
        if beyond >= 0.0 or (before == BUCKLED and beyond > -FORCE):
            return BUCKLED
    return side


def friction(self: Instrument, j: int, near: float, far: float) -> float:
    """Friction of the node behind a section [N] between two thrusts."""
    return self.dry[j] + self.capstan[j] * (abs(near) + abs(far))


def agrees(slide: float, moved: float, force: float, limit: float, shift: float, rounding: float) -> bool:
    """Whether a node slides, or sticks, as it was meant to."""
    return slide * moved >= -shift if slide != 0.0 else abs(force) <= limit + rounding


def slides(slide: float, moved: float, force: float, limit: float, shift: float, rounding: float) -> float:
    """Sliding direction of a node; it sticks where friction would have to push it, until its limit is exceeded."""
    if agrees(slide, moved, force, limit, shift, rounding):
        return slide
    return sign(force) if slide == 0.0 else 0.0
