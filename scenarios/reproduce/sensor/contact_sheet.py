"""Sixteen frames of one ring: every light, weather, range and fault that the camera can meet, on one sheet.

Each frame is the last of a few from a camera whose exposure control has settled, with the receiver put where the lens
is so far behind the ring. The picture shows a quarter of the resolution and the ring's surroundings in full, each
stretched from black to white by itself. The figures say what the frame does to the detection of LEDs; there is nothing
published to compare with.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.messages import CameraFrame
from dockair.nav.image.detect import detect
from dockair.rotations import Array
from dockair.scenarios.reproduce.frames import matches
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.studio import studio

ID = "sensor/contact-sheet"
TITLE = "sixteen frames: Sun, clouds, glints, night, haze, ranges, faults"
_FOUND_WITHIN_PX = 2.0
_WHITE_DN = 255
_REACH_PX = 3  # of an LED's image, to each side
_OTHER_PX = 12  # from every LED: what is brightest there is none of them, nor its reflection in its own seat
_REDUCTION = 4
_GAMMA = 0.6
_SHOWN, _LEAST_DN = (0.02, 0.995), 24.0  # quantiles; but no less between them: noise is no picture
_INSET_MARGIN = 1.6  # ring radii


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One frame: what differs from the default scenario, and how far the lens is from the ring."""

    title: str
    range_m: float = 6.0
    settings: Mapping[str, Any] = field(default_factory=dict)


def _sun(azimuth_deg: float, elevation_deg: float) -> dict[str, Any]:
    return {"sun.azimuth_deg": azimuth_deg, "sun.elevation_deg": elevation_deg}


