"""The bench of bodies on one core: cost per segment and substep, real-time factor, and how it grows.

    python -m benchmarks.bench           prints `name: value` lines

Processor time, not wall time, of the component alone while the gripper moves like the heart. `space` is Chipmunk's part.
"""

from __future__ import annotations

import time
from typing import Any

from fmus.chain_on_wall.model import ChainOnWall

from benchmarks.force import one_core
from twin.component import catalog

H = 1e-3  # communication step [s]
SECONDS = 2.0  # simulated
COUNTS = (30, 60, 120, 240)
SCALE = 1e4  # no count is refused: what is measured is cost, not accuracy


def heart(seconds: float) -> list[float]:
    """Where the heart is at each communication point [m]."""
    part: Any = catalog.component("heart")(blend_in=0.0)
    part.start(0.0)
    found = []
    for i in range(round(seconds / H)):
        part.advance(i * H, H)
        found.append(float(part.position))
    return found


def stepping(part: ChainOnWall, path: list[float]) -> float:
    """Processor time of the steps [s]."""
    part.start(0.0)
    begin = time.process_time()
    for i, place in enumerate(path):
        part.gripper_position = part.heart_position = place
        part.advance(i * H, H)
    return time.process_time() - begin


def space_alone(part: ChainOnWall, count: int) -> float:
    """Processor time of one substep [s]."""
    assert part._world is not None
    begin = time.process_time()
    for _ in range(count):
        part._world.space.step(part._world.cut.substep)
    return (time.process_time() - begin) / count


def measure(seconds: float = SECONDS, counts: tuple[int, ...] = COUNTS) -> None:
    """Print the figures."""
    path = heart(seconds)
    for count in counts:
        part = ChainOnWall(segments=count, largest_mass_scale=SCALE)
        took = stepping(part, path)
        alone = space_alone(part, round(seconds / H))
        print(f"bench_{count}_factor: {seconds / took:.2f}")
        print(f"bench_{count}_step_us: {1e6 * took * H / seconds:.0f}")
        print(f"bench_{count}_substep_us: {1e6 * alone:.1f}")
        print(f"bench_{count}_substep_per_segment_ns: {1e9 * alone / count:.0f}")
        print(f"bench_{count}_share_of_space: {4.0 * alone / (took * H / seconds):.2f}", flush=True)


def main() -> None:
    """Print the figures, on one core."""
    one_core()
    measure()


if __name__ == "__main__":
    main()
