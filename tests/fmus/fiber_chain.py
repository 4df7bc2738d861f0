"""The chain from the instrument's true curve to the tracked tip, stepped by hand."""

from fmus.fiber.model import Fiber
from fmus.fiber_shape.model import FiberShape
from fmus.guided_tip.model import GuidedTip
from fmus.tip_tracking.model import TipTracking

PERIOD = 4e-3
PERFECT = {"noise": 0.0, "reference_error": 0.0, "angle_error": 0.0, "radius_error": 0.0}


class Chain:
    """Four compiled members; `go` lets one sample run through all of them, without the delays of a simulation."""

    def __init__(self, native, tip=None, fiber=None, shape=None, tracking=None):
        self.tip = native(GuidedTip, **(tip or {}))
        self.fiber = native(Fiber, **(fiber or {}))
        self.shape = native(FiberShape, **(shape or {}))
        self.tracking = native(TipTracking, **(tracking or {}))
        self.samples = 0
        self.tip.start()
        self.fiber.curvature[:] = self.tip.curvature
        for member in (self.fiber, self.shape, self.tracking):
            member.start()

    def go(self, travel=0.0, displacement=0.0, spoil=None):
        """One sample; `spoil(chain)` may change what the reconstruction gets."""
        t = self.samples * PERIOD
        self.samples += 1
        self.tip.travel[:] = travel
        self.tip.displacement[:] = displacement
        self.tip.advance(t, PERIOD)
        self.fiber.curvature[:] = self.tip.curvature
        self.fiber.advance(t, PERIOD)
        self.shape.wavelength[:] = self.fiber.wavelength
        self.shape.grating_count = self.fiber.grating_count
        self.shape.wavelength_age = self.fiber.age
        if spoil:
            spoil(self)
        self.shape.advance(t, PERIOD)
        for name in ("curvature", "shape", "tangent"):
            getattr(self.tracking, name)[:] = getattr(self.shape, name)
        self.tracking.profile_noise = self.shape.curvature_noise
        self.tracking.profile_status = self.shape.status
        self.tracking.profile_age = self.shape.age
        self.tracking.advance(t, PERIOD)
        return self
