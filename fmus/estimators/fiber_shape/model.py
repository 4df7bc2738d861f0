"""Shape of an instrument from the wavelengths of a multicore fiber in it."""

from math import cos, isfinite, sin, sqrt

from fmus.curves import advance_frame, interpolated, interval, put_node, set_frame, spline
from fmus.gratings import CORES, DEGRADED, GRATINGS, LOST, NODES, TURN, VALID, nominal
from twin.component import Boolean, Component, Int32, input, local, output, parameter, terminal

PARTS = 2  # integration steps per pitch
RADIUS = 40e-6  # length that makes numbers near 1 of the places of cores [m]
CONDITION = 0.05  # least determinant of a grating's equations, of radii and angles alone; two cores opposite: 0


class FiberShape(Component):
    """From wavelengths to strain, curvature at each grating, and the curve by parallel transport.

    Equations of Jackle et al. (2019); use of Al-Ahmad et al. (RACS), section IV.C. The frame is that of the fiber's base,
    tangent along z. Each step may lack cores: three of four give all; what is missing is told by `status`.
    """

    period = 4e-3
    former_names = (
        ("found", "current"),
        ("kept", "last_valid"),
        ("kept_noise", "last_noise"),
        ("kept_temperature", "last_temperature"),
        ("kept_residual", "last_residual"),
        ("kept_age", "last_age"),
    )

    wavelength = input("m", "wavelength that each grating of each core reflects; 0: no peak", shape=(CORES, GRATINGS),
                       display_unit="nm", nominal=1e-12)
    grating_count = input("", "gratings that the interrogator lists", type=Int32, start=38)
    wavelength_age = input("s", "age of the sample", start=4e-3, display_unit="ms", nominal=1e-4)

    curvature = output("1/m", "curvature at each grating along both directions; 0 where there is none",
                       shape=(GRATINGS, 2))
    shape = output("m", "curve in the frame of the base: base, then each pitch; behind the last: the last",
                   shape=(NODES, 3), display_unit="mm")
    tangent = output("", "directions of the curve there", shape=(NODES, 3))
    temperature = output("K", "mean temperature of the fiber, if nothing stretches it")
    residual = output("", "rms strain by which the cores contradict each other")
    curvature_noise = output("1/m", "standard deviation of a component of curvature, estimated from the cores' inconsistency")
    status = output("", "0 valid, 1 degraded: cores or gratings missing, contradiction, or held; 2 lost", type=Int32)
    age = output("s", "age of the sample when it was published", display_unit="ms")

    light = terminal("the interrogator", wavelength=wavelength, grating_count=grating_count, age=wavelength_age)
    profile = terminal("the instrument's curve", curvature=curvature, shape=shape, tangent=tangent, noise=curvature_noise,
                       status=status, age=age)

    count = parameter(38, "", "gratings per core", type=Int32, fixed=True, minimum=4, maximum=GRATINGS,
                      source="as fiber")
    pitch = parameter(10e-3, "m", "distance of gratings; the first is half of it from the base", display_unit="mm",
                      minimum=1e-3, source="as fiber")
    first_wavelength = parameter(1512e-9, "m", "of the first grating, straight at 20 degC", display_unit="nm",
                                 source="as fiber")
    wavelength_spacing = parameter(2e-9, "m", "to the next grating", display_unit="nm", source="as fiber")
    wavelength_range = parameter(2e-9, "m", "shift at which the interrogator saturates", display_unit="nm", minimum=0.0,
                                 source="as fiber")
    core_radius = parameter((0.0, 37.5e-6, 37.5e-6, 37.5e-6), "m", "of each core from the axis", display_unit="um", fixed=True,
                            source="as fiber")
    core_angle = parameter((0.0, 0.0, TURN, 2.0 * TURN), "rad", "of each core about the axis", display_unit="deg", fixed=True,
                           source="as fiber: outer cores at 120 deg")
    twist = parameter(0.0, "rad/m", "known torsion, per length from the base", source="0: unknown, no core measures it")
    photoelastic = parameter(0.22, "", "part of the strain that the refractive index takes back", source="as fiber")
    temperature_sensitivity = parameter(6.5e-6, "1/K", "relative shift per temperature", minimum=1e-9, source="as fiber")
    residual_limit = parameter(12e-6, "", "contradiction of the cores from which on the result is degraded", minimum=0.0,
                               source="chosen: above the 8e-6 of angles off by 3 deg; errors as in fiber make 2e-6")
    unsolved_limit = parameter(2, "", "gratings without a result that may be bridged", type=Int32, minimum=0,
                               source="chosen: a gap of 30 mm; what bends within more cannot be guessed")
    fresh = parameter(10e-3, "s", "age of a sample from which on it is degraded", display_unit="ms", minimum=0.0,
                      source="chosen: one sample may be missing")
    hold = parameter(0.1, "s", "how long the last good result is held before it is lost", display_unit="ms", minimum=0.0,
                     source="chosen: a tenth of a heart beat")

    noise_memory = parameter(0.2, "s", "over which the cores' contradictions are averaged for `curvature_noise`", minimum=0.0,
                             source="chosen: 50 samples of 38 gratings, 3 % of the noise")

    x = local(0.0, "", "place of each core, in -40 um", shape=(CORES,))
    y = local(0.0, "", "place of each core, in -40 um", shape=(CORES,))
    solved = local(False, "", "whether each grating has a result", type=Boolean, shape=(GRATINGS,))
    current = local(0.0, "1/m", "curvature of this sample", shape=(GRATINGS, 2))
    contradiction = local(0.0, "", "sum of squared residual strains")
    common = local(0.0, "", "sum of the gratings' common strain")
    redundant = local(0.0, "", "sum of squared residual strains of gratings with more than three cores")
    spare = local(0, "", "readings beyond those that the curvature needs", type=Int32)
    lever = local(0.0, "1/m^2", "sum over gratings of the variance of curvature per variance of strain")
    strain_variance = local(0.0, "", "variance of a core's strain, averaged; below 0: not known yet")
    last_noise = local(0.0, "1/m", "its noise of curvature")
    missing = local(0, "", "readings that could not be used", type=Int32)
    unsolved = local(0, "", "gratings without a result", type=Int32)
    last_valid = local(0.0, "1/m", "curvature of the last good sample", shape=(GRATINGS, 2))
    last_temperature = local(0.0, "K", "its temperature")
    last_residual = local(0.0, "", "its residual")
    last_age = local(0.0, "s", "its age", display_unit="ms")
    ever = local(False, "", "whether there has been one", type=Boolean)
    moments = local(0.0, "1/m", "bending of its splines", shape=(GRATINGS, 2))
    factors = local(0.0, "", "scratch of the splines", shape=(GRATINGS,))
    frame = local(0.0, "", "directions, tangent and position [m] along the curve", shape=(4, 3))
    used = local(4, "", "gratings in use: count, as far as there is room", type=Int32)

    def initialize(self) -> None:
        self.used = max(min(self.count, GRATINGS), 4)
        for core in range(CORES):
            self.x[core] = -self.core_radius[core] / RADIUS * cos(self.core_angle[core])
            self.y[core] = -self.core_radius[core] / RADIUS * sin(self.core_angle[core])
        for i in range(GRATINGS):
            for c in range(2):
                self.last_valid[i, c] = 0.0
        self.last_temperature = 293.15
        self.last_residual = 0.0
        self.last_noise = 0.0
        self.strain_variance = -1.0
        self.last_age = 0.0
        self.ever = False
        self.status = estimate(self, 0.0)
        publish(self)

    def step(self, t: float, h: float) -> None:
        self.status = estimate(self, h)
        publish(self)


