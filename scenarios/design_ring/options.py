"""The options of `dockair design-ring` as rings and nodes; what is out of its limits is refused."""

from pathlib import Path

import numpy as np

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.parameters import read_sheet
from dockair.scenarios.design_ring.ranking import (
    RANKINGS,
    SPACINGS,
    Corridor,
    Ranking,
    RingDesign,
    designs,
    inner_radius,
    rank,
)

_RANGES, _TILTS = 9, 5  # nodes: ranges in equal ratios, tilts in equal steps
_AT_RANGE_M = 10.0  # of the figures of single nodes, where the corridor holds it


def rings_from_options(rim: str, inner: str, depth: str, diameter: str, spacing: str) -> list[RingDesign]:
    """Return the rings that the options ask for.

    Raises:
        DockairError: an option is no list of numbers or names, or one is out of its limits.
    """
    throat_x = read_sheet("drogue")["throat_x_m"].value
    throat_m = 2.0 * inner_radius(RingDesign(depth_m=throat_x))
    inners = [round(value) for value in numbers("--inner", inner, 0, 32, "whole")]
    depths = numbers("--depth", depth, -0.3, throat_x, "m, the mouth of the coupling being the deepest")
    diameters = numbers("--diameter", diameter, 0.05, 5.0, "m")
    if any(inners) and any(depths) and min(diameters) <= throat_m:
        words = f"wider than the coupling's mouth, {throat_m:g} m, where there are LEDs inside"
        raise DockairError("--diameter", expected=words, got=diameter)
    if any(inners) and 0.0 in depths:
        raise DockairError("--depth", expected="numbers other than 0, which is the rim's plane", got=depth)
    spacings = [name.strip() for name in spacing.split(",")]
    for name in spacings:
        if name not in SPACINGS:
            raise DockairError("--spacing", expected="a spacing", got=name, exists=SPACINGS)
    rims = [round(value) for value in numbers("--rim", rim, 3, 64, "whole")]
    return designs(rims, diameters, spacings, inners, depths)


def corridor_from_options(ranges: str, tilt_deg: float, sigma_px: float, camera: Path | None = None) -> Corridor:
    """Return the nodes, seen by the default camera or by that of a sheet.

    Raises:
        DockairError: an option is out of its limits.
    """
    limits = numbers("--ranges", ranges, 0.3, 1000.0, "m")
    low, high = limits[0], limits[-1]
    if len(limits) != 2 or not low < high:
        raise DockairError("--ranges", expected="nearest and farthest, as in 2,30", got=ranges)
    if not 0.0 <= tilt_deg <= 80.0:
        raise DockairError("--tilt", expected="a number from 0 to 80 deg", got=tilt_deg)
    if not 1e-4 <= sigma_px <= 100.0:
        raise DockairError("--sigma-px", expected="a number from 0.0001 to 100 px", got=sigma_px)
    tilts = np.deg2rad(np.linspace(0.0, tilt_deg, _TILTS if tilt_deg > 0.0 else 1))
    return Corridor(
        ranges_m=np.geomspace(low, high, _RANGES),
        tilts_rad=tilts,
        sigma_px=sigma_px,
        camera=Camera() if camera is None else Camera.from_toml(camera),
    )


def numbers(option: str, text: str, low: float, high: float, unit: str) -> list[float]:
    """Return the numbers of a list as in 0.4,0.5, without repetitions.

    Raises:
        DockairError: an entry is no number, or is out of its limits.
    """
    found = []
    for entry in text.split(","):
        try:
            value = float(entry)
        except ValueError:
            value = np.nan
        if not low <= value <= high or (unit == "whole" and value != round(value)):
            raise DockairError(option, expected=f"numbers from {low:g} to {high:g} ({unit})", got=entry.strip())
        found.append(value)
    return list(dict.fromkeys(found))


def require_ranking(by: str) -> None:
    """Refuse what nothing is ranked by.

    Raises:
        DockairError: no such ranking.
    """
    if by not in RANKINGS:
        raise DockairError("--by", expected="what to rank by", got=by, exists=RANKINGS)


def ranking_from(rings: list[RingDesign], corridor: Corridor, by: str) -> Ranking:
    """Return the ranking; `by` is one of RANKINGS."""
    low, high = corridor.ranges_m[[0, -1]]
    at = _AT_RANGE_M if low <= _AT_RANGE_M <= high else float(np.sqrt(low * high))
    return rank(rings, corridor, by, at)
