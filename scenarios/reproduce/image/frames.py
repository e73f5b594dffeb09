"""The frame set: hard light and weather, 2 to 30 m, several seeds; what detection and identification make of it.

A frame is the default camera's, its exposure settled, with the ring anywhere about its nominal place and the receiver
turned a little, both drawn from the seed together with hardware, clouds and noise. Two things are asked of the ring: to
be found in the frame alone, and to be found and named where a prediction expects it, as in flight (a common shift and a
change of size, each with its sigma). Wrong is what was found and holds a blob that is no LED, or a wrong name.

Beside the rates of detection stands what physics allows: each LED's ratio of signal to noise, known from the camera's
expected electrons with the LEDs on and off. Other blobs are what detection reports and lies on no LED: reflections of
LEDs and glints on the drogue, clouds, ghosts; that rate by case is the detector's rate of false alarms.

Rates are of LEDs that nothing hides. There is nothing published to compare with: the source shows one still (Fig. 28).
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera
from dockair.nav.identify.ring import Identification, IdentificationStatus, identify
from dockair.nav.image.detect import Blobs, detect
from dockair.rotations import Array, exp
from dockair.scenarios.reproduce.frames import matches, signal_to_noise, studio_without_leds
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.studio import Studio, TrueFrame, studio

ID = "image/frames"
TITLE = "the frame set: Sun, clouds, glints, ghosts, night, haze, dirt at 2 to 30 m; LEDs and rings found"
RANGES_M = (2.0, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0)
SEEDS = (1, 2)
_SETTLING_FRAMES = 4
_WITHIN_PX = 2.0
_ACROSS_SIGMA = 0.03  # of the ring's place about its nominal one, of the range
_TURN_SIGMA_RAD = np.array([0.05, 0.01, 0.02])  # receiver's roll, pitch, yaw
_PREDICTED_SIGMA_PX, _PREDICTED_SIZE_SIGMA = 3.0, 0.01
_FEWEST_LEDS = 4  # a ring with fewer is not asked for
_SIZE_IN, _DPI = (18.0, 10.0), 110
_RATIO_BINS = (0.0, 5.0, 7.0, 9.0, 12.0, 16.0, 24.0, 48.0, 1e9)  # of signal to noise
_OUTCOMES = ("found", "ambiguous", "not_found", "wrong")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What differs from the default scenario."""

    title: str
    settings: Mapping[str, Any] = field(default_factory=dict)


def _sun(azimuth_deg: float, elevation_deg: float, **more: Any) -> dict[str, Any]:
    return {"sun.azimuth_deg": azimuth_deg, "sun.elevation_deg": elevation_deg, **more}


