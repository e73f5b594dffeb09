"""Columns of a flight's log as the picture needs them: vectors, attitudes, level axes from the hose's exit."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dockair.rotations import Array


def values(flight: Any, name: str) -> Array:
    """(ticks,) one column of `flight.parquet`."""
    return np.asarray(flight[name].to_numpy(zero_copy_only=False))


def vectors(flight: Any, name: str, unit: str = "m") -> Array:
    """(ticks, 3) the columns of a vector, in the unit that their names end with."""
    return np.column_stack([values(flight, f"{name}_{axis}_{unit}") for axis in "xyz"])


def attitude(flight: Any, name: str) -> Rotation:
    """Return the rotations of a quaternion's columns, one a tick."""
    w, x, y, z = (values(flight, f"{name}_{part}") for part in "wxyz")
    return Rotation.from_quat(np.column_stack([x, y, z, w]))


def level_axes(flight: Any) -> tuple[Rotation, Array]:
    """Return R_EW, one a tick, and p_WE (ticks, 3) [m]: E is level, along the tanker's heading, in the exit."""
    turn, place = attitude(flight, "truth_q_WT"), vectors(flight, "truth_p_WT")
    exit_W = place + turn.apply(-place[0])  # at the start the exit is W's origin, and T's axes are W's
    ahead = turn.apply([1.0, 0.0, 0.0])
    return Rotation.from_rotvec(np.outer(-np.arctan2(ahead[:, 1], ahead[:, 0]), [0.0, 0.0, 1.0])), exit_W


def contact(flight: Any) -> tuple[bool, int]:
    """Return whether the probe was held, and the tick of that, or where the tip was nearest to the drogue."""
    held = np.flatnonzero(values(flight, "truth_latched"))
    if len(held):
        return True, int(held[0])
    apart_m = np.linalg.norm(vectors(flight, "truth_p_WP") - vectors(flight, "truth_p_WD"), axis=1)
    return False, int(np.argmin(apart_m))


def not_valid(flight: Any) -> NDArray[np.bool_]:
    """(ticks,) where no solution may be flown on: a line across them would read as drift."""
    return np.asarray(~values(flight, "nav_valid").astype(bool))


def fresh(flight: Any) -> NDArray[np.int64]:
    """Return the ticks with a new frame; every tick of a flight without camera."""
    stamps = values(flight, "nav_frame_time_stamp_s")
    if not np.isfinite(stamps).any():
        return np.arange(len(stamps), dtype=np.int64)
    before = np.nan_to_num(np.concatenate([[np.nan], stamps[:-1]]), nan=-np.inf)
    return np.asarray(np.flatnonzero(stamps > before), dtype=np.int64)


def without_frame(flight: Any) -> NDArray[np.int64]:
    """Return the ticks at which the newest frame used came more than two of the usual intervals before."""
    came = fresh(flight)
    if len(came) < 2:
        return np.empty(0, dtype=np.int64)
    ticks = np.arange(came[0], len(flight), dtype=np.int64)
    since = ticks - came[np.searchsorted(came, ticks, side="right") - 1]
    return np.asarray(ticks[since > 2.0 * np.median(np.diff(came))])
