"""The circle Hough transform on the ring alone, and where it still works among noise.

`image/fig10`: eight LEDs vote, each for the centres of all circles of a radius through it; at the ring's radius eight
votes meet in its centre, at any other radius fewer. `image/fig16`: the same among noise blobs, one of the source's two
identification simulations; its picture has no numbers, so ring and noise are drawn at random. Votes are counted once
more without the accumulator, by each cell's distance from each point.

Also in the rows: how often the cell with most votes is the ring, over random scenes, and what `identify` makes of them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.nav.identify.circle_hough import accumulate, find_circles, radius_row
from dockair.nav.identify.ring import IdentificationStatus, identify
from dockair.nav.identify.three_point import RADIUS_GATE
from dockair.rotations import Array
from dockair.scenarios.reproduce.image.grid import draw_points
from dockair.scenarios.reproduce.image.scene import CAMERA, CENTRE_PX, SIZE_PX, Scene, random_scene, ring_points
from dockair.scenarios.reproduce.reference import picture_name

ALONE_ID, ALONE_TITLE = "image/fig10", "circle Hough: votes of a ring of eight"
NOISE_ID, NOISE_TITLE = "image/fig16", "circle Hough among noise: votes over radius, vote map, members"
_SOURCE = "[Yoon 2018, {}]; reference: votes counted cell by cell"
_RADIUS_PX, _CELL_PX, _BAND = 80.0, 1.0, 0.02
_NOISE_BLOBS, _SEED, _SCENES = 20, 8, 60
_RADII_PX = (40.0, 160.0)
_SIZE_IN, _DPI = (11.0, 7.6), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Votes:
    """The transform of one scene."""

    radii_px: Array  #: (n,)
    most: NDArray[np.int64]  #: (n,) votes in the best cell of each radius
    map: Array  #: (rows, columns) at the best radius
    radius_px: float  #: the best
    centre_px: Array  #: (2,) of the best cells, their mean


def votes_of(points: Array) -> Votes:
    """Votes on a grid over the whole scene; of radii with equally many the middle one."""
    radii = np.arange(_RADII_PX[0], _RADII_PX[1] + 1.0, 2.0)
    maps = [_map(points, radius) for radius in radii]
    most = np.array([votes.max() for votes in maps], np.int64)
    equals = np.flatnonzero(most == most.max())
    best = int(equals[len(equals) // 2])
    rows, columns = np.nonzero(maps[best] == most[best])
    centre = _CELL_PX * np.array([columns.mean(), rows.mean()])
    return Votes(radii_px=radii, most=most, map=maps[best], radius_px=float(radii[best]), centre_px=centre)


def _map(points: Array, radius: float) -> Array:
    shape = round(SIZE_PX[1] / _CELL_PX) + 1, round(SIZE_PX[0] / _CELL_PX) + 1
    return accumulate(points, radius, np.zeros(2), shape, _CELL_PX, _BAND)


def _counted(points: Array, radius: float) -> NDArray[np.int64]:
    """The same votes by definition."""
    rows, columns = _map(points, radius).shape
    u, v = np.meshgrid(_CELL_PX * np.arange(columns), _CELL_PX * np.arange(rows))
    distance = np.hypot(u[..., None] - points[:, 0], v[..., None] - points[:, 1])
    return np.asarray((np.abs(distance - radius) <= _BAND * radius).sum(axis=2))


def _alone(out: Path | None) -> dict[str, Any]:
    points = ring_points(_RADIUS_PX)
    votes = votes_of(points)
    rows = [_row("eight LEDs", votes, points, _RADIUS_PX, CENTRE_PX), _row_of_lost_leds()]
    if out is not None:
        _draw_alone(points, votes, out / picture_name(ALONE_ID))
    return {"id": ALONE_ID, "source": _SOURCE.format("fig 10"), "rows": rows}


def _row(case: str, votes: Votes, points: Array, radius: float, centre: Array) -> dict[str, Any]:
    counted = _counted(points, votes.radius_px)
    ours = {
        "votes": int(votes.most.max()),
        "cells_that_differ": int((votes.map != counted).sum()),
        "radius_px": votes.radius_px,
        "centre_error_px": float(np.hypot(*(votes.centre_px - centre))),
    }
    return {
        "case": case,
        "ours": ours,
        "reference": {"votes": int(counted.max()), "cells_that_differ": 0, "radius_px": radius, "centre_error_px": 0.0},
    }


def _row_of_lost_leds() -> dict[str, Any]:
    points = ring_points(_RADIUS_PX)[[0, 1, 3, 4, 6]]
    return _row("three LEDs lost", votes_of(points), points, _RADIUS_PX, CENTRE_PX)


def _noise(out: Path | None) -> dict[str, Any]:
    scene = random_scene(np.random.default_rng(_SEED), _NOISE_BLOBS, radius_px=_RADIUS_PX)
    votes = votes_of(scene.points)
    chosen = _on_circle(scene.points, votes)
    row = _row(f"{_NOISE_BLOBS} noise blobs", votes, scene.points, scene.radius_px, scene.centre_px)
    row["ours"] |= {"leds_chosen": int((chosen < 8).sum()), "noise_chosen": int((chosen >= 8).sum())}
    rows = [row, *(_row_of_scenes(count) for count in (0, 10, 20, 40))]
    if out is not None:
        _draw_noise(scene, votes, chosen, out / picture_name(NOISE_ID))
    return {"id": NOISE_ID, "source": _SOURCE.format("fig 16"), "rows": rows}


def _on_circle(points: Array, votes: Votes) -> NDArray[np.int64]:
    distance = np.hypot(*(points - votes.centre_px).T)
    return np.flatnonzero(np.abs(distance - votes.radius_px) <= RADIUS_GATE * votes.radius_px)


def _row_of_scenes(noise: int) -> dict[str, Any]:
    """How often the first peak is the ring, with the radius open and known; and the whole identification."""
    rng = np.random.default_rng(_SEED + noise)
    open_, known, found, wrong = 0, 0, 0, 0
    for _ in range(_SCENES):
        scene = random_scene(rng, noise, tilt_rad=np.radians(20.0), noise_px=0.1)
        open_ += _first_peak_is_the_ring(scene, _RADII_PX)
        known += _first_peak_is_the_ring(scene, (0.85 * scene.radius_px, 1.15 * scene.radius_px))
        result = identify(scene.points, "circle_hough", camera=CAMERA)
        if result.status is IdentificationStatus.FOUND:
            right = bool((result.members < 8).all()) and len(result.members) >= 7
            found, wrong = found + right, wrong + (not right)
    percent = 100.0 / _SCENES
    ours = {
        "first_peak_percent": percent * open_,
        "first_peak_radius_known_percent": percent * known,
        "identified_percent": percent * found,
        "wrong_percent": percent * wrong,
    }
    return {"case": f"{_SCENES} scenes, {noise} noise blobs, tilt 20 deg", "ours": ours, "reference": {}}


def _first_peak_is_the_ring(scene: Scene, radii_px: tuple[float, float]) -> bool:
    middle = float(SIZE_PX[0]) / 2.0, float(SIZE_PX[1]) / 2.0
    peaks = find_circles(scene.points, radius_row(*radii_px), centre_gate=(*middle, float(max(SIZE_PX))), peaks=1)
    near = len(peaks.votes) > 0 and np.hypot(*(peaks.centre_px[0] - scene.centre_px)) < 0.25 * scene.radius_px
    return bool(near and abs(peaks.radius_px[0] - scene.radius_px) < 0.25 * scene.radius_px)


def _circle(axes: Any, centre: Array, radius: float, **style: Any) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle), **style)


def _draw_map(axes: Any, votes: Votes) -> None:
    from matplotlib.colors import PowerNorm

    extent = (-0.5 * _CELL_PX, SIZE_PX[0] + 0.5 * _CELL_PX, SIZE_PX[1] + 0.5 * _CELL_PX, -0.5 * _CELL_PX)
    grown = cv2.dilate(votes.map, np.ones((3, 3), np.uint8))  # one cell would not be seen
    shown = axes.imshow(grown, cmap="inferno", norm=PowerNorm(0.6), extent=extent, interpolation="nearest")
    axes.figure.colorbar(shown, ax=axes, label="votes", shrink=0.8)


def _draw_alone(points: Array, votes: Votes, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 3.9), dpi=_DPI, layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    for point in points:
        for radius, colour in ((0.6 * _RADIUS_PX, "#c9c9c9"), (_RADIUS_PX, "tab:blue")):
            _circle(left, point, radius, lw=0.8, color=colour)
    draw_points(left, points, color="black")
    left.set_title("circles around each LED: 48 px (grey), 80 px (blue)", fontsize=9)
    left.set(xlim=(0, SIZE_PX[0]), ylim=(SIZE_PX[1], 0), xlabel="u [px]", ylabel="v [px]")
    _draw_map(middle, votes)
    middle.set(xlabel="u [px]", ylabel="v [px]")
    middle.set_title(f"votes at {votes.radius_px:.0f} px", fontsize=9)
    _draw_votes_over_radius(right, votes, _RADIUS_PX)
    figure.savefig(path)


def _draw_votes_over_radius(axes: Any, votes: Votes, true_radius: float) -> None:
    axes.step(votes.radii_px, votes.most, where="mid", color="black")
    axes.axvline(true_radius, color="tab:orange", ls="--", label="true radius")
    axes.set(xlabel="radius [px]", ylabel="votes in the best cell", ylim=(0, None))
    axes.legend(frameon=False, fontsize=8)


def _draw_noise(scene: Scene, votes: Votes, chosen: NDArray[np.int64], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    (first, second), (third, fourth) = figure.subplots(2, 2)
    for point in scene.points:
        _circle(first, point, votes.radius_px, lw=0.5, color="tab:blue")
    draw_points(first, scene.points, color="black")
    first.set_title("(a, b) candidates and their circles at the best radius", fontsize=9)
    _draw_votes_over_radius(second, votes, scene.radius_px)
    _draw_map(third, votes)
    third.set_title(f"(c) votes at {votes.radius_px:.0f} px", fontsize=9)
    draw_points(fourth, scene.points, color="#9a9a9a")
    draw_points(fourth, scene.points[chosen], ms=9.0, mfc="none", mec="tab:red", mew=1.5)
    _circle(fourth, votes.centre_px, votes.radius_px, lw=1.0, color="tab:red")
    fourth.set_title(f"(d) within 10 % of the circle: {len(chosen)}, of which LEDs {(chosen < 8).sum()}", fontsize=9)
    for axes in (first, third, fourth):
        axes.set(xlim=(0, SIZE_PX[0]), ylim=(SIZE_PX[1], 0), xlabel="u [px]", ylabel="v [px]")
    figure.savefig(path)


REPRODUCTIONS = {
    ALONE_ID: (ALONE_TITLE, _alone),
    NOISE_ID: (NOISE_TITLE, _noise),
}