_AHEAD = _sun(-10.0, 7.0)
CASES = (
    Case(title="Sun behind"),
    Case(title="glints", settings=_sun(150.0, 60.0) | {"parameters.surfaces.metal_share": 0.6}),
    Case(title="Sun in view", settings=_AHEAD),
    Case(title="Sun in view, band-pass", settings=_AHEAD | {"camera.filter": "band_pass"}),
    Case(
        title="ghosts, five times as bright",
        settings=_AHEAD | {"parameters.glare.ghost_share": [7.5e-5, 1e-4, 2.5e-4, 3e-4, 5e-4, 4e-4]},
    ),
    Case(title="cloud gaps, low Sun", settings=_sun(-8.0, 5.0) | {"weather.cloud_cover": 0.6}),
    Case(title="night", settings={"weather.night": True}),
    Case(title="haze, 150 m", settings={"weather.visibility_m": 150.0}),
    Case(title="dirty window, Sun in view", settings=_AHEAD | {"faults": [{"kind": "dirty_window", "cover": 0.4}]}),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One frame."""

    visible: int
    found: int
    others: int
    error2_px2: float  #: squared distance of the blobs found from their LEDs, summed
    error2_sigmas: float  #: the same, each over its blob's variance
    alone: str  #: of _OUTCOMES; "" where too few LEDs are visible
    predicted: str
    ratios: tuple[float, ...] = ()  #: of signal to noise, of each visible LED
    detected: tuple[bool, ...] = ()  #: of the same LEDs


def scores_of(case: Case, seed: int, ranges_m: tuple[float, ...] = RANGES_M) -> list[Score]:
    """Take the frames of one case and seed, far ones first."""
    rng = np.random.default_rng([seed, CASES.index(case)])
    scores = []
    with studio(case.settings, seed) as made, studio_without_leds(case.settings, seed) as dark:
        for range_m in reversed(ranges_m):
            data = made.seen_at(*_somewhere(made, range_m, rng))
            taken = made.take(data, _SETTLING_FRAMES)
            ratios = signal_to_noise(made, dark, data, taken)[taken.visible]
            scores.append(_score(taken, ratios, made.parts.sheets.camera, rng))
    return scores[::-1]


def _somewhere(made: Studio, range_m: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """R_CD and p_CD about the nominal place ahead of the probe."""
    R_CD, p_CD = made.pose(made.ahead(max(range_m, _nearest_m(made))))
    turned = exp(_TURN_SIGMA_RAD * rng.standard_normal(3))
    across = _ACROSS_SIGMA * range_m * np.array([0.0, *rng.standard_normal(2)])
    return turned @ R_CD, turned @ (range_m / np.linalg.norm(p_CD) * p_CD + across)


def _nearest_m(made: Studio) -> float:
    """Range at which the ring is at the probe's tip; nearer ones are put on the same line of sight."""
    mounting = made.parts.as_built.mounting
    return float(np.linalg.norm(mounting.p_BP - mounting.p_BC)) + 0.1


def _score(taken: TrueFrame, ratios: Array, camera: Camera, rng: np.random.Generator) -> Score:
    frame, leds_px = taken.frame, taken.leds_px
    blobs = detect(frame.pixels, None, frame.window, gain_dn_per_electron=frame.gain)
    on_led, has_blob = matches(blobs.centroids_px, leds_px, _WITHIN_PX)
    error2_px2, error2_sigmas = _squared_errors(blobs, leds_px[taken.visible])
    alone = predicted = ""
    if taken.visible.sum() >= _FEWEST_LEDS:
        ring = identify(blobs.centroids_px, camera=camera, brightness=blobs.flux)
        alone = _outcome(ring, blobs, taken, named=False)
        centre = leds_px.mean(axis=0)
        size = 1.0 + _PREDICTED_SIZE_SIGMA * rng.standard_normal()
        expected_px = centre + size * (leds_px - centre) + _PREDICTED_SIGMA_PX * rng.standard_normal(2)
        ring = identify(
            blobs.centroids_px, camera=camera, brightness=blobs.flux, expected_led_px=expected_px,
            expected_sigma_px=_PREDICTED_SIGMA_PX,
        )  # fmt: skip
        predicted = _outcome(ring, blobs, taken, named=True)
    return Score(
        visible=int(taken.visible.sum()), found=len(error2_px2), others=int((~on_led).sum()),
        error2_px2=float(error2_px2.sum()), error2_sigmas=float(error2_sigmas.sum()), alone=alone, predicted=predicted,
        ratios=tuple(ratios.tolist()), detected=tuple(has_blob[taken.visible].tolist()),
    )  # fmt: skip


def _squared_errors(blobs: Blobs, leds_px: Array) -> tuple[Array, Array]:
    """Of the LEDs that have a blob, (n,) squared distances from the nearest, and over its variance."""
    distance = np.linalg.norm(blobs.centroids_px[:, None] - leds_px[None], axis=2)
    if len(blobs) == 0:
        return np.empty(0), np.empty(0)
    nearest = distance.argmin(axis=0)
    found = distance.min(axis=0) < _WITHIN_PX
    squared = distance.min(axis=0)[found] ** 2
    return squared, squared / blobs.sigma_px[nearest[found]] ** 2


def _outcome(ring: Identification, blobs: Blobs, taken: TrueFrame, *, named: bool) -> str:
    if ring.status is not IdentificationStatus.FOUND:
        return ring.status.name.lower()
    members = blobs.centroids_px[ring.members]
    if named:
        right = np.linalg.norm(members - taken.leds_px[ring.led_numbers], axis=1) < _WITHIN_PX
    else:
        right, _ = matches(members, taken.leds_px, _WITHIN_PX)
    return "found" if right.all() else "wrong"


def reproduce(out: Path | None) -> dict[str, Any]:
    """Take the whole set; its tables in `out`."""
    scores = {case.title: np.array([scores_of(case, seed) for seed in SEEDS], dtype=object) for case in CASES}
    rows = [{"case": title, "ours": _rates(table.ravel().tolist()), "reference": {}} for title, table in scores.items()]
    for k, range_m in enumerate(RANGES_M):
        column = [score for table in scores.values() for score in table[:, k]]
        rows.append({"case": f"all at {range_m:g} m", "ours": _rates(column), "reference": {}})
    everything = [score for table in scores.values() for score in table.ravel()]
    rows.append({"case": "all", "ours": _rates(everything), "reference": {}})
    for low, high, leds, percent in _rates_by_ratio(everything):
        ours = {"leds": leds, "detected_percent": percent}
        rows.append({"case": f"signal to noise {low:g} to {high:g}", "ours": ours, "reference": {}})
    if out is not None:
        _draw(scores, out / picture_name(ID))
    return {"id": ID, "source": TITLE, "rows": rows}


def _rates(scores: list[Score]) -> dict[str, float]:
    visible, found = sum(score.visible for score in scores), sum(score.found for score in scores)
    coordinates = 2 * max(found, 1)
    rates = {
        "frames": len(scores),
        "leds_visible": visible,
        "detected_percent": _percent(found, visible),
        "centroid_rms_px": float(np.sqrt(sum(score.error2_px2 for score in scores) / coordinates)),
        "centroid_rms_sigmas": float(np.sqrt(sum(score.error2_sigmas for score in scores) / coordinates)),
        "other_blobs_per_frame": sum(score.others for score in scores) / len(scores),
    }
    ratios = [ratio for score in scores for ratio in score.ratios]
    if ratios:
        rates["median_signal_to_noise"] = float(np.median(ratios))
    for name in ("alone", "predicted"):
        outcomes = Counter(getattr(score, name) for score in scores)
        asked = len(scores) - outcomes[""]
        rates |= {f"{name}_{outcome}_percent": _percent(outcomes[outcome], asked) for outcome in _OUTCOMES}
    return rates


def _rates_by_ratio(scores: list[Score]) -> list[tuple[float, float, int, float]]:
    """Of each interval of signal to noise that has LEDs: its ends, LEDs, and how many of them are detected [%]."""
    ratios = np.array([ratio for score in scores for ratio in score.ratios])
    detected = np.array([flag for score in scores for flag in score.detected], dtype=bool)
    rows = []
    for low, high in zip(_RATIO_BINS[:-1], _RATIO_BINS[1:], strict=True):
        inside = (ratios >= low) & (ratios < high)
        if inside.any():
            rows.append((low, high, int(inside.sum()), _percent(int(detected[inside].sum()), int(inside.sum()))))
    return rows


def _percent(part: int, whole: int) -> float:
    return 100.0 * part / max(whole, 1)


def _draw(scores: Mapping[str, Any], path: Path) -> None:
    from matplotlib.figure import Figure

    def table(value: str) -> Array:
        return np.array([[_rates(column.tolist())[value] for column in of_case.T] for of_case in scores.values()])

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = (
        ("LEDs: signal to noise, median", "median_signal_to_noise", "RdYlGn", 40.0, ".0f"),
        ("LEDs detected [%]", "detected_percent", "RdYlGn", 100.0, ".0f"),
        ("other blobs a frame", "other_blobs_per_frame", "Reds", 40.0, ".0f"),
        ("centroid error [px rms]", "centroid_rms_px", "Reds", 0.5, ".2f"),
        ("centroid error over its sigma [rms]", "centroid_rms_sigmas", "RdBu_r", 2.0, ".2f"),
        ("ring found, frame alone [%]", "alone_found_percent", "RdYlGn", 100.0, ".0f"),
        ("ring found and named, predicted [%]", "predicted_found_percent", "RdYlGn", 100.0, ".0f"),
    )
    *tables, curve = figure.subplots(2, 4).ravel()
    for k, (axes, (title, name, colours, most, form)) in enumerate(zip(tables, panels, strict=True)):
        values = table(name)
        if name.startswith("centroid"):
            values[table("detected_percent") == 0.0] = np.nan  # no LED, no error
        axes.imshow(values, cmap=colours, vmin=0.0, vmax=most, aspect="auto", alpha=0.8)
        for (i, j), value in np.ndenumerate(values):
            axes.text(j, i, "" if np.isnan(value) else format(value, form), ha="center", va="center", fontsize=8)
        axes.set_title(title, fontsize=10)
        axes.set_xticks(range(len(RANGES_M)), [f"{range_m:g}" for range_m in RANGES_M], fontsize=8)
        axes.set_yticks(range(len(scores)), list(scores) if k % 4 == 0 else [], fontsize=8)
        axes.set_xlabel("range [m]")
    _draw_curve(curve, _rates_by_ratio([score for of_case in scores.values() for score in of_case.ravel()]))
    figure.savefig(path)


def _draw_curve(axes: Any, rows: list[tuple[float, float, int, float]]) -> None:
    """Detection against signal to noise, the numbers of LEDs beside the steps."""
    for low, high, leds, percent in rows:
        left, right = max(low, 3.0), min(high, 100.0)
        axes.plot([left, right], [percent, percent], color="tab:blue", linewidth=3)
        axes.text(np.sqrt(left * right), percent + 2.0, f"{leds}", ha="center", fontsize=8)
    axes.set(xscale="log", xlim=(3.0, 100.0), ylim=(-3.0, 108.0))
    axes.set_xticks([3, 5, 10, 20, 50, 100], ["3", "5", "10", "20", "50", "100"])
    axes.set_title("LEDs detected [%] against signal to noise; their number", fontsize=10)
    axes.set_xlabel("signal to noise of a matched filter")
