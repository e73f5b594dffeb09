"""The four panels of a still at 25 m with reflections: grey, binary and opened, labelled, identified.

The source opened the aperture wider than in operation so that noise came in. Here: f/8 as flown, with the exposure that
the camera itself sets; then f/2.8 and f/2 with an exposure of twice and four times what it would set there, so that
reflections and the LEDs' surroundings come up to the LEDs' level. The Sun stands high behind and glints on the basket.

The panels show the source's stages: a fixed threshold a little below the dimmest LED, as a person would set it, opening
with a 3 x 3 square that spares small blobs, an upper limit of area, three-point identification. At 25 m an LED has one
to four pixels over such a threshold. The last panel shows the detector that flies on the same frame; it sets its
thresholds itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.nav.identify.ring import Identification, IdentificationStatus, identify
from dockair.nav.image.detect import Blobs, DetectSettings, detect
from dockair.nav.image.labelling import Runs, foreground_runs
from dockair.nav.image.morphology import open_components, structuring_element
from dockair.rotations import Array
from dockair.scenarios.reproduce.frames import matches
from dockair.scenarios.reproduce.image.grid import COLOURS
from dockair.scenarios.reproduce.reference import picture_name, read_figure
from dockair.scenarios.studio import TrueFrame, studio

ID = "image/fig28"
TITLE = "grey, binary, labelled, identified: a rendered still at 25 m with reflections, f/8 to f/2"
_SOURCE = "[Yoon 2018, fig 28]"
_RANGE_M = 25.0
_REFLECTIONS = {"sun.azimuth_deg": 150.0, "sun.elevation_deg": 60.0}
_WITHIN_PX = 2.0
_THRESHOLD_SHARE = 0.8  # of the way from the background to the dimmest LED: "a little lower"
_ZOOM_RADII = 1.7
_BOX_MARGIN_PX = 12.0
_REDUCTION = 4
_GAMMA = 0.5
_SIZE_IN, _DPI = (17.0, 6.2), 110


@dataclass(frozen=True, slots=True, kw_only=True)
class Still:
    """One frame to take."""

    title: str
    settings: Mapping[str, Any] = field(default_factory=dict)


def _opened(f_number: float, exposure_us: float) -> Still:
    settings = {
        "parameters.lens.f_number": f_number,
        "camera.exposure": "fixed",
        "parameters.exposure.exposure_s": 1e-6 * exposure_us,
    }
    return Still(title=f"f/{f_number:g}, {exposure_us:g} µs", settings=settings)


STILLS = (Still(title="f/8, as flown"), _opened(2.8, 60.0), _opened(2.0, 60.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What is left after the filters, and the ring in it."""

    blobs: Blobs
    ring: Identification


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stages:
    """What the stages make of a frame."""

    threshold_dn: int
    raw: Runs  #: components of what is above the threshold
    opened: Runs
    outcome: Outcome


def stages_of(taken: TrueFrame, camera: Camera, threshold_dn: int) -> Stages:
    """Run the stages one by one at a threshold, and the detector and the identification with it."""
    settings = DetectSettings(threshold_dn=threshold_dn, min_area_px=1)
    raw = foreground_runs(taken.frame.pixels, threshold_dn, settings.connectivity)
    element = structuring_element(settings.element_shape, settings.element_size_px)
    opened = open_components(raw, element, settings.spare_below_px, settings.connectivity)
    return Stages(threshold_dn=threshold_dn, raw=raw, opened=opened, outcome=outcome_of(taken, camera, settings))


def outcome_of(taken: TrueFrame, camera: Camera, settings: DetectSettings) -> Outcome:
    """Detect and identify."""
    frame = taken.frame
    blobs = detect(frame.pixels, settings, frame.window, gain_dn_per_electron=frame.gain)
    return Outcome(blobs=blobs, ring=identify(blobs.centroids_px, camera=camera, brightness=blobs.flux))


def _hand_set_threshold(taken: TrueFrame) -> int:
    pixels = taken.frame.pixels
    peaks = [pixels[v - 1 : v + 2, u - 1 : u + 2].max() for u, v in np.round(taken.leds_px).astype(int)]
    background = float(np.median(pixels))
    return round(background + _THRESHOLD_SHARE * (float(min(peaks)) - background))


