"""Injection catheters: slides, friction, play and needle that the paper's models have in common."""

from __future__ import annotations

from typing import Any

from fmus.injection import MILLIMETER, InjectionModel, needle_limits
from fmus.noisy import Noisy
from twin.component import Component, input, local, output, parameter, terminal

PLAYS = 3
PULL_MAXIMUM = 9.0  # longest pull that eqs. (4) and (5) hold for [mm]


class SingleWireCatheter(Component):
    """One pull wire, planar: slides and tip."""

    handle_position = input("m", "slide of the inner handle, positive distal", display_unit="mm", nominal=10e-3)
    wire_position = input("m", "slide of the pull wire, positive: pulled", display_unit="mm", nominal=8e-3)
    needle_position = input("m", "slide of the needle, positive distal", display_unit="mm", nominal=10e-3)

    tip_y = output("m", "tip across the catheter, positive to the wire's side", display_unit="mm")
    tip_z = output("m", "tip along the catheter, from its place at the start, positive distal", display_unit="mm")
    needle_length = output("m", "needle outside of the tip; negative: still inside", display_unit="mm")
    handle_force = output("N", "force of the catheter on the handle's slide, positive distal")
    wire_force = output("N", "force of the wire on its slide, positive: pulled further")
    needle_force = output("N", "force of the needle on its slide, positive distal")

    tip = terminal("the tip and the needle", rule="bus", y=tip_y, z=tip_z, needle_length=needle_length)
    handle_slide = terminal("slide of the inner handle", position=handle_position, force=handle_force)
    wire_slide = terminal("slide of the pull wire", position=wire_position, force=wire_force)
    needle_slide = terminal("slide of the needle", position=needle_position, force=needle_force)


class MeasuredCatheter(InjectionModel, Noisy):
    """The paper's equations with play operators between what was measured."""

    play_spread = parameter(
        0.3,
        "",
        "first and last part of the catheter to move: by this part before and after the mean",
        minimum=0.0,
        maximum=1.0,
        source="estimate: the guide bends gradually and the text does not give moves that stop in the play",
    )
    wire_play = parameter(
        0.03,
        "",
        "pull [mm] that a release must go back before the tip does",
        minimum=0.0,
        source="estimate: at most that, or points on release would shift the mean of y, which the paper found to be zero",
    )
    deviation_needle = parameter(
        0.025,
        "",
        "standard deviation [mm] of the needle",
        minimum=0.0,
        source="paper: 0.042 mm after calibration, less slide (0.052 by 0.44) and camera",
    )
    correlation_length = parameter(
        2.0,
        "",
        "travel [mm] over which the deviations change",
        minimum=1e-3,
        source="estimate: the clearance in the guide, 0.8 mm, by two or three",
    )
    guide_friction = parameter(
        4.0,
        "N",
        "friction of the catheter in its guide",
        minimum=0.0,
        source="estimate: PTFE on a catheter through the aortic arch, 2 to 6 N",
    )
    needle_friction = parameter(
        1.0,
        "N",
        "friction of the needle's tube",
        minimum=0.0,
        source="estimate: a tube that bends in a wider lumen, a few tenths to 2 N",
    )

    handle_last = local(0.0, "", "handle position [mm] of the last step")
    plays = local(0.0, "", "ends of the play operators of the handle [mm]", shape=(PLAYS,))
    needle_set = local(0.0, "", "length [mm] that the needle's actuator has set")
    error_y = local(0.0, "", "deviation in y in standard deviations: last, behind a lag", shape=(2,))
    error_z = local(0.0, "", "deviation along in standard deviations: last, behind a lag", shape=(2,))
    error_needle = local(0.0, "", "deviation of the needle in standard deviations: last, behind a lag", shape=(2,))


def initialize_plays(self: Any) -> None:
    """Begin as the bench does: pushed in, and protruded."""
    for i in range(2):
        self.error_y[i] = 0.0
        self.error_z[i] = 0.0
        self.error_needle[i] = 0.0
    self.handle_last = self.handle_position / MILLIMETER
    for i in range(PLAYS):
        self.plays[i] = self.handle_last
    self.needle_set = self.needle[0] * self.needle_position / MILLIMETER + self.needle[1]


def move_plays(self: Any) -> float:
    """Move the play operators with the handle; its travel [mm]."""
    handle = self.handle_position / MILLIMETER
    travel = abs(handle - self.handle_last)
    self.handle_last = handle
    for i in range(PLAYS):
        self.plays[i] = min(max(self.plays[i], handle), handle + width(self, i))
    return travel


def width(self: Any, i: int) -> float:
    """Width of a play operator [mm]; their mean by the slope is the offset of eq. (2)."""
    return self.reversal_offset / (1.0 + self.slope) * (1.0 + self.play_spread * (i - 1))


def publish_plays(self: Any) -> float:
    """Publish share of tension and force of the handle; the advance [mm] without deflection."""
    mean = 0.0
    share = 0.0
    for i in range(PLAYS):
        mean += self.plays[i] / PLAYS
        share += (self.plays[i] - self.handle_last) / max(width(self, i), 1e-9) / PLAYS
    self.tension_share = share
    self.handle_force = self.guide_friction * (2.0 * share - 1.0)
    return (1.0 + self.slope) * mean


def publish_needle(self: Any, pull: float) -> None:
    """Publish length and force of the needle at a pull [mm]."""
    length = self.needle_set + self.needle[2] * pull + self.deviation_needle * self.error_needle[1]
    self.needle_length = MILLIMETER * length
    low, high = needle_limits(self.needle, self.needle_back, self.needle_turn, self.needle_position / MILLIMETER, pull)
    part = (self.needle_set - low) / max(high - low, 1e-9)
    self.needle_force = self.needle_friction * (2.0 * min(part, 1.0) - 1.0)
