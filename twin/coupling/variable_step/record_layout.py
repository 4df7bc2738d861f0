"""What the walk knows beside the loop's own fields, and the columns of its tables."""

from __future__ import annotations

# addresses and counts; rows are int64 words unless said otherwise
INTEGERS = (
    "begins", "begin_count", "ends", "end_count",  # operations of members with a period: at its begin, at its end
    "stages", "stage_count", "leading_back",  # the last: operation of the connections that a sweep cannot know before
    # numbers of elements: those that a sweep cannot know before, that change in it, whose error is looked at
    "torn", "torn_count", "moving", "moving_count", "judged", "judged_count",
    "bonds", "bond_count",  # elements of power bonds
    "pairs", "pair_count", "energies",  # of them, whose product is a power, and what went through each bond
    "regions", "region_count", "states", "state_count",  # what is kept in order to go back
    "elements", "vectors", "course", "past", "weights", "solver",  # memory, see below
    "order", "recalls", "max_iterations", "scheme", "control", "trial", "strict",  # `recalls`: earlier points; `trial`: goes back
    "outputs_current",  # connections were asked at the end of the last step, and nothing has changed since
    "inside", "position", "divisions", "stride",  # in a tick, where, of how many parts, and the next step, in such
    "least", "passed", "refused",  # smallest step that is tried, that was made, and who made no smaller one
    # `limited`: to `until`, where a member came back (1) or the next event is (2); `off`: begins at `now`, between divisions
    "back", "limited", "off", "ending", "over",
    "early_returns", "early_return_count",  # of the fixed-step loop: flags, step [s], member of those that may come back early
    "events",  # who is told of every step that stays, where members have clocks
    "pending", "log_callback",  # whether a log line waits, and who is told what becomes of it
    "jacobian", "derives", "has_scales",  # there is one; members are asked for it; sizes are known from a trial step
    "sweeps", "accepted", "rejected", "missed", "missed_tick", "unsolved", "unsolved_tick",  # counts, first ticks
)  # fmt: skip
FLOATS = (
    "tick_length", "now", "until", "step_begin", "span", "due",  # times [s]: a tick's length, see above, the step at work, an event
    "tolerance", "coupling_tolerance", "floor", "smoothing", "relaxation", "linear_at", "correction",
    "next_step", "residual",  # length of the next step [s] if it could be any, and how good the last one was
)  # fmt: skip

# `vectors`: five of `elements` Float64 each, never taken back:
# what connections give, guess for the end, begin of the step, what is compared, largest
NOW, END, BEGIN, COMPARED, SCALE = range(5)

# `course`: four more, which are; behind them `past`: number of earlier points, and the two gaps to them [s]
# begin of the last step, of that before, where its course ended, what a bond is owed
EARLIER, BEFORE, LAST, LEFT = range(4)
PAST = 3  # words

# what an input is fed
HELD, EXTRAPOLATED, GUESSED, ARRIVED, TO_GUESS, TO_ARRIVED = range(6)

# which value of a course: its mean over the step; that of a first part, a last one; value, slope, curvature at the begin
MEAN, FIRST, FINAL, VALUE, SLOPE, CURVATURE = range(6)
USES = 6
NODES = 4  # weights per use: of three points, and of where the last course ended
SHARE = 0.125  # of a step that a member with direct feedthrough makes with the inputs of its end

SCHEMES = ("relaxed", "aitken", "anderson", "newton")
RELAXED, AITKEN, ANDERSON, NEWTON = range(4)
DEPTH = 4  # earlier iterations that Anderson's method looks at

FIXED, DOUBLING, PREDICTED, RESIDUAL = range(4)

# columns
STAGE = ("links", "direct", "gets", "parts", "part_count")  # the first three: addresses of operations
PART = ("feeds", "feed_count", "operation", "begin", "length")  # the last two: parts of the step, Float64 bits
FEED = ("now", "course", "source", "weights", "target", "kind")  # addresses of the element in both memories
REGION = ("address", "words", "first", "second")
# addresses of what an input was fed and of what came, there and back; unit [W], Float64 bits; whether it is the bond's last
PAIR = ("fed", "came", "fed_back", "came_back", "unit", "is_last")
STATE = ("get", "set", "instance", "first", "second", "member")

# status of an attempt, behind FMI's
UNSOLVED, EARLY, ASKING = 8, 9, 10  # ASKING: for a Jacobian
