"""Injection catheter with one pull wire and a needle, in its guide."""

from fmus.injection_catheter import (
    PULL_MAXIMUM,
    MeasuredCatheter,
    SingleWireCatheter,
    initialize_plays,
    move_plays,
    publish_needle,
    publish_plays,
)

from fmus.injection import MILLIMETER, bend, coupling, engagement, needle_after, wander
from fmus.noisy import noise_seed
from twin.component import local, output, parameter, seed_stream


class PullWireCatheter(SingleWireCatheter, MeasuredCatheter):
    """8 Fr catheter in a 10.5 Fr guide: advance with play, deflection by a pull wire, needle; planar.

    Cheng and Law (paper B): eqs. (2) to (9) are exact where they were measured, play operators lie between. Independent
    of rate: only ways count. Coefficients are for mm, as printed.
    """

    tension_share = output("", "part of the play that is used up by pulling: 0 compressed, 1 in tension")

    deviation_y = parameter(
        0.135, "", "standard deviation [mm] of the deflected tip across", minimum=0.0,
        source="identified from: calibrated RMS of y 0.18 mm, mean of 200 seeds",
    )
    deviation_z = parameter(
        0.12, "", "standard deviation [mm] of the tip along", minimum=0.0,
        source="identified from: calibrated RMS of z 0.14 mm, mean of 200 seeds",
    )
    wire_stiffness = parameter(2.0e3, "N/m", "tension of the wire per pull beyond the dead band", display_unit="N/mm",
                               minimum=0.0, source="estimate: 16 N at the full deflection of an 8 Fr tip")
    seed = noise_seed(13, "the deviations")

    pull = local(0.0, "", "pull [mm] behind the wire's play")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        initialize_plays(self)
        self.pull = max(self.wire_position / MILLIMETER, 0.0)
        publish(self)

    def step(self, t: float, h: float) -> None:
        travel = move_plays(self)
        wire = self.wire_position / MILLIMETER
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


def publish(self: PullWireCatheter) -> None:
    """Outputs from the memory."""
    advance = publish_plays(self)
    shift = coupling(self.compression, self.tension, self.tension_share, self.dead_band, self.pull, advance)
    across = bend(self.bend_y, self.dead_band, self.pull) + shift
    across += engagement(self.dead_band, self.pull) * self.deviation_y * self.error_y[1]
    along = advance - bend(self.bend_z, self.dead_band, self.pull) + self.deviation_z * self.error_z[1]
    self.tip_y = MILLIMETER * across
    self.tip_z = MILLIMETER * along
    self.wire_force = -self.wire_stiffness * MILLIMETER * max(self.pull - self.dead_band, 0.0)
    publish_needle(self, self.pull)