_AHEAD = _sun(-10.0, 8.0)
SHOTS = (
    Shot(title="30 m", range_m=30.0),
    Shot(title="15 m", range_m=15.0),
    Shot(title="6 m, Sun behind"),
    Shot(title="2.5 m", range_m=2.5),
    Shot(title="Sun abeam", settings=_sun(90.0, 30.0)),
    Shot(
        title="glints: Sun high behind, bare metal",
        settings=_sun(150.0, 60.0) | {"parameters.surfaces.metal_share": 0.6},
    ),
    Shot(title="Sun in view", range_m=10.0, settings=_AHEAD),
    Shot(title="Sun in view, 20 nm band-pass", range_m=10.0, settings=_AHEAD | {"camera.filter": "band_pass"}),
    Shot(title="low Sun, gaps in cloud", range_m=10.0, settings=_sun(-8.0, 5.0) | {"weather.cloud_cover": 0.6}),
    Shot(title="night", range_m=10.0, settings={"weather.night": True}),
    Shot(title="haze, visibility 150 m", range_m=10.0, settings={"weather.visibility_m": 150.0}),
    Shot(
        title="dirty window, Sun in view",
        range_m=10.0,
        settings=_AHEAD | {"faults": [{"kind": "dirty_window", "cover": 0.4}]},
    ),
    Shot(
        title="LEDs 1 and 2 off, 5 dim",
        settings={"faults": [{"kind": "led_off", "leds": [1, 2]}, {"kind": "led_dim", "leds": [5], "factor": 0.2}]},
    ),
    Shot(title="2000 hot pixels", settings={"faults": [{"kind": "hot_pixels", "count": 2000}]}),
    Shot(title="exposure stuck at 500 µs", settings={"faults": [{"kind": "exposure_stuck", "exposure_us": 500.0}]}),
    Shot(
        title="f/2.8, focused at 30 m",
        settings={"parameters.lens.f_number": 2.8, "parameters.lens.focus_distance_m": 30.0},
    ),
)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Make the frames and, with a folder, the sheet."""
    taken = [_take(shot) for shot in SHOTS]
    rows = [
        {"case": shot.title, "ours": figures, "reference": {}}
        for shot, (_, _, figures) in zip(SHOTS, taken, strict=True)
    ]
    if out is not None:
        _draw(
            [(shot.title, frame, leds) for shot, (frame, leds, _) in zip(SHOTS, taken, strict=True)],
            out / picture_name(ID),
        )
    return {"id": ID, "source": TITLE, "rows": rows}


def _take(shot: Shot) -> tuple[CameraFrame, Array, dict[str, float]]:
    """The frame, where its LEDs are (n, 2) [px], and its figures."""
    with studio(shot.settings) as made:
        data = made.ahead(shot.range_m)
        taken = made.take(data)
        return taken.frame, taken.leds_px, _figures(taken.frame, taken.leds_px, made.camera.visible_leds(data))


def _figures(frame: CameraFrame, leds_px: Array, visible: NDArray[np.bool_]) -> dict[str, float]:
    blobs = detect(frame.pixels, None, frame.window, gain_dn_per_electron=frame.gain)
    on_led, found = matches(blobs.centroids_px, leds_px, _FOUND_WITHIN_PX)
    return {
        "exposure_us": 1e6 * frame.exposure_s,
        "background_dn": float(np.median(frame.pixels)),
        "mean_dn": float(frame.pixels.mean()),
        "white_pixels": int((frame.pixels == _WHITE_DN).sum()),
        "brightest_led_dn": float(max(_around(frame.pixels, uv, 2).max(initial=0) for uv in leds_px)),
        "brightest_other_dn": float(_elsewhere(frame.pixels, leds_px).max()),
        "led_pixels": float(np.median([_above_half(_around(frame.pixels, uv, _REACH_PX)) for uv in leds_px])),
        "leds_visible": int(visible.sum()),
        "leds_found": int(found.sum()),
        "other_blobs": int((~on_led).sum()),
    }


def _around(pixels: NDArray[np.uint8], uv: Array, reach: int) -> NDArray[np.uint8]:
    column, row = (round(float(c)) for c in uv)
    return pixels[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]


def _above_half(patch: NDArray[np.uint8]) -> int:
    """How many pixels are brighter than half the brightest: the width of an image."""
    return int((patch > patch.max(initial=0) / 2).sum())


def _elsewhere(pixels: NDArray[np.uint8], leds_px: Array) -> NDArray[np.uint8]:
    """The picture, black around every LED."""
    others = pixels.copy()
    for uv in leds_px:
        _around(others, uv, _OTHER_PX)[:] = 0
    return others


def _draw(frames: list[tuple[str, CameraFrame, Array]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 8.6), dpi=110, layout="constrained")
    for axes, (title, frame, leds_px) in zip(figure.subplots(4, 4).ravel(), frames, strict=True):
        axes.imshow(_thumbnail(frame.pixels), cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
        axes.set_title(f"{title}, {1e6 * frame.exposure_s:.0f} µs", fontsize=8, pad=2)
        axes.set_axis_off()
        inset = axes.inset_axes((0.0, 0.0, 0.32, 0.6))
        inset.imshow(_surroundings(frame.pixels, leds_px), cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
        inset.set_xticks([])
        inset.set_yticks([])
        for spine in inset.spines.values():
            spine.set_color("tab:orange")
    figure.savefig(path)


def _thumbnail(pixels: NDArray[np.uint8]) -> Array:
    """Brightest of each block, so that a far LED stays, brightened."""
    rows, columns = (n // _REDUCTION for n in pixels.shape)
    blocks = pixels[: rows * _REDUCTION, : columns * _REDUCTION].reshape(rows, _REDUCTION, columns, _REDUCTION)
    return _brightened(blocks.max(axis=(1, 3)))


def _surroundings(pixels: NDArray[np.uint8], leds_px: Array) -> Array:
    """A square around the ring, black where it leaves the frame."""
    centre = leds_px.mean(axis=0)
    half = int(np.ceil(_INSET_MARGIN * np.linalg.norm(leds_px - centre, axis=1).max())) + 4
    column, row = (round(float(c)) for c in centre)
    padded = np.pad(pixels, half)
    return _brightened(padded[row : row + 2 * half, column : column + 2 * half])


def _brightened(pixels: NDArray[np.uint8]) -> Array:
    """From black to white between what nearly all pixels are above and below: what is faint shows, LEDs stay white."""
    black, white = np.quantile(pixels, _SHOWN)
    shown = (pixels - black) / max(white - black, _LEAST_DN)
    return np.asarray(shown.clip(0.0, 1.0) ** _GAMMA)
