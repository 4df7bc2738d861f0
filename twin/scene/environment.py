"""Environment of instruments as planar geometry: walls, entry point and direction, path of the instrument.

x points to the right and y up; meters and newtons. Motion and contact are computed elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.scene import geometry

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _right() -> NDArray[Any]:
    return np.array([1.0, 0.0])


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """Polyline of a wall, as thick as `thickness` with round ends; the inside of a closed one is solid.

    None: value of the instrument's component.
    """

    name: str
    points: NDArray[Any]  # [m], (n, 2); of a closed wall the first is not repeated
    closed: bool = False
    moves: str = ""  # name of the motion that carries it, such as `heart`; empty: fixed
    direction: NDArray[Any] = field(default_factory=_right)  # of that motion, (2,), length 1
    friction: float | None = None  # Coulomb's coefficient
    stiffness: float | None = None  # [N/m], of the contact at one point; None: rigid
    damping: float | None = None  # [N*s/m], likewise
    thickness: float = 0.0  # [m], half of it on each side of the line

    @property
    def outline(self) -> NDArray[Any]:
        """Points of the line; a closed wall ends with its first point."""
        return np.vstack([self.points, self.points[:1]]) if self.closed else self.points


@dataclass(frozen=True, slots=True, eq=False)
class Environment:
    """Walls, and the entry of an instrument."""

    name: str
    title: str
    walls: tuple[Wall, ...]
    entry: NDArray[Any]  # [m], (2,): where the grippers insert the instrument
    entry_direction: NDArray[Any]  # (2,), length 1
    path: NDArray[Any]  # [m], (n, 2): center line of an instrument at the start
    source: str = ""  # source of the dimensions
    file: Path = field(default_factory=Path)

    @property
    def motions(self) -> tuple[str, ...]:
        """Names of the motions that carry walls."""
        return tuple(dict.fromkeys(wall.moves for wall in self.walls if wall.moves))

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return geometry.polyline_length(self.path)

    @property
    def clearance(self) -> float:
        """Smallest distance from the path to a wall's surface [m]: limit of an instrument's radius."""
        return min(geometry.closest_approach(self.path, wall.outline)[0] - wall.thickness / 2 for wall in self.walls)
