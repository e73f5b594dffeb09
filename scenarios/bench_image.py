"""How fast the image stages are on this machine, beside what a user would take from OpenCV instead.

The frames are those of the contact sheet whose light asks different things of a detector. Each detector runs on all of
them with one choice of parameters, and how many LEDs it finds is printed beside its time: a quicker one that finds less
is no quicker one. Every figure is the least of several repetitions in one process, after a first one that compiles.
OpenCV runs on as many threads as it likes; the detector runs on one. Speeds are benchmarks, never tests: they belong to
the machine that printed them.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from dockair.nav.image.detect import DetectSettings, detect
from dockair.nav.image.labelling import foreground_runs, label_contour_tracing, label_two_pass
from dockair.rotations import Array
from dockair.scenarios.reproduce.contact_sheet import SHOTS
from dockair.scenarios.reproduce.frames import TrueFrame, matches, studio

_TITLES = (
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
_WINDOW_REPETITIONS = 300
_WITHIN_PX = 2.0
_WINDOW_PX = 300
_SMALLEST_PX, _LARGEST_PX = 3, 400  # areas that are kept, as the detector's own
_ABOVE_MEDIAN_DN = 12  # threshold of the plain chain
_MEDIAN_STEP = 8  # pixels that it takes the median of
_ELEMENT = np.ones((3, 3), np.uint8)

Detector = Callable[[TrueFrame], Array]


def bench_image() -> dict[str, Any]:
    """Return {"milliseconds": {what: ms}, "ratios": {what: ratio}, "recall": {what: LEDs found, visible, other blobs}}.

    Milliseconds are of the mean frame, or of what else is named.
    """
    taken = [_take(title) for title in _TITLES]
    detectors: dict[str, Detector] = {
        "detect": lambda shot: detect(shot.frame.pixels, gain_dn_per_electron=shot.frame.gain).centroids_px,
        'detect, method "frame"': _by_frame,
        "threshold + opening + connectedComponentsWithStats": partial(_plain_chain, element=_ELEMENT),
        "threshold + connectedComponentsWithStats": partial(_plain_chain, element=None),
        "SimpleBlobDetector, 48 thresholds": partial(_blob_detector, _simple_blob_detector(8, 250, 5)),
        "SimpleBlobDetector, 4 thresholds": partial(_blob_detector, _simple_blob_detector(10, 130, 30)),
    }
    milliseconds, recall = {}, {}
    for name, detector in detectors.items():
        times = [_least(partial(detector, shot), _REPETITIONS) for shot in taken]
        milliseconds[f"{name}: mean frame"] = float(np.mean(times))
        milliseconds[f"{name}: slowest frame"] = max(times)
        recall[name] = _recall(detector, taken)
    milliseconds |= _window_figures(taken[_TITLES.index("6 m, Sun behind")])
    milliseconds |= _labelling_figures(taken[0])
    return {"milliseconds": milliseconds, "ratios": _ratios(milliseconds, list(detectors)), "recall": recall}


def _take(title: str) -> TrueFrame:
    shot = next(shot for shot in SHOTS if shot.title == title)
    with studio(shot.settings) as place:
        return place.take(place.ahead(shot.range_m))


def _by_frame(shot: TrueFrame) -> Array:
    settings = DetectSettings(method="frame")
    return detect(shot.frame.pixels, settings, gain_dn_per_electron=shot.frame.gain).centroids_px


def _plain_chain(shot: TrueFrame, element: Any) -> Array:
    pixels = shot.frame.pixels
    threshold = np.median(pixels[::_MEDIAN_STEP, ::_MEDIAN_STEP]) + _ABOVE_MEDIAN_DN
    mask = cv2.threshold(pixels, threshold, 255, cv2.THRESH_BINARY)[1]
    if element is not None:
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, element)
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


def _recall(detector: Detector, taken: list[TrueFrame]) -> dict[str, int]:
    found, others = 0, 0
    for shot in taken:
        on_led, has_blob = matches(detector(shot), shot.leds_px, _WITHIN_PX)
        found += int((has_blob & shot.visible).sum())
        others += int((~on_led).sum())
    return {"found": found, "visible": int(sum(shot.visible.sum() for shot in taken)), "others": others}


def _window_figures(shot: TrueFrame) -> dict[str, float]:
    """A 300 x 300 window around the ring."""
    column, row = (int(c) - _WINDOW_PX // 2 for c in shot.leds_px.mean(axis=0))
    window = np.ascontiguousarray(shot.frame.pixels[row : row + _WINDOW_PX, column : column + _WINDOW_PX])
    frame = DetectSettings(method="frame")
    return {
        "detect: 300 x 300": _least(lambda: detect(window), _WINDOW_REPETITIONS),
        'detect, method "frame": 300 x 300': _least(lambda: detect(window, frame), _WINDOW_REPETITIONS),
    }


def _labelling_figures(shot: TrueFrame) -> dict[str, float]:
    """The labellings on the frame with the most texture."""
    pixels = shot.frame.pixels
    threshold = int(np.median(pixels)) + _ABOVE_MEDIAN_DN
    mask = pixels > threshold
    as_bytes = mask.view(np.uint8)
    stages: dict[str, Callable[[], Any]] = {
        "two-pass": lambda: label_two_pass(mask),
        "contour tracing": lambda: label_contour_tracing(mask),
        "runs, threshold included": lambda: foreground_runs(pixels, threshold),
        "cv2.connectedComponents": lambda: cv2.connectedComponents(as_bytes),
    }
    return {f"labelling, full frame: {name}": _least(stage, _REPETITIONS) for name, stage in stages.items()}


def _ratios(ms: dict[str, float], detectors: list[str]) -> dict[str, float]:
    ours = ms[f"{detectors[0]}: mean frame"]
    return {f"{name} over detect": ms[f"{name}: mean frame"] / ours for name in detectors[1:]}


def _least(function: Callable[[], Any], repetitions: int) -> float:
    """Shortest time of a call [ms], after one that compiles."""
    function()
    times = []
    for _ in range(repetitions):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return 1e3 * min(times)
