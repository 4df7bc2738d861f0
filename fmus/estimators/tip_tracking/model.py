"""Pose of the tip by the shift of the curvature profile.

Over 400 lines: an estimator stands in one file, so that its equations are read from top to bottom.
"""

from math import atan2, ceil, exp, floor, hypot, isfinite, sqrt

from fmus.interpolation_error import ORDER, PARTS, RELEARNED, complete, find, forget, note, without
from fmus.registration import rotate_onto
from fmus.stretch import lead

from fmus.curves import hermite, interpolated, interval, slope, spline, weights
from fmus.gratings import DEGRADED, GRATINGS, LOST, NODES, VALID
from twin.component import Boolean, Component, Int32, Int64, input, local, output, parameter, terminal

LARGEST = 1e4  # curvature [1/m] or coordinate [m] that is no longer one of an instrument
DISTANT = 700.0  # exponent of a likelihood that is none
COARSE = 4  # shifts per pitch that are tried over the whole window
SLOPE_GAIN = 2.0 * (2.0 / sqrt(3.0) - 1.0) * 9.0  # squared slope that white noise of variance 1 makes of splines, both components
SHARE = 0.5**0.5  # of a difference of two profiles that each of them has by itself
FINE = (1.0, 0.1)  # half widths of the parabolas that refine the best one, of the coarse increment


