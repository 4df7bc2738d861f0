"""Injection catheter with one pull wire and a needle, in its guide."""

from fmus.injection import (
    BEND_Y,
    BEND_Z,
    COMPRESSION,
    DEAD_BAND,
    MILLIMETER,
    NEEDLE,
    RETRACTION,
    REVERSAL_OFFSET,
    SLOPE,
    TENSION,
    bend,
    coupling,
    engagement,
    needle_after,
    needle_limits,
    wander,
)
from twin.component import Component, Int64, input, local, output, parameter, seed_stream, terminal

PLAYS = 3
PULL_MAXIMUM = 9.0  # longest pull that eqs. (4) and (5) hold for [mm]


class PullWireCatheter(Component):
    """8 Fr catheter in a 10.5 Fr guide: advance with play, deflection by a pull wire, needle; planar.

    Cheng and Law (paper B): eqs. (2) to (9) are exact where they were measured, play operators lie between. Independent
    of rate: only ways count. Coefficients are for mm, as printed.
    """

    handle_position = input("m", "slide of the inner handle, positive distal", display_unit="mm", nominal=10e-3)
    wire_position = input("m", "slide of the pull wire, positive: pulled", display_unit="mm", nominal=8e-3)
    needle_position = input("m", "slide of the needle, positive distal", display_unit="mm", nominal=10e-3)

    tip_y = output("m", "tip across the catheter, positive to the wire's side", display_unit="mm")
    tip_z = output("m", "tip along the catheter, from its place at the start, positive distal", display_unit="mm")
    needle_length = output("m", "needle outside of the tip; negative: still inside", display_unit="mm")
    handle_force = output("N", "force of the catheter on the handle's slide, positive distal")
    wire_force = output("N", "force of the wire on its slide, positive: pulled further")
    needle_force = output("N", "force of the needle on its slide, positive distal")
    tension_share = output("", "part of the play that is used up by pulling: 0 compressed, 1 in tension")

    tip = terminal("the tip and the needle", rule="bus", y=tip_y, z=tip_z, needle_length=needle_length)
    handle_slide = terminal("slide of the inner handle", position=handle_position, force=handle_force)
    wire_slide = terminal("slide of the pull wire", position=wire_position, force=wire_force)
    needle_slide = terminal("slide of the needle", position=needle_position, force=needle_force)

    slope = parameter(SLOPE, "", "tip travel per handle travel, less one", source="paper, eqs. (2), (3)")
    reversal_offset = parameter(REVERSAL_OFFSET, "", "travel [mm] that a reversal costs", minimum=0.0,
                                source="paper, eq. (2)")
    play_spread = parameter(
        0.3, "", "first and last part of the catheter to move: by this part before and after the mean", minimum=0.0,
        maximum=1.0, source="estimate: the guide bends gradually and the text does not give moves that stop in the play",
    )
    bend_y = parameter(BEND_Y, "", "eq. (4): coefficients of a^0 to a^3 in mm", source="paper, eq. (4)")
    bend_z = parameter(BEND_Z, "", "eq. (5): coefficients of a^0 to a^3 in mm", source="paper, eq. (5)")
    dead_band = parameter(DEAD_BAND, "", "pull [mm] that takes up the wire's slack", minimum=0.0,
                          source="paper, eq. (4)")
    wire_play = parameter(
        0.03, "", "pull [mm] that a release must go back before the tip does", minimum=0.0,
        source="estimate: at most that, or points on release would shift the mean of y, which the paper found to be zero",
    )
    compression = parameter(COMPRESSION, "", "eq. (6) compressed, in mm", source="paper, Table 1")
    tension = parameter(TENSION, "", "eq. (6) in tension, in mm",
                        source="paper, Table 1; terms in the order of poly33, two printed features are wrong")
    needle = parameter(NEEDLE, "", "eqs. (7), (8): length per actuator, offset [mm], length per pull",
                       source="paper, eqs. (7), (8)")
    needle_back = parameter(RETRACTION, "", "eq. (9), in mm", source="paper, eq. (9)")
    needle_turn = parameter(
        11.5, "", "actuator position [mm] from which eq. (9) retracts",
        source="not printed: the least half millimeter with which a needle drawn back is never shorter than one pushed there",
    )
    deviation_y = parameter(
        0.135, "", "standard deviation [mm] of the deflected tip across", minimum=0.0,
        source="identified from: calibrated RMS of y 0.18 mm, mean of 200 seeds",
    )
    deviation_z = parameter(
        0.12, "", "standard deviation [mm] of the tip along", minimum=0.0,
        source="identified from: calibrated RMS of z 0.14 mm, mean of 200 seeds",
    )
    deviation_needle = parameter(
        0.025, "", "standard deviation [mm] of the needle", minimum=0.0,
        source="paper: 0.042 mm after calibration, less slide (0.052 by 0.44) and camera",
    )
    correlation_length = parameter(2.0, "", "travel [mm] over which the deviations change", minimum=1e-3,
                                   source="estimate: the clearance in the guide, 0.8 mm, by two or three")
    guide_friction = parameter(4.0, "N", "friction of the catheter in its guide", minimum=0.0,
                               source="estimate: PTFE on a catheter through the aortic arch, 2 to 6 N")
    wire_stiffness = parameter(2.0e3, "N/m", "tension of the wire per pull beyond the dead band", display_unit="N/mm",
                               minimum=0.0, source="estimate: 16 N at the full deflection of an 8 Fr tip")
    needle_friction = parameter(
        1.0,
        "N",
        "friction of the needle's tube",
        minimum=0.0,
        source="estimate: a tube that bends in a wider lumen, a few tenths to 2 N",
    )
    seed = parameter(13, "", "seed of the deviations; give every noisy member its own", type=Int64, fixed=True,
                     source="arbitrary")

    plays = local(0.0, "", "ends of the play operators [mm]", shape=(PLAYS,))
    pull = local(0.0, "", "pull [mm] behind the wire's play")
    needle_set = local(0.0, "", "length [mm] that the needle's actuator has set")
    handle_last = local(0.0, "", "handle position [mm] of the last step")
    error_y = local(0.0, "", "deviation across in standard deviations: last, behind a lag", shape=(2,))
    error_z = local(0.0, "", "deviation along in standard deviations: last, behind a lag", shape=(2,))
    error_needle = local(0.0, "", "deviation of the needle in standard deviations: last, behind a lag", shape=(2,))
    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        for i in range(2):
            self.error_y[i] = 0.0
            self.error_z[i] = 0.0
            self.error_needle[i] = 0.0
        handle = self.handle_position / MILLIMETER
        self.handle_last = handle

        # the bench begins pushed in, pulled and protruded
        for i in range(PLAYS):
            self.plays[i] = handle
        self.pull = max(self.wire_position / MILLIMETER, 0.0)
        self.needle_set = self.needle[0] * self.needle_position / MILLIMETER + self.needle[1]
        publish(self)

    def step(self, t: float, h: float) -> None:
        handle = self.handle_position / MILLIMETER
        wire = self.wire_position / MILLIMETER
        travel = abs(handle - self.handle_last)
        self.handle_last = handle
        for i in range(PLAYS):
            self.plays[i] = min(max(self.plays[i], handle), handle + width(self, i))

        pulled = min(max(self.pull, wire), wire + self.wire_play)
        pulled = min(max(pulled, 0.0), PULL_MAXIMUM)
        travel += abs(pulled - self.pull)
        slide = self.needle_position / MILLIMETER
        needle_set = needle_after(
            self.needle, self.needle_back, self.needle_turn, slide, self.pull, pulled, self.needle_set
        )
        self.pull = pulled
        moved = abs(needle_set - self.needle_set) + abs(travel)
        self.needle_set = needle_set

        # deviations change with the way: a catheter that rests keeps its own
        wander(self.error_y, self.stream, travel, self.correlation_length)
        wander(self.error_z, self.stream, travel, self.correlation_length)
        wander(self.error_needle, self.stream, moved, self.correlation_length)
        publish(self)


