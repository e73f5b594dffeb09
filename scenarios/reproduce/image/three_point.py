"""Circles through three candidates and the surface of their trust.

As printed the most trusted circle is the median of all circles, which is the ring's while its 56 circles are the
majority: two noise blobs end that. With each distance capped it is the densest place, and the picture is the source's:
a peak at the ring, low ground elsewhere. The rows say how often either picks the ring in random scenes, and how often
`identify`, which judges triples by the ring's exact image, names it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.identify.ellipse import fit_ellipse
from dockair.nav.identify.ring import IdentificationStatus, identify
from dockair.nav.identify.three_point import (
    RADIUS_GATE,
    TrustedCircle,
    all_triples,
    circles_through,
    most_trusted_circle,
    trust,
)
from dockair.rotations import Array
from dockair.scenarios.reproduce.image.grid import draw_points
from dockair.scenarios.reproduce.image.scene import CAMERA, SIZE_PX, Scene, random_scene
from dockair.scenarios.reproduce.reference import picture_name, read_figure

ID = "image/fig17"
TITLE = "three-point circles, their trust, the ring they find"
_SOURCE = "[Yoon 2018, fig 17, eqs 4-11]"
_SEED, _SCENES, _NOISE_BLOBS = 20, 40, 16
_RADIUS_RANGE_PX = (20.0, 200.0)
_CAP_PX = 5.0  # of an LED's circles the centres lie so near to each other, a tilted ring's too
_SIZE_IN, _DPI = (11.0, 8.6), 110


def reproduce(out: Path | None) -> dict[str, Any]:
    """Trust in one scene drawn in `out`, and over many in the rows."""
    printed = read_figure("yoon_2018_image", "17")
    scene = random_scene(np.random.default_rng(_SEED), _NOISE_BLOBS, tilt_rad=np.radians(10.0), noise_px=0.2)
    chosen = _most_trusted(scene.points, _CAP_PX)
    ours = {
        "radius_gate_percent": 100.0 * RADIUS_GATE,
        "leds_chosen": int((chosen.members < 8).sum()),
        "noise_chosen": int((chosen.members >= 8).sum()),
        "centre_error_px": float(np.hypot(*(chosen.centre_px - scene.centre_px))),
        "radius_error_percent": float(100.0 * (chosen.radius_px / scene.radius_px - 1.0)),
    }
    reference = {**printed, "leds_chosen": 8}
    rows = [{"case": f"{_NOISE_BLOBS} noise blobs", "ours": ours, "reference": reference}]
    rows += [_row_of_scenes(count) for count in (0, 1, 2, 4, 8, 16)]
    if out is not None:
        _draw(scene, chosen, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _most_trusted(points: Array, cap_px: float) -> TrustedCircle:
    chosen = most_trusted_circle(points, cap_px=cap_px, radius_range_px=_RADIUS_RANGE_PX)
    assert chosen is not None, "a ring has circles"
    return chosen


def _row_of_scenes(noise: int) -> dict[str, Any]:
    rng = np.random.default_rng(_SEED + noise)
    right = {"as_printed_percent": 0, "capped_percent": 0, "identified_percent": 0, "wrong_percent": 0}
    for _ in range(_SCENES):
        scene = random_scene(rng, noise, tilt_rad=np.radians(20.0), noise_px=0.1)
        right["as_printed_percent"] += _is_the_ring(_most_trusted(scene.points, np.inf), scene)
        right["capped_percent"] += _is_the_ring(_most_trusted(scene.points, _CAP_PX), scene)
        result = identify(scene.points, camera=CAMERA)
        if result.status is IdentificationStatus.FOUND:
            is_right = len(result.members) >= 7 and bool((result.members < 8).all())
            right["identified_percent" if is_right else "wrong_percent"] += 1
    ours = {key: 100.0 * count / _SCENES for key, count in right.items()}
    return {"case": f"{_SCENES} scenes, {noise} noise blobs, tilt 20 deg", "ours": ours, "reference": {}}


def _is_the_ring(circle: TrustedCircle, scene: Scene) -> bool:
    """Near its centre, with at least six of its LEDs within the gate; noise on the ring is not the method's fault."""
    near = np.hypot(*(circle.centre_px - scene.centre_px)) < 0.1 * scene.radius_px
    return bool(near and (circle.members < 8).sum() >= 6)


def _draw(scene: Scene, chosen: TrustedCircle, path: Path) -> None:
    from matplotlib.figure import Figure

    centres, radii = circles_through(scene.points, all_triples(len(scene.points)))
    kept = np.isfinite(radii) & (radii > _RADIUS_RANGE_PX[0]) & (radii < _RADIUS_RANGE_PX[1])
    centres, radii = centres[kept], radii[kept]
    T = trust(centres, radii, cap_px=_CAP_PX)
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    first, second, fourth = (figure.add_subplot(2, 2, place) for place in (1, 2, 4))
    draw_points(first, scene.points, color="black")
    first.set_title(f"(a) eight LEDs and {len(scene.points) - 8} noise blobs", fontsize=9)
    draw_points(second, centres, ms=1.5, color="tab:blue")
    draw_points(second, scene.points, color="black")
    second.set_title(f"(b) centres of {len(centres)} circles through three", fontsize=9)
    _draw_surface(figure.add_subplot(2, 2, 3, projection="3d"), centres, T)
    draw_points(fourth, scene.points, color="#9a9a9a")
    draw_points(fourth, scene.points[chosen.members], ms=9.0, mfc="none", mec="tab:green", mew=1.5)
    ellipse = fit_ellipse(scene.points[chosen.members])
    if ellipse is not None:
        angle = np.linspace(0.0, 2.0 * np.pi, 181)
        circle = ellipse.semi_axes_px[0] * np.column_stack([np.cos(angle), np.sin(angle)])
        draw_points(fourth, ellipse.from_circle(circle), marker="", ls="-", lw=1.0, color="tab:red")
        draw_points(fourth, ellipse.centre_px[None], color="tab:blue", ms=6.0)
    fourth.set_title("(d) within 10 % of the most trusted circle, and their ellipse", fontsize=9)
    for axes in (first, second, fourth):
        axes.set(xlim=(0, SIZE_PX[0]), ylim=(SIZE_PX[1], 0), xlabel="u [px]", ylabel="v [px]")
    figure.savefig(path)


def _draw_surface(axes: Any, centres: Array, T: Array) -> None:
    """Largest trust in each cell of the image, from 0, far from all others, to 1 at the highest."""
    cell = 8.0
    inside = ((centres >= 0.0) & (centres < np.array(SIZE_PX))).all(axis=1)
    columns, rows = (centres[inside] // cell).astype(int).T
    surface = np.zeros((round(SIZE_PX[1] / cell), round(SIZE_PX[0] / cell)))
    lowest = 1.0 / (2.0 * _CAP_PX * (len(T) - 1))
    np.maximum.at(surface, (rows, columns), (T[inside] - lowest) / (T.max() - lowest))
    u, v = np.meshgrid(cell * np.arange(surface.shape[1]), cell * np.arange(surface.shape[0]))
    axes.plot_surface(u, v, surface, cmap="viridis", linewidth=0.0, rstride=1, cstride=1)
    axes.set_xlabel("u [px]", fontsize=8)
    axes.set_ylabel("v [px]", fontsize=8)
    axes.invert_yaxis()
    axes.set_title("(c) trust, the largest of each cell", fontsize=9)
