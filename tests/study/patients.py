"""A heart that beats against a held catheter, and studies of it: what the tests of studies are about."""

import os
import signal
import time
from pathlib import Path

from twin.component import PythonComponent, input, output, parameter

SCENARIO = """
stop_time: 1.5 s
seeds: [1]
members:
  heart:  {component: heart}
  wall:   {component: wall, parameters: {tip_position: -17 mm}}
  sensor: {component: force_sensor}
connections:
  - heart.position -> wall.heart_position
  - wall.force -> sensor.force
variants:
  plain: {}
  soft: {members: {wall: {parameters: {wall_modulus: 50 kPa}}}}
record: {every: 5 ms, variables: [sensor.measured_force, heart.position]}
metrics:
  force_max: {signal: sensor.measured_force, reduce: max, from: 0.5 s, unit: mN}
  motion: {signal: heart.position, reduce: max_abs, from: 1 s, unit: mm}
expect:
  - {name: gentle, metric: force_max, at_most: 90 mN}
  - {name: softer is gentler, metric: force_max, ordered: [plain, soft]}
"""
STUDY = """
scenario: scenario.yaml
samples: {method: latin_hypercube, count: 6, seed: 3}
vary:
  heart.rate: {normal: [70 /min, 12 /min], from: 45 /min, to: 110 /min, source: assumed}
  heart.scale: {uniform: [0.5, 1.5], source: assumed}
  bent end: {scales: wall.bending_stiffness, log_normal: [1, 1.2], source: assumed}
keep: {bands: {force: {signal: sensor.measured_force, unit: mN}}, every: 50 ms}
"""
FATAL = """
stop_time: 10 ms
members:
  one: {component: "tests.study.patients:Fatal"}
record: {variables: [one.y]}
metrics: {y: {signal: one.y, reduce: final}}
"""


def study_file(folder: Path, text: str = STUDY, scenario: str = SCENARIO) -> Path:
    """Write the files of a study."""
    (folder / "scenario.yaml").write_text(scenario)
    path = folder / "patients.yaml"
    path.write_text(text)
    return path


class Fatal(PythonComponent):
    """Ends its process, or hangs, or eats memory, as asked; with `once` only where nobody has done so before."""

    u = input("", "nothing")
    y = output("", "twice the way that was asked for")
    way = parameter(0.0, "", "0: none, 1: killed, 2: hangs, 3: eats memory", source="the test")
    once = parameter(0.0, "", "whether the second try goes well", source="the test")

    def initialize(self) -> None:
        self.y = 2.0 * self.way
        marker = Path(f"{os.environ['TMPDIR']}/fatal-{self.way:g}")
        if self.once and marker.exists():
            return
        marker.touch()
        if self.way == 1.0:
            os.kill(os.getpid(), signal.SIGKILL)
        elif self.way == 2.0:
            time.sleep(60.0)
        elif self.way == 3.0:
            self.eaten = bytearray(1 << 36)

    def step(self, t: float, h: float) -> int:
        return 0
