"""Shared definitions of a multicore fiber and its estimators: sizes, status values and grating wavelengths."""

from __future__ import annotations

GRATINGS = 40  # room for gratings; the interrogator of Al-Ahmad et al. (RACS) reads some 38 per core
NODES = GRATINGS + 1  # points of a shape: the base, and one half a pitch behind each grating
CORES = 4  # of 7: the central one, three outer ones
TURN = 2.0943951023931953  # angle between outer cores [rad], 120 deg

# status of an estimator's outputs
VALID = 0  # as good as it gets
DEGRADED = 1  # usable with care: parts of the input are missing, or the last good value is held
LOST = 2  # not usable


def nominal(first: float, spacing: float, grating: int) -> float:
    """Wavelength of a grating without strain at the reference temperature [m]; gratings stand side by side in the spectrum."""
    return first + spacing * grating