def width(self: PullWireCatheter, i: int) -> float:
    """Width of a play operator [mm]; their mean by the slope is the offset of eq. (2)."""
    return self.reversal_offset / (1.0 + self.slope) * (1.0 + self.play_spread * (i - 1))


def publish(self: PullWireCatheter) -> None:
    """Outputs from the memory."""
    mean = 0.0
    share = 0.0
    for i in range(PLAYS):
        mean += self.plays[i] / PLAYS
        share += (self.plays[i] - self.handle_last) / max(width(self, i), 1e-9) / PLAYS
    advance = (1.0 + self.slope) * mean
    shift = coupling(self.compression, self.tension, share, self.dead_band, self.pull, advance)
    across = bend(self.bend_y, self.dead_band, self.pull) + shift
    across += engagement(self.dead_band, self.pull) * self.deviation_y * self.error_y[1]
    along = advance - bend(self.bend_z, self.dead_band, self.pull) + self.deviation_z * self.error_z[1]
    length = self.needle_set + self.needle[2] * self.pull + self.deviation_needle * self.error_needle[1]
    self.tip_y = MILLIMETER * across
    self.tip_z = MILLIMETER * along
    self.needle_length = MILLIMETER * length
    self.tension_share = share
    self.handle_force = self.guide_friction * (2.0 * share - 1.0)
    self.wire_force = -self.wire_stiffness * MILLIMETER * max(self.pull - self.dead_band, 0.0)

    low, high = needle_limits(
        self.needle, self.needle_back, self.needle_turn, self.needle_position / MILLIMETER, self.pull
    )
    part = (self.needle_set - low) / max(high - low, 1e-9)
    self.needle_force = self.needle_friction * (2.0 * min(part, 1.0) - 1.0)
