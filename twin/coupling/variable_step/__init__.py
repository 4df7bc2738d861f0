"""Compiled variable-step master for algorithms that extrapolate, iterate, or roll back: functions over the loop's record.

They are plain Python, as `loop` is, and execute the tables of `stage_tables`. `explicit_step.sweep` steps all members once,
`implicit_step.solve` repeats that until the coupling converges, `stepping` and `step_control` choose the steps between two
ticks, `stepping.run` advances from tick to tick.
"""
