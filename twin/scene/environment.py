"""What instruments move in, as planar geometry: walls, where an instrument enters, the line along which it is laid.

x points to the right and y up; meters and newtons. Nothing here knows what moves or what touches what.
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
    """A line of walls, as thick as `thickness` with round ends; inside a closed one is material.

    What is None is for the instrument's component to say.
    """

    name: str
    points: NDArray[Any]  # [m], (n, 2); of a closed wall the first is not repeated
    closed: bool = False
    moves: str = ""  # what carries it, such as `heart`; nothing: fixed
    direction: NDArray[Any] = field(default_factory=_right)  # of that motion, (2,), length 1
    friction: float | None = None  # Coulomb's coefficient
    stiffness: float | None = None  # [N/m], of the contact at one point; None: rigid
    damping: float | None = None  # [N*s/m], likewise
    thickness: float = 0.0  # [m], half of it on each side of the line

    @property
    def outline(self) -> NDArray[Any]:
        """Its points, with the first once more at the end of a closed wall."""
        return np.vstack([self.points, self.points[:1]]) if self.closed else self.points


@dataclass(frozen=True, slots=True, eq=False)
class Environment:
    """Walls, and how an instrument gets between them."""

    name: str
    title: str
    walls: tuple[Wall, ...]
    entry: NDArray[Any]  # [m], (2,): where the grippers push the instrument in
    entry_direction: NDArray[Any]  # (2,), length 1
    path: NDArray[Any]  # [m], (n, 2): the middle line along which an instrument is laid at the start
    source: str = ""  # where its dimensions come from
    file: Path = field(default_factory=Path)

    @property
    def motions(self) -> tuple[str, ...]:
        """Names of what carries walls."""
        return tuple(dict.fromkeys(wall.moves for wall in self.walls if wall.moves))

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return geometry.length(self.path)

    @property
    def clearance(self) -> float:
        """From the path to the nearest wall's surface [m]: as thick an instrument's half may be."""
        return min(geometry.nearest(self.path, wall.outline)[0] - wall.thickness / 2 for wall in self.walls)
