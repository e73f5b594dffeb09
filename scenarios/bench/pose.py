"""How fast the pose solver is on this machine, beside OpenCV's, called from Python.

Eight LEDs at 10 m, tilted by 13 degrees, 0.1 px of noise; the start is the pose of the frame before: 0.2 degrees and
24 mm away, as at 50 frames a second. All answers but the marked ones come with covariance and statuses; OpenCV's come
with neither. Every figure is the least of many calls in one process, after a first one that compiles. Speeds are
benchmarks, never tests: they belong to the machine that printed them.
"""

import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.descent import descend
from dockair.nav.pose.estimate import PoseOptions, solve_pose
from dockair.nav.pose.expectation import expectation
from dockair.nav.pose.levenberg_marquardt import LEVENBERG_MARQUARDT
from dockair.nav.pose.position import solve_position
from dockair.nav.pose.prior import AttitudePrior
from dockair.rotations import exp, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.pose.opencv_pose import OpenCvSolvers

_CALLS = 3000
_SIGMA_PX = 0.1
_SEED = 55
_TRACKED = "solve_pose, start, mirror=False"
_OPENCV_TRACKED = "OpenCV ITERATIVE, same start (no covariance)"
_FREE = "solve_pose, no start"


def bench_pose() -> dict[str, Any]:
    """Return {"microseconds": {what: us}, "ratios": {what: ratio}}."""
    camera, points_D = Camera(), LedRing().positions_D
    R, p = matrix_from_yaw_pitch_roll(0.1, 0.2, 0.05), np.array([10.0, 0.2, 0.1])
    pixels = camera.pixels_from_points(points_D @ R.T + p)
    pixels += _SIGMA_PX * np.random.default_rng(_SEED).standard_normal(pixels.shape)
    start = exp(np.deg2rad([0.1, 0.15, -0.1])) @ R, p + np.array([0.024, 0.003, -0.002])
    prior = AttitudePrior(R_CD=start[0], information=np.eye(3) / np.deg2rad(1.0) ** 2)
    P = np.deg2rad(1.0) ** 2 * np.eye(3)
    alone, in_pixels = PoseOptions(mirror=False), PoseOptions(mirror=False, residuals="pixels")
    robust = PoseOptions(mirror=False, huber_sigma=3.0)
    both = solve_pose(pixels, points_D, camera, initial=start)
    sight = both.measurement
    assert sight is not None
    opencv = OpenCvSolvers(camera, points_D)
    calls: dict[str, Callable[[], object]] = {
        "descent alone, lines of sight at hand": lambda: descend(sight, *start, LEVENBERG_MARQUARDT),
        _TRACKED: lambda: solve_pose(pixels, points_D, camera, initial=start, options=alone),
        "solve_pose, start, both minima": lambda: solve_pose(pixels, points_D, camera, initial=start),
        _FREE: lambda: solve_pose(pixels, points_D, camera),
        "solve_pose, start, mirror=False, pixel residuals": lambda: solve_pose(
            pixels, points_D, camera, initial=start, options=in_pixels
        ),
        "solve_pose, start, mirror=False, Huber": lambda: solve_pose(
            pixels, points_D, camera, initial=start, options=robust
        ),
        "solve_pose, attitude prior, both minima": lambda: solve_pose(pixels, points_D, camera, prior=prior),
        "solve_position": lambda: solve_position(pixels, points_D, camera, start[0], attitude_covariance=P),
        "expectation": lambda: expectation(both),
        _OPENCV_TRACKED: opencv.start_in_place(pixels, start),
        "OpenCV ITERATIVE, no start (no covariance)": lambda: opencv.iterative(pixels),
        "OpenCV IPPE + RefineLM, both minima (no covariance)": lambda: opencv.ippe_refined(pixels),
        "OpenCV SQPNP (no covariance)": lambda: opencv.sqpnp(pixels),
    }
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        us = {name: _least(call) for name, call in calls.items()}
    finally:
        cv2.setNumThreads(threads)
    ratios = {f"{_OPENCV_TRACKED} over {_TRACKED}": us[_OPENCV_TRACKED] / us[_TRACKED]}
    ratios |= {
        f"{name} over {_FREE}": us[name] / us[_FREE] for name in us if "OpenCV" in name and name != _OPENCV_TRACKED
    }
    return {"microseconds": us, "ratios": ratios}


def _least(call: Callable[[], object]) -> float:
    """Shortest time of a call [us], after one that compiles."""
    call()
    times = []
    for _ in range(_CALLS):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return 1e6 * min(times)
