"""How fast the image stages are on this machine, beside what a user would take from OpenCV instead.

The frames are those of the contact sheet whose light asks different things of a detector. Each of OpenCV's detectors
is tried with several choices of its parameters, the same for all frames, and gets the one with which it finds most
LEDs (with fewest other blobs, where two find as many): a quicker one that finds less is no quicker one. How many LEDs
each finds, frame by frame, is printed beside its time.

Every figure is the least of several repetitions in one process, after a first one that compiles. OpenCV runs on as many
threads as it likes; ours run on one. Identification is timed on rings of eight LEDs among random blobs, without a
prior, which is the dearest. Speeds are benchmarks, never tests: they belong to the machine that printed them.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.identify.ring import identify
from dockair.nav.image.detect import DetectSettings, detect
from dockair.nav.image.labelling import foreground_runs, label_contour_tracing, label_two_pass
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.frames import matches
from dockair.scenarios.reproduce.sensor.contact_sheet import SHOTS
from dockair.scenarios.studio import TrueFrame, studio

TITLES = (
    "30 m",
    "15 m",
    "6 m, Sun behind",
    "2.5 m",
    "Sun in view",
    "Sun in view, 20 nm band-pass",
    "night",
    "haze, visibility 150 m",
    "exposure stuck at 500 µs",
)
_REPETITIONS = 15
_TRIAL_REPETITIONS = 3  # of every choice of parameters
_WINDOW_REPETITIONS = 300
_WITHIN_PX = 2.0
_WINDOW_PX = 300
_SMALLEST_PX, _LARGEST_PX = 3, 400  # areas that are kept; fewer pixels, and OpenCV's drown in noise
_ABOVE_MEDIAN_DN = (2, 3, 5, 8, 12, 20, 40)  # thresholds of the plain chain that are tried
_MEDIAN_STEP = 8  # pixels that it takes the median of
_ABOVE_NEIGHBOURS_DN = (2, 3, 5, 8, 12, 20)  # of cv2.adaptiveThreshold
_NEIGHBOURS_PX = 31
_ELEMENT = np.ones((3, 3), np.uint8)
_MANY_THRESHOLDS = ((4, 250, 5), (6, 250, 5), (8, 250, 5), (12, 250, 5))  # lowest, highest, step
_FEW_THRESHOLDS = ((4, 100, 24), (6, 126, 30), (10, 130, 30), (20, 140, 30))
_CANDIDATES, _CASES, _CASE_REPETITIONS = 40, 150, 3
_RANGE_M, _TILT_RAD, _NOISE_PX = (2.2, 30.0), 0.35, 0.1  # of the rings to identify
_ACROSS = (0.2, 0.1)  # of the range
_LABELLED_DN = 12  # above the median

Detector = Callable[[TrueFrame], Array]


def bench_image() -> dict[str, Any]:
    """Return times, ratios and recall.

    Returns:
        {"milliseconds": {what: ms}, "ratios": {what: ratio}, "recall": {detector: {"found", "visible", "others"}},
        "found_by_frame": {frame: {"visible": LEDs, detector: LEDs}}, "chosen": {detector: its parameters}}.
        Milliseconds are of the mean frame, or of what else is named.
    """
    taken = [_take(title) for title in TITLES]
    detectors, chosen, quickest = _detectors(taken)
    milliseconds, recall = {}, {}
    found: dict[str, dict[str, int]] = {
        title: {"visible": int(shot.visible.sum())} for title, shot in zip(TITLES, taken, strict=True)
    }
    for name, detector in detectors.items():
        times = [_least(partial(detector, shot), _REPETITIONS) for shot in taken]
        milliseconds[f"{name}: mean frame"] = float(np.mean(times))
        milliseconds[f"{name}: slowest frame"] = max(times)
        scores = [_score(detector, shot) for shot in taken]
        recall[name] = {
            "found": sum(score[0] for score in scores),
            "visible": sum(figures["visible"] for figures in found.values()),
            "others": sum(score[1] for score in scores),
        }
        for figures, score in zip(found.values(), scores, strict=True):
            figures[name] = score[0]
    milliseconds |= _window_figures(taken[TITLES.index("6 m, Sun behind")])
    milliseconds |= _identification_figures()
    for title in ("30 m", "night"):
        milliseconds |= _labelling_figures(taken[TITLES.index(title)], title)
    return {
        "milliseconds": milliseconds,
        "ratios": _ratios(milliseconds, list(detectors), quickest),
        "recall": recall,
        "found_by_frame": found,
        "chosen": chosen,
    }


def _take(title: str) -> TrueFrame:
    shot = next(shot for shot in SHOTS if shot.title == title)
    with studio(shot.settings) as place:
        return place.take(place.ahead(shot.range_m))


def _detectors(taken: list[TrueFrame]) -> tuple[dict[str, Detector], dict[str, str], dict[str, float]]:
    """Ours first, then OpenCV's with their best parameters; which these are; and a mean frame of the quickest [ms]."""
    detectors: dict[str, Detector] = {
        "detect": lambda shot: detect(shot.frame.pixels, gain_dn_per_electron=shot.frame.gain).centroids_px,
        'detect, method "frame"': _by_frame,
    }
    plain = {f"median + {above}": above for above in _ABOVE_MEDIAN_DN}
    adaptive = {f"mean of {_NEIGHBOURS_PX} x {_NEIGHBOURS_PX} + {above}": above for above in _ABOVE_NEIGHBOURS_DN}
    blob = {f"from {steps[0]} to {steps[1]} by {steps[2]}": steps for steps in (*_MANY_THRESHOLDS, *_FEW_THRESHOLDS)}
    families: dict[str, dict[str, Detector]] = {
        "threshold + opening + connectedComponentsWithStats": {
            name: partial(_plain_chain, above=above, element=_ELEMENT) for name, above in plain.items()
        },
        "threshold + connectedComponentsWithStats": {
            name: partial(_plain_chain, above=above, element=None) for name, above in plain.items()
        },
        "adaptiveThreshold + connectedComponentsWithStats": {
            name: partial(_adaptive_chain, above=above) for name, above in adaptive.items()
        },
        "SimpleBlobDetector, about 48 thresholds": {
            name: partial(_blob_detector, _simple_blob_detector(*steps))
            for name, steps in blob.items()
            if steps in _MANY_THRESHOLDS
        },
        "SimpleBlobDetector, 4 thresholds": {
            name: partial(_blob_detector, _simple_blob_detector(*steps))
            for name, steps in blob.items()
            if steps in _FEW_THRESHOLDS
        },
    }
    chosen = {family: max(choices, key=partial(_merit, choices, taken)) for family, choices in families.items()}
    quickest = {
        family: min(
            float(np.mean([_least(partial(detector, shot), _TRIAL_REPETITIONS) for shot in taken]))
            for detector in choices.values()
        )
        for family, choices in families.items()
    }
    return detectors | {family: families[family][choice] for family, choice in chosen.items()}, chosen, quickest


