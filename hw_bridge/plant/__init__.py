"""Bus of a run: simulated drives with the members' loads on a simulated bus, or an interface to real ones."""

from hw_bridge.plant.bench import Bench, bench_network, set_up
from hw_bridge.plant.plant import Plant, start_position, store_motor_parameters

__all__ = [
    "Bench",
    "Plant",
    "bench_network",
    "set_up",
    "start_position",
    "store_motor_parameters",
]
