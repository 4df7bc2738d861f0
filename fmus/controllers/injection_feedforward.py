"""Feedforward of the injection catheters: workspace, steps of the motors, and the needle."""

from __future__ import annotations

from math import floor
from typing import Any

from fmus.injection import MILLIMETER, InjectionModel, retraction
from twin.component import local, parameter


class InjectionFeedforward(InjectionModel):
    """Workspace, screws and memory of the slides."""

    period = 10e-3

    z_maximum = parameter(20e-3, "m", "workspace along", display_unit="mm", source="paper, calibration method")
    needle_maximum = parameter(6e-3, "m", "longest needle", display_unit="mm", source="estimate: Table 2 goes to 5 mm")
    lead = parameter(7.7e-3, "m", "travel per revolution", display_unit="mm", minimum=1e-6, source="paper, eq. (1)")
    steps_per_revolution = parameter(1600.0, "", "steps per revolution", minimum=1.0, source="paper, eq. (1)")
    pull_maximum = parameter(
        9.0, "", "longest pull [mm] that the equations hold for", minimum=0.0, source="paper, eq. (4)"
    )

    pull = local(0.0, "", "pull [mm] of a single wire that bends as much")
    handle = local(0.0, "", "handle's slide [mm]")
    needle_slide = local(0.0, "", "needle's slide [mm]")
    needle_set = local(0.0, "", "length [mm] that the needle's slide has set")


def extend_needle(self: InjectionFeedforward, length: float, pull: float) -> None:
    """Slide for a length [m] at a pull [mm]; the play is crossed only where it must be."""
    wanted = length / MILLIMETER - self.needle[2] * pull
    if wanted >= self.needle_set:
        self.needle_slide = max((wanted - self.needle[1]) / self.needle[0], self.needle_slide)
    else:
        shorter = self.needle[0] * self.needle_turn + self.needle[1] - wanted
        self.needle_slide = min(retraction(self.needle_back, shorter, pull), self.needle_slide)
    self.needle_set = wanted


def steps(self: InjectionFeedforward, slide: float) -> int:
    """Steps of the motor for a slide [mm]."""
    return floor(slide * (self.steps_per_revolution / (self.lead / MILLIMETER)) + 0.5)


def publish_slides(self: Any) -> None:
    """Publish the slides of handle and needle."""
    self.handle_position = MILLIMETER * self.handle
    self.needle_position = MILLIMETER * self.needle_slide
    self.handle_steps = steps(self, self.handle)
    self.needle_steps = steps(self, self.needle_slide)