def _merit(choices: dict[str, Detector], taken: list[TrueFrame], choice: str) -> tuple[int, int]:
    scores = np.array([_score(choices[choice], shot) for shot in taken]).sum(axis=0)
    return int(scores[0]), -int(scores[1])


def _by_frame(shot: TrueFrame) -> Array:
    settings = DetectSettings(method="frame", min_area_px=_SMALLEST_PX)
    return detect(shot.frame.pixels, settings, gain_dn_per_electron=shot.frame.gain).centroids_px


def _plain_chain(shot: TrueFrame, above: int, element: Any) -> Array:
    pixels = shot.frame.pixels
    threshold = np.median(pixels[::_MEDIAN_STEP, ::_MEDIAN_STEP]) + above
    mask = cv2.threshold(pixels, threshold, 255, cv2.THRESH_BINARY)[1]
    return _centres_of_components(mask if element is None else cv2.morphologyEx(mask, cv2.MORPH_OPEN, element))


def _adaptive_chain(shot: TrueFrame, above: int) -> Array:
    return _centres_of_components(
        cv2.adaptiveThreshold(
            shot.frame.pixels, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, _NEIGHBOURS_PX, -above
        )
    )


def _centres_of_components(mask: Any) -> Array:
    _, _, statistics, centroids = cv2.connectedComponentsWithStats(mask)
    area = statistics[1:, cv2.CC_STAT_AREA]
    return np.asarray(centroids[1:][(area >= _SMALLEST_PX) & (area <= _LARGEST_PX)], dtype=float)


def _simple_blob_detector(lowest: int, highest: int, step: int) -> Any:
    parameters = cv2.SimpleBlobDetector.Params()
    parameters.minThreshold, parameters.maxThreshold, parameters.thresholdStep = lowest, highest, step
    parameters.minRepeatability, parameters.minDistBetweenBlobs = 1, 4
    parameters.filterByColor, parameters.blobColor = True, 255
    # areas inside contours, which run through the pixels' centres
    parameters.filterByArea, parameters.minArea, parameters.maxArea = True, _SMALLEST_PX - 1, _LARGEST_PX
    parameters.filterByCircularity = parameters.filterByConvexity = False
    parameters.filterByInertia, parameters.minInertiaRatio = True, 0.08  # axes of 3.5 to 1
    return cv2.SimpleBlobDetector.create(parameters)