def estimate(self: FiberShape, h: float) -> int:
    """Process a sample, or hold the last result; return the status."""
    age = self.wavelength_age + h
    usable = self.grating_count == self.count and isfinite(age) and age <= h + self.hold
    if usable:
        solve(self)
        usable = self.unsolved <= min(self.unsolved_limit, self.used - 2) and isfinite(self.contradiction)
    if not usable:
        self.last_age += h
        return DEGRADED if self.ever and self.last_age <= self.hold + 0.5 * h else LOST
    bridge(self)
    keep(self, h)
    self.last_age = age
    if self.missing > 0 or self.last_residual > self.residual_limit or age > h + self.fresh:
        return DEGRADED
    return VALID


def solve(self: FiberShape) -> None:
    """Curvature at each grating, by least squares over the cores that were read."""
    self.missing = 0
    self.unsolved = 0
    self.contradiction = 0.0
    self.common = 0.0
    self.redundant = 0.0
    self.spare = 0
    self.lever = 0.0
    for i in range(self.used):
        self.solved[i] = solve_grating(self, i)
        if not self.solved[i]:
            self.unsolved += 1


def solve_grating(self: FiberShape, i: int) -> bool:
    """Strain of a core = common strain - k1 x - k2 y, where it lies at x, y; three unknowns, so three cores or more.

    The common strain holds temperature and tension: the central core, at x = y = 0, shows nothing else.
    """
    n = sx = sy = sxx = sxy = syy = se = sxe = sye = see = 0.0
    unstrained = nominal(self.first_wavelength, self.wavelength_spacing, i)
    for core in range(CORES):
        shift = self.wavelength[core, i] - unstrained
        if not abs(shift) < self.wavelength_range * (1.0 - 1e-6):  # no number, no peak, saturated
            self.missing += 1
            continue
        strain = shift / unstrained / (1.0 - self.photoelastic)
        x = self.x[core]
        y = self.y[core]
        n += 1.0
        sx += x
        sy += y
        sxx += x * x
        sxy += x * y
        syy += y * y
        se += strain
        sxe += x * strain
        sye += y * strain
        see += strain * strain
    if n < 3.0:
        return False

    # normal equations about the mean
    sxx -= sx * sx / n
    sxy -= sx * sy / n
    syy -= sy * sy / n
    sxe -= sx * se / n
    sye -= sy * se / n
    determinant = sxx * syy - sxy * sxy
    if determinant < CONDITION:
        return False
    k1 = (syy * sxe - sxy * sye) / determinant
    k2 = (sxx * sye - sxy * sxe) / determinant

    # the cores' directions, turned back by a known torsion
    turned = self.twist * (i + 0.5) * self.pitch
    along = cos(turned) / RADIUS
    across = sin(turned) / RADIUS
    self.current[i, 0] = along * k1 - across * k2
    self.current[i, 1] = along * k2 + across * k1
    self.common += (se - k1 * sx - k2 * sy) / n
    squares = max(see - se * se / n - k1 * sxe - k2 * sye, 0.0)
    self.contradiction += squares / n
    self.lever += 0.5 * (sxx + syy) / determinant / (RADIUS * RADIUS)
    if n > 3.0:
        self.redundant += squares
        self.spare += 1
    return True


