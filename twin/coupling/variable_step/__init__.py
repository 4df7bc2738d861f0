"""The compiled walk of algorithms that extrapolate, iterate, or take steps back: functions over the loop's record.

They are plain Python, as `loop` is, and work off the tables of `stages`. `sweep` steps all members once, `solve` repeats
that until the coupling agrees with itself, `control` chooses the steps between two ticks, `run` goes from tick to tick.
"""
