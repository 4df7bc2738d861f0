"""What a run stands on: simulated drives that feel the members' loads on a simulated bus, or a wire to real ones."""

from hw_bridge.plant.bench import Bench, bench_network, set_up
from hw_bridge.plant.plant import Plant, beginning, set_up_for

__all__ = [
    "Bench",
    "Plant",
    "beginning",
    "bench_network",
    "set_up",
    "set_up_for",
]