class TipTracking(Component):
    """The seven steps of Al-Ahmad et al. (RACS), section IV.C: how far the instrument has come, and where its tip is.

    The universal frame is that of the fiber's base at the first sample. Needs bends: along a straight or evenly bent path
    a shift changes nothing, which `uncertainty` tells. Before travel leaves half the window, a new reference is taken.
    """

    period = 4e-3
    former_names = (
        ("path_place", "path_offset"),
        ("begun", "has_reference"),
        ("kept_travel", "last_travel"),
        ("kept_lead", "last_lead"),
        ("kept_position", "last_position"),
        ("kept_direction", "last_direction"),
        ("kept_roll", "last_roll"),
        ("kept_age", "last_age"),
    )

    curvature = input("1/m", "curvature at each grating along both directions", shape=(GRATINGS, 2), nominal=20.0)
    shape = input("m", "curve in the frame of the base: base, then each pitch", shape=(NODES, 3), display_unit="mm",
                  nominal=10e-3)
    tangent = input("", "directions of the curve there", shape=(NODES, 3), nominal=1.0)
    profile_noise = input("1/m", "standard deviation of a component of curvature, estimated by the fiber", nominal=0.05)
    profile_status = input("", "0 valid, 1 degraded, 2 lost", type=Int32, minimum=0, maximum=2)
    profile_age = input("s", "age of the sample", start=8e-3, display_unit="ms", nominal=1e-4)

    travel = output("m", "signed travel since the first sample, positive distal", display_unit="mm")
    position = output("m", "tip in the universal frame", shape=(3,), display_unit="mm")
    direction = output("", "tangent at the tip in the universal frame", shape=(3,))
    tip_lead = output("m", "travel of the tip beyond `travel`, by what the profile is stretched; each reference adds its error",
                      display_unit="mm")
    roll = output("rad", "rotation of the instrument about itself since the reference", display_unit="deg")
    uncertainty = output("m", "standard deviation of the travel since the reference, estimated by the match",
                         display_unit="mm")
    mismatch = output("1/m", "rms difference of the matched curvatures")
    status = output("", "0 valid; 1 degraded: input degraded, path too straight, or held; 2 lost", type=Int32)
    restarts = output("", "references given up since the start: at each, travel and the universal frame count anew", type=Int64)
    age = output("s", "age of the sample when it was published", display_unit="ms")

    profile = terminal("the instrument's curve", curvature=curvature, shape=shape, tangent=tangent, noise=profile_noise,
                       status=profile_status, age=profile_age)
    tip = terminal("the tip", position=position, status=status, age=age)

    count = parameter(38, "", "gratings per core", type=Int32, fixed=True, minimum=8, maximum=GRATINGS,
                      source="as fiber")
    pitch = parameter(10e-3, "m", "distance of gratings", display_unit="mm", minimum=1e-3, fixed=True,
                      source="as fiber")
    window = parameter(20e-3, "m", "largest travel from the reference that is looked for: zeta_max", display_unit="mm",
                       minimum=1e-3, source="chosen: the heart moves 12 mm, and half of the window is used")
    free_length = parameter(20e-3, "m", "distal part that is not guided, left out of the match", display_unit="mm",
                            minimum=0.0, source="as guided_tip")
    matched_length = parameter(10.0, "m", "distal part of the crop that is matched; less than all where travel differs along it",
                               display_unit="mm", minimum=30e-3, source="paper, section IV.C: all of the crop")
    stretch_expected = parameter(0.05, "", "change of travel along the instrument, per length, that is expected", minimum=1e-6,
                                 source="estimate: a clearance of 10 mm and a bend of 1 rad in 200 mm of a vessel")
    registered_length = parameter(0.03, "m", "over which a point's weight in the registration falls to 37 %, from the tip",
                                  display_unit="mm", minimum=1e-3,
                                  source="chosen: three gratings, so that a bend farther away still determines the roll")
    curvature_noise = parameter(0.05, "1/m", "standard deviation of a component of curvature: the least that is believed",
                                minimum=1e-6, source="fiber: references off by 2 pm at 37.5 um, and noise of 0.5 pm")
    uncertainty_limit = parameter(0.5e-3, "m", "uncertainty from which on the result is degraded, and no reference is begun",
                                  display_unit="mm", minimum=0.0, source="paper, section IV.C: 0.60 mm is what tracking should reach")
    blind_limit = parameter(5e-3, "m", "uncertainty from which on there is no result", display_unit="mm", minimum=0.0,
                            source="half a pitch: no better than counting gratings")
    mismatch_limit = parameter(2.0, "1/m", "mismatch from which on there is no result: the path has changed",
                               minimum=0.0, source="chosen: a tenth of the paper's bends")
    significance = parameter(3.0, "", "minimum ratio of a profile's slope to the noise's for a match", minimum=1.0,
                             source="chosen: squared slopes of 15 gratings of noise spread by 0.3 of their mean; 250 samples a second")
    learn_interpolation = parameter(True, "", "whether the error that repeats with the pitch is found and taken off", type=Boolean,
                                    source="chosen; the paper has nothing of the kind")
    fresh = parameter(14e-3, "s", "age of a sample from which on it is degraded", display_unit="ms", minimum=0.0,
                      source="chosen: as fiber_shape")
    hold = parameter(0.1, "s", "how long the last good result is held before it is lost", display_unit="ms", minimum=0.0,
                     source="as fiber_shape")

    reference = local(0.0, "1/m", "curvature of the reference", shape=(GRATINGS, 2))
    moments = local(0.0, "1/m", "bending of its splines", shape=(GRATINGS, 2))
    factors = local(0.0, "", "scratch of the splines", shape=(GRATINGS,))
    reference_shape = local(0.0, "m", "curve of the reference in the universal frame", shape=(NODES, 3))
    reference_tangent = local(0.0, "", "its directions there", shape=(NODES, 3))
    reference_travel = local(0.0, "m", "travel of the reference", display_unit="mm")
    reference_lead = local(0.0, "m", "lead of the tip at the reference", display_unit="mm")
    path = local(0.0, "1/m", "curvature along the path, put together from all gratings", shape=(GRATINGS * PARTS, 2))
    path_count = local(0, "", "profiles that each part of a pitch has seen", type=Int32, shape=(PARTS,))
    path_offset = local(0.0, "", "by how much they were off its middle, in parts", shape=(PARTS,))
    behind = local(0.0, "1/m", "differences so far", shape=(3, ORDER))
    wave = local(0.0, "", "cosine and sine of the interpolation's error over a pitch, in pitches", shape=(2,))
    learned = local(0, "", "profiles since that was found", type=Int32)
    has_reference = local(False, "", "whether there is a reference", type=Boolean)
    matched = local(False, "", "whether a profile has matched the reference", type=Boolean)
    ever = local(False, "", "whether there has been a result", type=Boolean)
    error = local(0.0, "1/m^2", "sum of squared differences of the last shift that was tried")
    along = local(0.0, "1/m^2", "sum of a conj(b) of that shift, real part")
    across = local(0.0, "1/m^2", "its imaginary part")
    onto = local(0.0, "m", "points of the reference that the nodes of now match", shape=(NODES, 3))
    center = local(0.0, "m", "mean of the cropped curve, and of the reference's", shape=(2, 3))
    moment = local(0.0, "m^2", "products of both cropped curves", shape=(3, 3))
    horn = local(0.0, "", "Horn's matrix, and its diagonal form", shape=(4, 4))
    vectors = local(0.0, "", "its eigenvectors", shape=(4, 4))
    rotation = local(0.0, "", "from the frame of the base to the universal frame", shape=(3, 3))

    last_travel = local(0.0, "m", "travel of the last good sample", display_unit="mm")
    last_lead = local(0.0, "m", "its lead of the tip", display_unit="mm")
    last_position = local(0.0, "m", "its position", shape=(3,), display_unit="mm")
    last_direction = local(0.0, "", "its direction", shape=(3,))
    last_roll = local(0.0, "rad", "its roll", display_unit="deg")
    last_age = local(0.0, "s", "its age", display_unit="ms")
    noise = local(0.0, "1/m", "standard deviation of a component of curvature that is reckoned with")
    weight = local(0.0, "", "sum of the likelihoods of the shifts that were tried over the window")
    weighted = local(0.0, "m", "the same times the shift", display_unit="mm")
    squared = local(0.0, "m^2", "the same times its square")
    highest = local(0.0, "1/m^2", "sum of squares of the shift that is the most likely so far")
    unmatched = local(0.0, "s", "for how long no profile has matched the reference")
    doubt = local(0.0, "m", "uncertainty of the last sample that was matched", display_unit="mm")
    difference = local(0.0, "1/m", "its mismatch")
    used = local(4, "", "gratings in use: count, as far as there is room", type=Int32)

    def initialize(self) -> None:
        self.used = max(min(self.count, GRATINGS), 4)
        for a in range(3):
            self.last_position[a] = 0.0
            self.last_direction[a] = 1.0 if a == 2 else 0.0
        self.last_travel = 0.0
        self.last_lead = 0.0
        self.last_roll = 0.0
        self.last_age = 0.0
        self.doubt = self.window
        self.difference = 0.0
        self.noise = self.curvature_noise
        self.has_reference = False
        self.matched = False
        self.ever = False
        self.unmatched = 0.0
        self.restarts = 0
        self.status = LOST
        publish(self)

    def step(self, t: float, h: float) -> None:
        self.status = track(self, h)
        publish(self)


