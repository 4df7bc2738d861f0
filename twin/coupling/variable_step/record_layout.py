"""Fields of the loop's record for variable steps, and the columns of their tables."""

from __future__ import annotations

# addresses and counts; rows are int64 words unless said otherwise
INTEGERS = (
    "begins", "begin_count", "ends", "end_count",  # operations of members with a period: at its begin, at its end
    "stages", "stage_count", "feedback",  # the last: operation of the torn connections (feedback)
    # indices of elements: torn ones, those that change within a tick, those with error control
    "torn", "torn_count", "moving", "moving_count", "judged", "judged_count",
    "bonds", "bond_count",  # elements of power bonds
    "pairs", "pair_count", "energies",  # pairs of them whose product is a power, and the energy through each bond
    "regions", "region_count", "states", "state_count",  # state saved for rollback
    "elements", "vectors", "course", "past", "weights", "solver",  # memory, see below
    "order", "recalls", "max_iterations", "scheme", "control", "trial", "strict",  # `recalls`: uses earlier points; `trial`: rolls back
    "outputs_current",  # connections were read at the end of the last step and are still valid
    "in_tick", "position", "divisions", "stride",  # inside of a tick; position, divisions of a tick, next step [divisions]
    "least", "passed", "refused",  # smallest step to try, last one made, and 1 + the member that refused a smaller one
    # `limited`: the step ends at `until`, where a member returned early (1) or an event is (2); `off`: it begins at `now`,
    # between divisions
    "must_restore", "limited", "off", "ending", "over",
    "early_returns", "early_return_count",  # of the fixed-step loop: flags, step [s], member, for members that may return early
    "events",  # callback after every accepted step, if members have clocks
    "pending", "log_callback",  # whether log lines are buffered, and the callback for the outcome of their step
    "jacobian", "derives", "has_scales",  # a Jacobian is available; members provide it; sizes are known from a trial step
    "sweeps", "accepted", "rejected", "missed", "missed_tick", "unsolved", "unsolved_tick",  # counts, first ticks
)  # fmt: skip
# those that change from step to step and are no addresses: the progress that a checkpoint saves, with all of FLOATS
PROGRESS = (
    *("in_tick", "position", "stride", "least", "passed", "refused", "limited", "off", "ending", "over"),
    *("jacobian", "derives", "has_scales", "sweeps", "accepted", "rejected"),
    *("missed", "missed_tick", "unsolved", "unsolved_tick"),
)
FLOATS = (
    "tick_length",
    "now",
    "until",
    "step_begin",
    "span",
    "due",  # times [s]: length of a tick, see above, step in progress, next event
    "tolerance",
    "coupling_tolerance",
    "floor",
    "smoothing",
    "relaxation",
    "linear_at",
    "correction",
    "next_step",
    "residual",  # ideal length of the next step [s], and the error ratio of the last one
)

# `vectors`: five of `elements` Float64 each, not rolled back:
# current value of the connection, guess for the end, value at the begin of the step, value to compare, largest value
NOW, END, BEGIN, COMPARED, SCALE = range(5)

# `course`: four more, which are rolled back; after them `past`: number of earlier points, and the two gaps to them [s].
# value at the begin of the last step, of the one before, end of the last polynomial, energy correction of a bond
EARLIER, BEFORE, LAST, LEFT = range(4)
PAST = 3  # words

# kinds of values that an input is fed
HELD, EXTRAPOLATED, GUESSED, ARRIVED, TO_GUESS, TO_ARRIVED = range(6)

# values of a polynomial: mean over the step, over a first part, over a last part; value, slope, curvature at the begin
MEAN, FIRST, FINAL, VALUE, SLOPE, CURVATURE = range(6)
USES = 6
NODES = 4  # weights per use: of three points, and of the end of the last polynomial
SHARE = 0.125  # part of a step that a member with direct feedthrough makes with the inputs of its end

SCHEMES = ("relaxed", "aitken", "anderson", "newton")
RELAXED, AITKEN, ANDERSON, NEWTON = range(4)
DEPTH = 4  # earlier iterations in Anderson's method

FIXED, DOUBLING, PREDICTED, RESIDUAL = range(4)

# columns
STAGE = ("links", "direct", "gets", "parts", "part_count")  # the first three: addresses of operations
PART = ("feeds", "feed_count", "operation", "begin", "length")  # the last two: parts of the step, Float64 bits
FEED = ("now", "course", "source", "weights", "target", "kind")  # addresses of the element in both memories
REGION = ("address", "words", "first", "second")
# addresses of the fed and the received value, there and back; unit [W], Float64 bits; whether it is the bond's last pair
PAIR = ("fed", "came", "fed_back", "came_back", "unit", "is_last")
STATE = ("get", "set", "instance", "first", "second", "member")

# status of an attempt, beyond FMI's values
UNSOLVED, EARLY, ASKING = 8, 9, 10  # no convergence, early return, request for a Jacobian