def _blob_detector(detector: Any, shot: TrueFrame) -> Array:
    return np.array([point.pt for point in detector.detect(shot.frame.pixels)]).reshape(-1, 2)


def _score(detector: Detector, shot: TrueFrame) -> tuple[int, int]:
    """LEDs found that nothing hides, and blobs on none."""
    on_led, has_blob = matches(detector(shot), shot.leds_px, _WITHIN_PX)
    return int((has_blob & shot.visible).sum()), int((~on_led).sum())


def _window_figures(shot: TrueFrame) -> dict[str, float]:
    """A 300 x 300 window around the ring."""
    column, row = (int(c) - _WINDOW_PX // 2 for c in shot.leds_px.mean(axis=0))
    window = np.ascontiguousarray(shot.frame.pixels[row : row + _WINDOW_PX, column : column + _WINDOW_PX])
    frame = DetectSettings(method="frame")
    return {
        "detect: 300 x 300": _least(lambda: detect(window), _WINDOW_REPETITIONS),
        'detect, method "frame": 300 x 300': _least(lambda: detect(window, frame), _WINDOW_REPETITIONS),
    }


def _identification_figures() -> dict[str, float]:
    rng, camera = np.random.default_rng(0), Camera()
    times = []
    for _ in range(_CASES):
        points = _ring_among_clutter(rng, camera)
        times.append(_least(partial(identify, points, camera=camera), _CASE_REPETITIONS))
    what = f"identification, {_CANDIDATES} candidates, no prior"
    return {f"{what}: median": float(np.median(times)), f"{what}: worst of {_CASES}": max(times)}


def _ring_among_clutter(rng: np.random.Generator, camera: Camera) -> Array:
    """(n, 2) pixels in random order: a ring that is inside the frame, and blobs anywhere."""
    size = np.array([camera.width_px, camera.height_px], dtype=float)
    while True:
        range_m = rng.uniform(*_RANGE_M)
        p_CD = range_m * np.array([1.0, *(rng.uniform(-side, side) for side in _ACROSS)])
        R_CD = matrix_from_yaw_pitch_roll(*rng.uniform(-_TILT_RAD, _TILT_RAD, 3))
        leds_px = camera.pixels_from_points(p_CD + LedRing().positions_D @ R_CD.T)
        if ((leds_px >= 0.0) & (leds_px <= size - 1.0)).all():
            break
    leds_px = leds_px + _NOISE_PX * rng.standard_normal(leds_px.shape)
    points = np.concatenate([leds_px, rng.uniform(0.0, size, (_CANDIDATES - len(leds_px), 2))])
    return rng.permutation(points)


def _labelling_figures(shot: TrueFrame, title: str) -> dict[str, float]:
    """The labellings on a frame's binary image."""
    pixels = shot.frame.pixels
    threshold = int(np.median(pixels)) + _LABELLED_DN
    mask = pixels > threshold
    as_bytes = mask.view(np.uint8)
    stages: dict[str, Callable[[], Any]] = {
        "two-pass": lambda: label_two_pass(mask),
        "contour tracing": lambda: label_contour_tracing(mask),
        "runs, threshold included": lambda: foreground_runs(pixels, threshold),
        "cv2.connectedComponents": lambda: cv2.connectedComponents(as_bytes),
    }
    what = f"labelling, {title} ({100.0 * mask.mean():.2g} % foreground)"
    return {f"{what}: {name}": _least(stage, _REPETITIONS) for name, stage in stages.items()}


def _ratios(ms: dict[str, float], detectors: list[str], quickest: dict[str, float]) -> dict[str, float]:
    """Mean frames, of OpenCV's with the parameters that find most and with those that take least time."""
    ours = ms[f"{detectors[0]}: mean frame"]
    best = {f"{name} over detect": ms[f"{name}: mean frame"] / ours for name in detectors[1:]}
    return best | {f"{name}, quickest parameters, over detect": time / ours for name, time in quickest.items()}


def _least(function: Callable[[], Any], repetitions: int) -> float:
    """Shortest time of a call [ms], after one that compiles."""
    function()
    times = []
    for _ in range(repetitions):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return 1e3 * min(times)