def reproduce(out: Path | None) -> dict[str, Any]:
    """Take the stills; the panels in `out`."""
    printed = read_figure("yoon_2018_image", "28")
    rows, pictures = [], []
    for still in STILLS:
        with studio({**_REFLECTIONS, **still.settings}) as made:
            taken, camera = made.take(made.ahead(_RANGE_M)), made.parts.sheets.camera
        stages = stages_of(taken, camera, _hand_set_threshold(taken))
        flying = outcome_of(taken, camera, DetectSettings())
        rows.append({"case": still.title, "ours": _figures(taken, stages, flying), "reference": printed})
        pictures.append((still.title, taken, stages, flying))
    if out is not None:
        _draw(pictures, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _figures(taken: TrueFrame, stages: Stages, flying: Outcome) -> dict[str, Any]:
    return {
        "range_m": float(np.linalg.norm(taken.p_CD)),
        "exposure_us": 1e6 * taken.frame.exposure_s,
        "background_dn": float(np.median(taken.frame.pixels)),
        "threshold_dn": stages.threshold_dn,
        "blobs_binary": stages.raw.count,
        "blobs_opened": stages.opened.count,
        **_found("", taken, stages.outcome),
        **_found("flying_", taken, flying),
    }


def _found(prefix: str, taken: TrueFrame, outcome: Outcome) -> dict[str, Any]:
    blobs, ring = outcome.blobs, outcome.ring
    on_led, found = matches(blobs.centroids_px, taken.leds_px[taken.visible], _WITHIN_PX)
    return {
        f"{prefix}leds_found": int(found.sum()),
        f"{prefix}other_blobs": int((~on_led).sum()),
        f"{prefix}ring": ring.status.value,
        f"{prefix}ring_leds": int(on_led[ring.members].sum()),
        f"{prefix}ring_others": int((~on_led[ring.members]).sum()),
    }


def _draw(pictures: list[tuple[str, TrueFrame, Stages, Outcome]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for line, picture in zip(figure.subplots(len(pictures), 5), pictures, strict=True):
        _draw_line(line, *picture)
    figure.savefig(path)


def _draw_line(line: Any, title: str, taken: TrueFrame, stages: Stages, flying: Outcome) -> None:
    grey = (taken.frame.pixels / 255.0) ** _GAMMA
    labels = _painted(stages.opened, taken.frame.pixels.shape)
    binary, coloured = (labels > 0).astype(float), _coloured(labels)
    kept = len(stages.outcome.blobs)
    for axes, image, name in zip(
        line,
        (grey, binary, coloured, grey, grey),
        (
            f"(a) grey, {title}",
            f"(b) over {stages.threshold_dn} DN, opened",
            f"(c) labelled, {kept} of {stages.opened.count} kept",
            f"(d) ring {stages.outcome.ring.status.value}",
            f"as flown: {len(flying.blobs)} blobs, {flying.ring.status.value}",
        ),
        strict=True,
    ):
        axes.imshow(_reduced(image), cmap="gray", vmin=0.0, vmax=1.0, extent=_extent(image), interpolation="nearest")
        axes.set_title(name, fontsize=9)
        axes.set(xticks=[], yticks=[])
        inset = _magnified(axes, image, taken)
        if axes is line[2]:
            style = {"ls": "none", "marker": ".", "ms": 3.0, "color": "#ff2d2d", "scalex": False, "scaley": False}
            for each in (axes, inset):
                each.plot(*stages.outcome.blobs.centroids_px.T, **style)
    _draw_ring(line[3], stages.outcome)
    _draw_ring(line[4], flying)


def _magnified(axes: Any, image: Array, taken: TrueFrame) -> Any:
    """The ring's surroundings in the panel's corner where there is only sky."""
    centre, half = taken.leds_px.mean(axis=0), _ZOOM_RADII * 0.5 * float(np.ptp(taken.leds_px[:, 0]))
    inset = axes.inset_axes((0.55, 0.2, 0.45, 0.8))
    inset.imshow(image, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
    inset.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] + half, centre[1] - half))
    inset.set(xticks=[], yticks=[])
    for spine in inset.spines.values():
        spine.set_color("tab:orange")
    return inset


def _draw_ring(axes: Any, outcome: Outcome) -> None:
    """Box and members, in the panel and magnified."""
    if outcome.ring.status is not IdentificationStatus.FOUND:
        return
    members = outcome.blobs.centroids_px[outcome.ring.members]
    low, high = members.min(axis=0) - _BOX_MARGIN_PX, members.max(axis=0) + _BOX_MARGIN_PX
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1]), low])
    for each in (axes, *axes.child_axes):
        each.plot(*corners.T, color="#ff2d2d", lw=1.2)
    axes.child_axes[0].plot(*members.T, "o", ms=8.0, mfc="none", mec="#34c759", mew=1.5)


def _extent(image: Array) -> tuple[float, float, float, float]:
    return -0.5, image.shape[1] - 0.5, image.shape[0] - 0.5, -0.5


def _reduced(image: Array) -> Array:
    """Brightest of each block, so that a far LED stays."""
    rows, columns = (size // _REDUCTION for size in image.shape[:2])
    blocks = image[: rows * _REDUCTION, : columns * _REDUCTION]
    return np.asarray(blocks.reshape(rows, _REDUCTION, columns, _REDUCTION, -1).max(axis=(1, 3)).squeeze())


def _painted(runs: Runs, shape: tuple[int, ...]) -> NDArray[np.int32]:
    """(rows, columns) label of each pixel, 0 for background."""
    labels = np.zeros(shape, np.int32)
    owner = np.repeat(np.arange(runs.count), np.diff(runs.offset)) + 1
    for row, start, stop, label in zip(runs.row, runs.start, runs.stop, owner, strict=True):
        labels[row, start:stop] = label
    return labels


def _coloured(labels: NDArray[np.int32]) -> Array:
    from matplotlib.colors import to_rgb

    palette = np.array([(0.0, 0.0, 0.0), *(to_rgb(colour) for colour in COLOURS[1:])])
    return palette[np.where(labels > 0, (labels - 1) % (len(COLOURS) - 1) + 1, 0)]