def publish(self: TipTracking) -> None:
    """The last good sample, and how well the last one matched."""
    self.travel = self.last_travel
    self.tip_lead = self.last_lead
    self.roll = self.last_roll
    self.age = self.last_age
    self.uncertainty = self.doubt
    self.mismatch = self.difference
    for a in range(3):
        self.position[a] = self.last_position[a]
        self.direction[a] = self.last_direction[a]


def track(self: TipTracking, h: float) -> int:
    """Process a sample, or hold the last result; return the status."""
    age = self.profile_age + h
    usable = self.profile_status != LOST and isfinite(age) and age <= h + self.hold and readable(self)
    shift = 0.0
    has_profile = usable
    if usable:
        self.noise = max(self.profile_noise, self.curvature_noise, SHARE * self.difference)
        if not self.has_reference:
            begin(self)
        shift = best_shift(self)
        judge(self, shift)
        limit = self.blind_limit if self.matched else self.uncertainty_limit  # a doubtful reference would mislead for good
        usable = self.doubt <= limit and self.doubt < self.window
    if not usable:
        # a path too straight at first: the reference is the first profile that can be told apart; one that profiles do not
        # match for a while is given up, as it may have been noise or the instrument may have gone on unseen
        self.unmatched = self.unmatched + h if has_profile else 0.0
        if not self.matched:
            self.has_reference = False
        elif self.unmatched > self.hold:
            self.restarts += 1
            self.has_reference = self.matched = False
        self.last_age += h
        return DEGRADED if self.ever and self.last_age <= self.hold + 0.5 * h else LOST
    self.unmatched = 0.0
    doubtful = self.profile_status != VALID
    if self.learn_interpolation and not doubtful and abs(shift) <= 0.5 * self.window:
        learn(self, shift)
    self.last_lead = self.reference_lead + lead(
        self.curvature, self.reference, self.moments, first(self), last(self), self.used, self.pitch, shift,
        self.along, self.across, self.stretch_expected,
    )
    shift = without(self.wave, shift / self.pitch) * self.pitch
    register(self, shift)
    self.last_travel = self.reference_travel + shift
    self.last_roll = atan2(-self.across, self.along)
    self.last_age = age
    self.ever = self.matched = True
    if abs(shift) > 0.5 * self.window and not doubtful:
        renew(self)
    return DEGRADED if doubtful or self.doubt > self.uncertainty_limit or age > h + self.fresh else VALID


def readable(self: TipTracking) -> bool:
    """Whether the whole profile is numbers that a curve may have, and its noise one too."""
    if not 0.0 <= self.profile_noise < LARGEST:
        return False
    for i in range(self.used):
        for c in range(2):
            if not abs(self.curvature[i, c]) < LARGEST:
                return False
    for i in range(self.used + 1):
        for j in range(3):
            if not (abs(self.shape[i, j]) < LARGEST and abs(self.tangent[i, j]) < LARGEST):  # no number is not less either
                return False
    return True


