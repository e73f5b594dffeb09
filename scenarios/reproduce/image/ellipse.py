"""The ellipse of a tilted ring turned into a circle: LEDs told apart, and a missing one estimated.

Eq. (26) as printed gives the height of a point on the circle as A sin 45, which is right for an LED at 45 degrees
alone; here the plane is stretched along the ellipse's minor axis. On the circle the LEDs then stand 45 degrees apart
but for perspective. An estimate of a missing LED from the ellipse inherits that; the fit of the ring's exact image,
which flies, does not.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.identify.ellipse import Ellipse, fit_ellipse, places_on_circle
from dockair.nav.identify.ring import identify
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.image.grid import draw_points
from dockair.scenarios.reproduce.reference import picture_name, read_figure

ID = "image/fig11"
TITLE = "ellipse projected to its circle; missing LEDs estimated"
_SOURCE = "[Yoon 2018, fig 11, eqs 12-26]"
_CASES = ((2.5, 20.0), (5.0, 20.0), (10.0, 20.0), (10.0, 0.0))  # range [m], tilt [deg]
_ROLL_DEG, _TILT_AXIS_DEG = 13.0, 30.0
_MISSING = (2, 5)
_SIZE_IN, _DPI = (11.0, 4.2), 110


def ring_image(range_m: float, tilt_deg: float) -> Array:
    """(8, 2) LEDs on the axis of the default camera."""
    axis, tilt = np.radians(_TILT_AXIS_DEG), np.radians(tilt_deg)
    roll = np.radians(_ROLL_DEG)
    R_CD = matrix_from_yaw_pitch_roll(float(tilt * np.sin(axis)), float(tilt * np.cos(axis)), float(roll))
    return Camera().pixels_from_points(np.array([range_m, 0.0, 0.0]) + LedRing().positions_D @ R_CD.T)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fit rings of several ranges and tilts; the nearest in `out`."""
    spacing_deg = read_figure("yoon_2018_image", "15")["spacing_deg"]
    rows = [_row(range_m, tilt_deg, spacing_deg) for range_m, tilt_deg in _CASES]
    if out is not None:
        _draw(ring_image(*_CASES[0]), out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _row(range_m: float, tilt_deg: float, spacing_deg: float) -> dict[str, Any]:
    leds = ring_image(range_m, tilt_deg)
    whole = _fitted(leds)
    turns = np.degrees(np.diff(np.unwrap(np.arctan2(*whole.to_circle(np.vstack([leds, leds[:1]])).T[::-1]))))
    seen = np.delete(leds, _MISSING, axis=0)
    missing = leds[list(_MISSING)]
    ours = {
        "spacing_least_deg": float(np.abs(turns).min()),
        "spacing_most_deg": float(np.abs(turns).max()),
        "axes_ratio": float(whole.semi_axes_px[1] / whole.semi_axes_px[0]),
        "centre_off_ring_centre_px": float(np.hypot(*(whole.centre_px - np.array(Camera().principal_point_px)))),
        "missing_led_error_px": _farthest(_estimated(_fitted(seen), seen), missing),
        "missing_led_error_exact_fit_px": _farthest(identify(seen).led_pixels_px, missing),
        "missing_led_error_eq_26_px": _farthest(_as_printed(whole, leds), leds),
    }
    reference = {"spacing_least_deg": spacing_deg, "spacing_most_deg": spacing_deg}
    return {"case": f"{range_m:g} m, tilt {tilt_deg:g} deg", "ours": ours, "reference": reference}


def _fitted(points: Array) -> Ellipse:
    ellipse = fit_ellipse(points)
    assert ellipse is not None, "the image of a ring is an ellipse"
    return ellipse


def _estimated(ellipse: Ellipse, seen: Array) -> Array:
    """(8, 2) all places of the ring from the LEDs that are seen."""
    phase = places_on_circle(ellipse.to_circle(seen)).phase_rad
    angle = phase + np.arange(8) * np.pi / 4.0
    return ellipse.from_circle(ellipse.semi_axes_px[0] * np.column_stack([np.cos(angle), np.sin(angle)]))


def _as_printed(ellipse: Ellipse, leds: Array) -> Array:
    """(8, 2) LEDs sent to (x, A sin 45) in the ellipse's axes, Eq. (26), and back with the right form."""
    axes = np.array([[np.cos(t), np.sin(t)] for t in (ellipse.angle_rad, ellipse.angle_rad + 0.5 * np.pi)])
    x, y = axes @ (leds - ellipse.centre_px).T
    on_circle = np.column_stack([x, np.sign(y) * ellipse.semi_axes_px[0] * np.sin(np.pi / 4.0)])
    return ellipse.from_circle(on_circle @ axes)


def _farthest(estimates: Array, true: Array) -> float:
    """Largest distance of a true place from the nearest estimate."""
    return float(np.linalg.norm(estimates[:, None] - true[None], axis=2).min(axis=0).max())


def _draw(leds: Array, path: Path) -> None:
    from matplotlib.figure import Figure

    seen = np.delete(leds, _MISSING, axis=0)
    ellipse = _fitted(seen)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = ellipse.semi_axes_px[0] * np.column_stack([np.cos(angle), np.sin(angle)])
    estimated = _estimated(ellipse, seen)
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_points(left, ellipse.from_circle(circle), marker="", ls="-", lw=1.0, color="tab:blue")
    draw_points(left, estimated, marker="+", ms=12.0, color="tab:orange", label="estimated from the six seen")
    draw_points(left, seen, color="black", label="seen")
    draw_points(left, leds[list(_MISSING)], mfc="none", color="black", ms=7.0, label="missing")
    left.set_title(f"the ring at {_CASES[0][0]:g} m, tilted by {_CASES[0][1]:g}°, and its ellipse", fontsize=9)
    left.set(xlabel="u [px]", ylabel="v [px]")
    draw_points(right, circle, marker="", ls="-", lw=1.0, color="tab:blue")
    for place in ellipse.to_circle(estimated):
        draw_points(right, np.array([[0.0, 0.0], place]), marker="", ls="-", lw=0.5, color="tab:orange")
    draw_points(right, ellipse.to_circle(seen), color="black")
    draw_points(right, ellipse.to_circle(leds[list(_MISSING)]), mfc="none", color="black", ms=7.0)
    right.set_title("projected to the circle: spokes every 45°", fontsize=9)
    right.set(xlabel="[px]", ylabel="[px]")
    left.legend(frameon=False, fontsize=8, loc="center")
    figure.savefig(path)
