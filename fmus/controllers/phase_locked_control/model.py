"""Force control that learns the gripper's trajectory over the phase of the beat."""

from math import exp, floor, pi

from fmus.beat_search import RING, TREND, BeatSearch, fit, forget, remember, scan
from fmus.phase_filter import (
    BINS,
    COLOR,
    HARMONICS,
    OFFSET,
    PHASE,
    RATE,
    PhaseFilter,
    begin_filter,
    clear_profile,
    correct,
    healthy,
    learn,
    look,
    predict,
    required,
)

from twin.component import Boolean, Int32, Int64, input, local, output, parameter, terminal

PI_ALONE, FADING, LOCKED, BLIND, DISTURBED = 0, 1, 2, 3, 4
SEARCHING, FOLLOWING, LEAVING = 0, 1, 2
LINE = 32  # periods that the demand is remembered

CLEAR = 0.25  # rest of the search with which to begin
PASSING = 0.1  # [s] over which the strain is averaged
STRAINED, RELAXED, CAP = 6.0, 3.0, 25.0  # squared innovation over its variance: one on the average, if all is well
JUDGED = 2.0  # [s] over which the force error is averaged
FADING_FEEDBACK = 0.02  # [s] in which the last force is forgotten when none comes


class PhaseLockedControl(BeatSearch, PhaseFilter):
    """Force controller that finds the beat in the force alone, and learns where the gripper has to be at each phase of it.

    Repetitive control over the phase of an extended Kalman filter; equations in the README.
    It knows nothing of a beat that comes early until it is there: then it is as good as its feedback.
    """

    period = 5e-3

    setpoint = input("N", "desired contact force", start=0.2, minimum=0.0, nominal=0.1)
    force = input("N", "measured contact force", nominal=0.1)
    enable = input("", "whether the learned motion may move the gripper; otherwise it fades out", start=True, type=Boolean)

    target_velocity = output("m/s", "velocity demand for the drive, positive distal", display_unit="mm/s")
    state = output("", "0 PI alone, 1 fading in or out, 2 locked, 3 no force is seen, 4 the beat is not as learned",
                   type=Int32)
    share = output("", "part of the learned motion that is fed forward")
    rate = output("Hz", "heart rate; 0: none yet")
    phase = output("rad", "phase of the first harmonic, from 0 to 2 pi")
    feedforward = output("m/s", "learned part of the demand", display_unit="mm/s")
    innovation = output("m", "last sample minus what was expected of it", display_unit="mm")
    strain = output("", "squared innovation over its variance, averaged: one if the model explains the force")

    drive = terminal("what it commands", rule="bus", target_velocity=target_velocity)

    proportional = parameter(1.5, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="chosen: with the wall 17 rad/s; 23 ms of delay leave 12 dB and 68 deg")
    velocity_maximum = parameter(0.5, "m/s", "limit of the velocity demand", display_unit="mm/s", minimum=0.0,
                                 source="as the other controllers: ten times what the heart needs")
    forward_maximum = parameter(0.25, "m/s", "limit of the learned part", display_unit="mm/s", minimum=0.0,
                                source="chosen: across 1 mm of friction and play in 4 ms")
    stiffness = parameter(11.2, "N/m", "contact force per motion of the tip", display_unit="N/mm", minimum=1.0,
                          source="of the bent end, 3 EI / L^3 of wall; 20 % off costs little")
    noise = parameter(0.5e-3, "m", "standard deviation of a sample", display_unit="mm", minimum=1e-6,
                      source="estimate: 3 mN of the sensor over the stiffness, and as much again for friction")
    delay = parameter(20e-3, "s", "from a demand until the force sensor's value shows it", display_unit="ms", minimum=5e-3,
                      maximum=0.1, source="one period each of sensor, controller and holding, 4 ms of the drive")
    lead = parameter(5e-3, "s", "by which what was learned is applied ahead", display_unit="ms", minimum=0.0, maximum=0.05,
                     source="chosen: a period; from 3 to 8 ms little changes, without it learning is slow and rings")
    blend = parameter(1.0, "s", "time in which the learned motion fades in and out", minimum=1e-2,
                      source="as the estimators: a beat")
    change_maximum = parameter(0.05, "N", "change of the force from one value to the next that is believed", minimum=0.0,
                               source="estimate: 0.3 m/s of an early beat over stiffness, and ten deviations of noise")
    still = parameter(8, "", "equal values in a row that are no longer believed", type=Int64, minimum=2,
                      source="chosen: by noise and resolution once in 2000 values; it costs one value")
    hold = parameter(0.5, "s", "time that it goes on without a believable force", minimum=0.0,
                     source="chosen: half a beat; the rate is known to 1 %")
    worse = parameter(1.0, "", "part of PI's own mean square error above which the learned motion is given up",
                      minimum=0.0, source="chosen: what is worse than PI alone is not used")

    mode = local(SEARCHING, "", "0 searching, 1 following, 2 leaving", type=Int32)
    demand = local(0.0, "m", "integral of the velocity demand", display_unit="mm")
    line = local(0.0, "m", "its last values, a ring", shape=(LINE,))
    head = local(0, "", "place of the latest", type=Int64)
    last_force = local(0.0, "N", "last value of the sensor")
    believed = local(0.0, "N", "last value that was believed")
    equal = local(0, "", "values in a row that were equal", type=Int64)
    unseen = local(0.0, "s", "time without a believable value")
    feedback = local(0.0, "N", "force error that the feedback sees")
    off_beat = local(False, "", "whether the beat is not as learned", type=Boolean)
    square = local(0.0, "N^2", "mean square of the force error")
    square_alone = local(0.0, "N^2", "the same when PI was last alone")
