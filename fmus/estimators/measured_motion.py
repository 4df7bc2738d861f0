"""Motion as it is measured, for as long as a model of it does not hold: smoothed samples and their rate.

A critically damped filter of position and speed (alpha-beta filter, Benedict and Bordner, IRE Trans. Automatic Control 7(4), 1962).
It knows no beat: it is late where the acceleration changes, and noisier than a model that holds.
"""

from __future__ import annotations

from math import exp

from twin.component import Component, local, parameter

TAKEOVER, RETURN = 0.05, 0.3  # [s] from the modeled motion to the measured one, and back
STALE = 0.1  # [s] after which the last sample says nothing of now
FASTEST = 0.5  # [m/s] of which a sample may be off what was expected: an outlier counts as that


class MeasuredMotion(Component):
    """State of the filter, and how far it is relied on."""

    smoothing = parameter(
        20e-3,
        "s",
        "time over which the measured motion is smoothed that is published while the beat is not as learned",
        display_unit="ms",
        minimum=4e-3,
        source="chosen: five samples; at the heart's 0.5 m/s2 it errs by 0.2 mm",
    )

    followed = local(0.0, "m", "samples, smoothed")
    followed_at = local(0.0, "s", "instant that they are smoothed to")
    followed_speed = local(0.0, "m/s", "their rate")
    reliance = local(0.0, "", "fraction of the output that is measured, not modeled")


def forget_samples(self: MeasuredMotion) -> None:
    """Begin anew."""
    self.followed = 0.0
    self.followed_at = 0.0
    self.followed_speed = 0.0
    self.reliance = 0.0


def smooth(self: MeasuredMotion, instant: float, sample: float) -> None:
    """Take in a sample [m] of an instant [s]."""
    elapsed = max(instant - self.followed_at, 1e-6)
    self.followed_at = instant
    keep = exp(-elapsed / self.smoothing)
    expected = self.followed + self.followed_speed * elapsed
    error = min(max(sample - expected, -FASTEST * elapsed), FASTEST * elapsed)
    self.followed = expected + (1.0 - keep * keep) * error
    self.followed_speed += (1.0 - keep) * (1.0 - keep) / elapsed * error


def measured_instead(
    self: MeasuredMotion, doubtful: bool, instant: float, h: float, position: float, velocity: float
) -> tuple[float, float]:
    """Position [m] and velocity [m/s] at an instant [s]: the model's, or the measured ones while the model is doubtful."""
    since = instant - self.followed_at
    before = self.reliance
    self.reliance = min(before + h / TAKEOVER, 1.0) if doubtful and since < STALE else max(before - h / RETURN, 0.0)
    if self.reliance <= 0.0:
        return position, velocity
    more = self.followed + self.followed_speed * since - position
    velocity += self.reliance * (self.followed_speed - velocity) + (self.reliance - before) / max(h, 1e-9) * more
    return position + self.reliance * more, velocity
