"""A centerline of a vessel, from CSV or VTP, to the table of `vessel_travel` as a parameter set.

python -m fmus.vessel_travel.centerline mine.csv > mine.yaml
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Table = NDArray[np.float64]

POINTS = 41
SPACING = 20e-3  # of the table's points [m]
SAMPLING = 2e-3  # of the line between them [m]
SMOOTHING = 20e-3  # standard deviation [m]: what a catheter of 8 Fr does not follow, and noise of points
MM = 1e-3
COMPONENTS = {  # that have the table, or a part of it
    "vessel_travel": ("curvature_1", "curvature_2", "lumen"),
    "vessel_friction": ("curvature_1", "curvature_2"),
    "fluoroscope": ("curvature_1", "curvature_2", "lumen"),
}
RADIUS = "MaximumInscribedSphereRadius"  # VMTK's name of the lumen's radius at each point


def read_csv(path: Path) -> Table:
    """Points and radii in meters from columns x, y, z, radius in mm, under a line of names."""
    try:
        rows: Any = np.genfromtxt(
            path.read_text().splitlines() or ["nothing"], delimiter=",", names=True, dtype=np.float64
        )
        columns = [np.atleast_1d(rows[name]) for name in ("x", "y", "z", "radius")]
    except (ValueError, TypeError, IndexError) as error:
        text = f"{path}: {str(error).splitlines()[0]}. Expected columns x, y, z, radius [mm] under a line with these names."
        raise ValueError(text) from None
    return np.column_stack(columns) * MM


def read_vtp(path: Path) -> Table:
    """The same from a PolyData file of VMTK, in mm, with the radius as point data; ASCII only."""
    try:
        piece = ET.parse(path).getroot().find("PolyData/Piece")
    except ET.ParseError as error:
        raise ValueError(
            f"{path}: {error}. Expected a VTP file in ASCII; ParaView saves one as Data Mode: ASCII."
        ) from None
    points = None if piece is None else piece.find("Points/DataArray")
    radius = None if piece is None else piece.find(f"PointData/DataArray[@Name='{RADIUS}']")
    if points is None or radius is None:
        raise ValueError(f"{path}: no points, or no {RADIUS}. Expected a centerline as vmtkcenterlines writes it.")
    for array in (points, radius):
        if array.get("format") != "ascii":
            raise ValueError(
                f"{path}: {array.get('format')} data. Expected ASCII; ParaView saves it as Data Mode: ASCII."
            )
    coordinates = np.array((points.text or "").split(), dtype=np.float64).reshape(-1, 3)
    radii = np.array((radius.text or "").split(), dtype=np.float64)
    if len(coordinates) != len(radii):
        raise ValueError(f"{path}: {len(coordinates)} points, {len(radii)} radii. Expected one radius per point.")
    return np.column_stack((coordinates, radii)) * MM


READERS = {".csv": read_csv, ".vtp": read_vtp}


def read(path: Path) -> Table:
    """Points and radii [m] (points, 4), from the entry on, checked."""
    if path.suffix.lower() not in READERS:
        raise ValueError(f"{path}: ends with '{path.suffix}'. Expected {' or '.join(READERS)}.")
    if not path.is_file():
        raise ValueError(f"{path}: no such file. Expected a centerline, {' or '.join(READERS)}.")
    rows = READERS[path.suffix.lower()](path)
    for i, row in enumerate(rows):
        if not np.all(np.isfinite(row)):
            raise ValueError(f"{path}: point {i + 1} has a value that is no number. Remove the point, or mend it.")
    distances = np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1)
    if len(rows) < 4 or not 0.05 < distances.sum() < 5.0:
        raise ValueError(
            f"{path}: {len(rows)} points over {1e3 * distances.sum():.4g} mm. Expected 4 or more, in mm, over 50 to 5000 mm."
        )
    distinct: Table = rows[np.concatenate([[True], distances > 0.0])]
    return distinct


def table(rows: Table) -> dict[str, Table]:
    """Curvature [1/m] along two directions that do not turn about the line, and lumen [m], each SPACING.

    Behind the line's end it goes on straight; its part behind the table's end is cut off.
    """
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1))])
    count = round((POINTS - 1) * SPACING / SAMPLING) + 1
    locations = np.arange(count) * SAMPLING
    margin = np.arange(-3.0 * SMOOTHING, along[-1] + 3.0 * SMOOTHING, SAMPLING)
    line = np.column_stack([np.interp(margin, along, rows[:, a]) for a in range(3)])
    for end, inside in ((0, margin < 0.0), (-1, margin > along[-1])):  # straight on, so that smoothing bends no end
        step = (rows[1] - rows[0] if end == 0 else rows[-1] - rows[-2])[:3]
        line[inside] = rows[end, :3] + np.outer(margin[inside] - along[end], step / np.linalg.norm(step))
    weights = np.exp(-0.5 * (np.arange(-3.0 * SMOOTHING, 3.0 * SMOOTHING + 1e-9, SAMPLING) / SMOOTHING) ** 2)
    smooth = np.column_stack([np.convolve(line[:, a], weights / weights.sum(), "valid") for a in range(3)])

    tangents = np.gradient(smooth, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    bends = np.gradient(tangents, axis=0) / SAMPLING
    first = np.cross(tangents[0], np.eye(3)[np.argmin(np.abs(tangents[0]))])
    first /= np.linalg.norm(first)
    curvatures = np.zeros((count, 2))
    for i in range(min(count, len(smooth))):
        first = first - (first @ tangents[i]) * tangents[i]
        first /= np.linalg.norm(first)
        curvatures[i] = bends[i] @ first, bends[i] @ np.cross(tangents[i], first)
    every = slice(None, None, round(SPACING / SAMPLING))
    lumen = 2.0 * np.interp(locations, along, rows[:, 3])
    return {"curvature_1": curvatures[every, 0], "curvature_2": curvatures[every, 1], "lumen": lumen[every]}


def parameter_set(path: Path) -> str:
    """The table as YAML for `parameter_sets`."""
    values = table(read(path))
    texts = {
        "curvature_1": [f"{round(value, 2) + 0.0:.2f}" for value in values["curvature_1"]],
        "curvature_2": [f"{round(value, 2) + 0.0:.2f}" for value in values["curvature_2"]],
        "lumen": [f"{value / MM:.1f} mm" for value in values["lumen"]],
    }
    lines = [f"# from {path.name}: curvature [1/m] and lumen, every {SPACING / MM:.0f} mm"]
    for component, names in COMPONENTS.items():
        lines += [f"{component}:", *(f"  {name}: [{', '.join(texts[name])}]" for name in names)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    try:
        sys.stdout.write(parameter_set(Path(sys.argv[1])))
    except (ValueError, IndexError) as error:
        sys.exit(str(error) if len(sys.argv) > 1 else "centerline: no file named. Expected one .csv or .vtp.")
