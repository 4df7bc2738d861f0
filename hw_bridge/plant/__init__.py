"""Bus of a run: simulated drives with the members' loads on a simulated bus, or an interface to real ones."""

from hw_bridge.plant.bench import Bench as Bench
from hw_bridge.plant.bench import bench_network as bench_network
from hw_bridge.plant.bench import set_up as set_up
from hw_bridge.plant.plant import Plant as Plant
from hw_bridge.plant.plant import start_position as start_position
from hw_bridge.plant.plant import store_motor_parameters as store_motor_parameters