def bridge(self: FiberShape) -> None:
    """Curvature where a grating has none, between its neighbors."""
    for i in range(self.used):
        if self.solved[i]:
            continue
        before = i - 1
        after = i + 1
        while before >= 0 and not self.solved[before]:
            before -= 1
        while after < self.used and not self.solved[after]:
            after += 1
        for c in range(2):
            if before < 0:
                self.current[i, c] = self.current[after, c]
            elif after >= self.used:
                self.current[i, c] = self.current[before, c]
            else:
                part = (i - before) / (after - before)
                self.current[i, c] = self.current[before, c] + part * (self.current[after, c] - self.current[before, c])


def keep(self: FiberShape, h: float) -> None:
    """Store the current result as the last valid one."""
    solved = self.used - self.unsolved
    for i in range(self.used):
        for c in range(2):
            self.last_valid[i, c] = self.current[i, c]
    self.last_temperature = 293.15 + self.common / solved * (1.0 - self.photoelastic) / self.temperature_sensitivity
    self.last_residual = sqrt(self.contradiction / solved)
    if self.spare > 0:  # four cores for three unknowns: one degree of freedom at each grating
        variance = self.redundant / self.spare
        part = h / (self.noise_memory + h) if self.strain_variance >= 0.0 else 1.0
        self.strain_variance = max(self.strain_variance, 0.0) + part * (variance - max(self.strain_variance, 0.0))
    self.last_noise = sqrt(max(self.strain_variance, 0.0) * self.lever / solved)
    self.ever = True


def publish(self: FiberShape) -> None:
    """The last good curvature and its curve, with splines between the gratings."""
    self.temperature = self.last_temperature
    self.residual = self.last_residual
    self.curvature_noise = self.last_noise
    self.age = self.last_age
    for i in range(GRATINGS):
        for c in range(2):
            self.curvature[i, c] = self.last_valid[i, c]
    spline(self.last_valid, self.moments, self.factors, self.used)
    set_frame(self.frame)
    put_node(self.frame, self.shape, self.tangent, 0)
    last = self.used - 1
    for i in range(self.used):
        for k in range(PARTS):
            x = min(max(i + (k + 0.5) / PARTS - 0.5, 0.0), last)  # the outer half pitches: as the outer gratings
            j = interval(x, self.used)
            k1 = interpolated(self.last_valid, self.moments, 0, j, x - j)
            k2 = interpolated(self.last_valid, self.moments, 1, j, x - j)
            advance_frame(self.frame, k1, k2, self.pitch / PARTS)
        put_node(self.frame, self.shape, self.tangent, i + 1)
    for i in range(self.used + 1, NODES):
        put_node(self.frame, self.shape, self.tangent, i)
