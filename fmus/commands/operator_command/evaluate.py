"""What Al-Ahmad et al. (RACS), section VI, show of a navigation: held instruments, one move in the field of view, Fig. 10C and D."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Signal = NDArray[np.float64]

STEP = 20e-3  # between recorded rows, as scenarios/in_vivo_navigation.yaml [s]
SETTLING = 0.4  # after a stop, until the grips have settled and the estimate has come [s]
PITCH = 10e-3  # of the gratings [m]
GRATINGS = 38


def intervals(where: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row and row behind the last of each run of rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def still(held: Signal, catheter_speed: Signal, wire_speed: Signal, catheter: Signal, wire: Signal) -> dict[str, float]:
    """Largest motion of a held tip and largest speed commanded to it while held."""
    settling = round(SETTLING / STEP)
    result = {}
    for name, own, speed, tip in (("catheter", 1, catheter_speed, catheter), ("wire", 2, wire_speed, wire)):
        moved, commanded = [0.0], [0.0]
        for first, end in intervals((held == own) | (held == 3)):
            if end - first > settling:
                moved.append(float(np.ptp(tip[first + settling : end])))
                commanded.append(float(np.abs(speed[first + settling : end]).max()))
        result[f"{name}_moved"], result[f"{name}_asked"] = max(moved), max(commanded)
    return result


def moves(speed: Signal, true: Signal, hall: Signal, shift: Signal, fused: Signal) -> dict[str, float]:
    """Distances of the last two moves, out and back, each read once at rest; the paper compares the two measures.

    A move is read `SETTLING` after its end and just before its start.
    """
    rows = ends(speed)
    distance = {
        name: values[rows[:, 1]] - values[rows[:, 0]]
        for name, values in (("true", true), ("hall", hall), ("shift", shift), ("fused", fused))
    }
    return {
        "difference": float(np.abs(distance["hall"] - distance["shift"]).mean()),
        "difference_out": float(abs(distance["hall"][0] - distance["shift"][0])),
        "difference_back": float(abs(distance["hall"][1] - distance["shift"][1])),
        "way": float(np.abs(distance["hall"]).mean()),
        **{
            f"{name}_error": float(np.abs(distance[name] - distance["true"]).mean())
            for name in ("hall", "shift", "fused")
        },
    }


def ends(speed: Signal) -> NDArray[np.intp]:
    """Rows at rest before and after each of the last two moves, (2, 2)."""
    runs = intervals(np.abs(speed) > 0.0)[-2:]
    if len(runs) < 2:
        raise ValueError(f"{len(runs)} moves of the catheter in the recording. Expected two at least, out and back")
    settling = round(SETTLING / STEP)
    return np.array([(max(first - 1, 0), min(end + settling, len(speed) - 1)) for first, end in runs])


def profiles(speed: Signal, shift: Signal, curvature: Signal, shape: Signal) -> dict[str, Signal | float]:
    """Fig. 10C and D: the curvature profile and the curve before and after the last move out, registered.

    Steps 5 to 7 of section IV.C with the travel by shift; the curve is shown in the plane in which it is bent most.
    """
    start, stop = ends(speed)[0]
    travel = float(shift[stop] - shift[start])
    position = (np.arange(GRATINGS) + 0.5) * PITCH
    first, last = (np.hypot(*curvature[row, :GRATINGS].T) for row in (start, stop))

    # the nodes of now that lie where the curve of before did
    nodes = np.arange(GRATINGS + 1) * PITCH
    before, after = shape[start, : GRATINGS + 1], shape[stop, : GRATINGS + 1]
    inside = nodes + travel <= nodes[-1]
    onto = np.column_stack([np.interp(nodes[inside] + travel, nodes, before[:, a]) for a in range(3)])
    moved, center = after[inside].mean(axis=0), onto.mean(axis=0)
    left, _, right = np.linalg.svd((after[inside] - moved).T @ (onto - center))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    registered = (after - moved) @ (left @ flip @ right) + center
    plane = np.linalg.svd(before - before.mean(axis=0), full_matrices=False)[2][:2]
    plane = plane * np.sign((plane @ (before[-1] - before[0]))[:, None])
    off = np.linalg.norm(registered[inside] - onto, axis=1)

    rows = len(speed)
    columns = {
        "place": position,
        "place_before": position - travel,
        "first": first,
        "last": last,
        "first_along": before @ plane[0],
        "first_across": before @ plane[1],
        "last_along": registered @ plane[0],
        "last_across": registered @ plane[1],
    }
    table: dict[str, Signal | float] = {name: padded(values, rows) for name, values in columns.items()}
    return {**table, "registered_rms": float(np.sqrt(np.mean(off**2))), "travel": travel}


def padded(values: Signal, rows: int) -> Signal:
    """Pad values with NaN to the number of recorded rows."""
    column = np.full(rows, np.nan)
    column[: len(values)] = values
    return column


still.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(("catheter_moved", "wire_moved"), "m"),
    **dict.fromkeys(("catheter_asked", "wire_asked"), "m/s"),
}
moves.outputs = dict.fromkeys(  # type: ignore[attr-defined]
    ("difference", "difference_out", "difference_back", "way", "hall_error", "shift_error", "fused_error"), "m"
)
profiles.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(("place", "place_before", "first_along", "first_across", "last_along", "last_across"), "m"),
    **dict.fromkeys(("first", "last"), "1/m"),
    **dict.fromkeys(("registered_rms", "travel"), "m"),
}
still.row_interval = STEP  # type: ignore[attr-defined]
moves.row_interval = STEP  # type: ignore[attr-defined]
profiles.row_interval = STEP  # type: ignore[attr-defined]
