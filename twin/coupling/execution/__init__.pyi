from . import condition_loop as condition_loop