def begin(self: TipTracking) -> None:
    """Step 1 at k = 0: the first curve is the reference, its base the universal frame; travel goes on counting."""
    for i in range(NODES):
        for j in range(3):
            self.reference_shape[i, j] = self.shape[i, j]
            self.reference_tangent[i, j] = self.tangent[i, j]
    self.reference_travel = self.last_travel
    self.reference_lead = self.last_lead
    self.has_reference = True
    keep_curvature(self)


def learn(self: TipTracking, shift: float) -> None:
    """Learn the interpolation error from the path of all gratings since the reference."""
    begin, end = first(self), last(self)
    note(self.path, self.path_count, self.path_offset, self.curvature, begin, end, shift / self.pitch)
    self.learned += 1
    edge = ceil(0.5 * self.window / self.pitch) + 1  # gratings whose places not every shift has seen
    if self.learned >= RELEARNED and end - begin > 2 * edge and complete(self.path_count):
        self.learned = 0
        find(self.path, self.path_offset, self.behind, self.wave, begin + edge, end - edge, self.curvature_noise)


def keep_curvature(self: TipTracking) -> None:
    """The profile of now as the reference's."""
    forget(self.path_count, self.wave)
    for i in range(self.used):
        for c in range(2):
            self.reference[i, c] = self.curvature[i, c]
    spline(self.reference, self.moments, self.factors, self.used)


def first(self: TipTracking) -> int:
    """Step 2, crop: first grating, and first node, from which no shift in the window leaves the reference."""
    return max(ceil(self.window / self.pitch + 0.5), last(self) - ceil(self.matched_length / self.pitch))


def last(self: TipTracking) -> int:
    """The grating behind the last of them; the node of this number is the last one."""
    return self.used - ceil((self.window + self.free_length) / self.pitch + 0.5)


def best_shift(self: TipTracking) -> float:
    """Steps 3 and 4: the shift [m] with the least squares, first over the window, then between those that were tried."""
    increment = self.pitch / COARSE
    tries = floor(self.window / increment)
    best = 0.0
    least = squares(self, 0.0)
    self.highest = least
    self.weight = 1.0
    self.weighted = self.squared = 0.0
    for k in range(1, tries + 1):
        for sign in range(-1, 2, 2):
            residual = squares(self, sign * k * increment)
            weigh(self, sign * k * increment, residual)
            if residual < least:
                least = residual
                best = sign * k * increment
    for k in range(len(FINE)):
        width = FINE[k] * increment
        below = squares(self, best - width)
        middle = squares(self, best)
        above = squares(self, best + width)
        curve = below - 2.0 * middle + above
        if curve > 0.0:
            best += min(max(0.5 * width * (below - above) / curve, -width), width)
    return min(max(best, -self.window), self.window)


def weigh(self: TipTracking, shift: float, error: float) -> None:
    """Take a shift into the likelihood over the window: both profiles have independent noise in each component."""
    variance = 2.0 * self.noise * self.noise
    if error < self.highest:
        less = exp(max(0.5 * (error - self.highest) / variance, -DISTANT))
        self.weight *= less
        self.weighted *= less
        self.squared *= less
        self.highest = error
    likelihood = exp(max(0.5 * (self.highest - error) / variance, -DISTANT))
    self.weight += likelihood
    self.weighted += likelihood * shift
    self.squared += likelihood * shift * shift


def ambiguity(self: TipTracking, shift: float) -> float:
    """Mean square distance from a shift of all that match nearly as well [m^2], less what the tries' own spacing makes."""
    increment = self.pitch / COARSE
    spread = (self.squared - 2.0 * shift * self.weighted) / self.weight + shift * shift
    return max(spread - 0.25 * increment * increment, 0.0)


def squares(self: TipTracking, shift: float) -> float:
    """Sum of squared differences of the cropped profile and the reference, shifted; rolled so that it is least.

    As complex numbers a of now and b of the reference: |a|^2 + |b|^2 - 2 |sum of a conj(b)|.
    """
    both = along = across = 0.0
    begin, end = first(self), last(self)
    j = interval(begin + shift / self.pitch, self.used)
    w, x, y, z = weights(begin + shift / self.pitch - j)
    v = self.reference
    m = self.moments
    for i in range(begin, end):
        k = j + i - begin
        b1 = w * v[k, 0] + x * v[k + 1, 0] + y * m[k, 0] + z * m[k + 1, 0]
        b2 = w * v[k, 1] + x * v[k + 1, 1] + y * m[k, 1] + z * m[k + 1, 1]
        a1 = self.curvature[i, 0]
        a2 = self.curvature[i, 1]
        both += a1 * a1 + a2 * a2 + b1 * b1 + b2 * b2
        along += a1 * b1 + a2 * b2
        across += a2 * b1 - a1 * b2
    self.along = along
    self.across = across
    self.error = max(both - 2.0 * hypot(along, across), 0.0)
    return self.error


