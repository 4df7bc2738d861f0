"""A sheath that a chirp moves, recorded: what identify files in the tests are about."""

import numpy as np

from twin.run import build_simulation, recorded_signals, resolve_catalogs
from twin.scenario import Backend, parse_scenario

MODEL = """
stop_time: 4 s
members:
  chirp:  {component: chirp, parameters: {frequency_start: 0.5 Hz, frequency_final: 4 Hz, total_time: 4 s}}
  sheath: {component: sheath}
connections: [chirp.position -> sheath.gripper_position]
record: {variables: ["*.*"]}
"""
FILE = """
component: sheath
data: [gripper.csv, tip.csv]
inputs: {"gripper [mm]": sheath.gripper_position}
outputs: {"tip [mm]": sheath.tip_position}
fit: {"sheath.play[2]": {from: 0 mm, to: 1.5 mm}}
"""
NOISE = 0.1e-3  # of the tip [m]


def simulated(build, *overrides, text=MODEL):
    """Signals of the model with other values."""
    scenario = parse_scenario(text, "model.yaml", overrides)
    case = scenario.cases()[0]
    running = build_simulation(case, resolve_catalogs(scenario)["base"], Backend.compiled, build)
    try:
        running.initialize(case.start_ns, case.stop_ns)
        running.advance(case.stop_ns)
        return recorded_signals(running, complete=True)
    finally:
        running.terminate()


def write(path, header, *columns):
    np.savetxt(path, np.stack(columns, 1), "%.17g", ",", header=header, comments="")


def recorded(folder, build, *overrides, seed=1, noise=NOISE, late=0.0):
    """gripper.csv at every step, what drove and not the input, which is recorded a step late, and tip.csv at 25 ms with noise; the signals."""
    found = simulated(build, *overrides)
    generator = np.random.default_rng(seed)
    tip = found.values["sheath.tip_position"][::25]
    write(folder / "gripper.csv", "time [s],gripper [mm]", found.time, 1e3 * found.values["chirp.position"])
    tip = tip + noise * generator.standard_normal(len(tip))
    write(folder / "tip.csv", "time [ms],tip [mm]", 1e3 * (found.time[::25] + late), 1e3 * tip)
    return found


def identify_file(folder, text=FILE):
    path = folder / "identify.yaml"
    path.write_text(text)
    return path