def judge(self: TipTracking, shift: float) -> None:
    """Uncertainty of a shift: noise over how fast the reference changes along the arc, other than by a roll; other matches."""
    squares(self, shift)
    begin, end = first(self), last(self)
    variance = self.error / max(2.0 * (end - begin) - 2.0, 1.0)
    self.difference = sqrt(variance)
    j = interval(begin + shift / self.pitch, self.used)
    part = begin + shift / self.pitch - j
    size = steep = turning = 0.0
    for i in range(begin, end):
        k = j + i - begin
        b1 = interpolated(self.reference, self.moments, 0, k, part)
        b2 = interpolated(self.reference, self.moments, 1, k, part)
        d1 = slope(self.reference, self.moments, 0, k, part) / self.pitch
        d2 = slope(self.reference, self.moments, 1, k, part) / self.pitch
        size += b1 * b1 + b2 * b2
        steep += d1 * d1 + d2 * d2
        turning += b1 * d2 - b2 * d1
    if size > 0.0:
        steep -= turning * turning / size

    # both profiles are noisy, and noise makes slopes too: those of a straight path contain no information
    noise = max(variance, 2.0 * self.noise * self.noise)
    made = SLOPE_GAIN * max(end - begin, 0) * 0.5 * noise / (self.pitch * self.pitch)
    self.doubt = self.window
    if steep > self.significance * made and self.difference <= self.mismatch_limit:
        self.doubt = min(sqrt(noise / (steep - made) + ambiguity(self, shift)), self.window)


def register(self: TipTracking, shift: float) -> None:
    """Steps 5 to 7: both curves cropped where they match and moved to the origin; the rotation; the tip's pose.

    All that overlaps is used, not only the crop, and a point counts less, the farther it is from the tip: errors of shape
    far away would turn the tip about a long lever. The origin is the mean of the points, as least squares demand.
    """
    begin = ceil(max(-shift, 0.0) / self.pitch)
    end = self.used - ceil((max(shift, 0.0) + self.free_length) / self.pitch)
    first_index = begin + shift / self.pitch
    ahead = min(max(floor(first_index), 0) - begin, self.used - 1 - end)
    w, x, y, z = hermite(first_index - ahead - begin, self.pitch)
    fading = exp(-self.pitch / self.registered_length)
    total = 0.0
    weight = 1.0
    for a in range(3):
        self.center[0, a] = self.center[1, a] = 0.0
    for k in range(end + 1 - begin):
        i = end - k
        j = i + ahead
        for a in range(3):
            value = w * self.reference_shape[j, a] + x * self.reference_shape[j + 1, a]
            value += y * self.reference_tangent[j, a] + z * self.reference_tangent[j + 1, a]
            self.onto[i, a] = value
            self.center[0, a] += weight * self.shape[i, a]
            self.center[1, a] += weight * value
        total += weight
        weight *= fading
    for a in range(3):
        self.center[0, a] /= total
        self.center[1, a] /= total
        for b in range(3):
            self.moment[a, b] = 0.0
    weight = 1.0
    for k in range(end + 1 - begin):
        i = end - k
        for b in range(3):
            other = weight * (self.onto[i, b] - self.center[1, b])
            for a in range(3):
                self.moment[a, b] += (self.shape[i, a] - self.center[0, a]) * other
        weight *= fading
    rotate_onto(self.moment, self.horn, self.vectors, self.rotation)
    for a in range(3):
        self.last_position[a] = moved(self, self.used, a)
        self.last_direction[a] = 0.0
        for b in range(3):
            self.last_direction[a] += self.rotation[a, b] * self.tangent[self.used, b]


def moved(self: TipTracking, i: int, a: int) -> float:
    """Coordinate of a node of this curve in the universal frame [m]."""
    value = self.center[1, a]
    for b in range(3):
        value += self.rotation[a, b] * (self.shape[i, b] - self.center[0, b])
    return value


def renew(self: TipTracking) -> None:
    """Make the present curve at its estimated position the new reference."""
    for i in range(NODES):
        for a in range(3):
            self.reference_shape[i, a] = moved(self, i, a)
            self.reference_tangent[i, a] = 0.0
            for b in range(3):
                self.reference_tangent[i, a] += self.rotation[a, b] * self.tangent[i, b]
    self.reference_travel = self.last_travel
    self.reference_lead = self.last_lead
    keep_curvature(self)
