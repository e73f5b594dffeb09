from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erf, ndtr
from scipy.stats import poisson

from dockair.calibration import Camera, LedRing
from dockair.rotations import Array, matrix_from_yaw_pitch_roll

FULL_WELL_E = 13500.0
READ_NOISE_E = 13.0
GAIN = 255.0 / FULL_WELL_E


def _render(
    shape: tuple[int, int],
    spots: list[tuple[float, float, float]],
    rng: np.random.Generator,
    *,
    sigma_px: float = 0.7,
    background_e: float | Array = 100.0,
) -> NDArray[np.uint8]:
    """8-bit frame of pixel-integrated Gaussian spots (u, v, electrons): shot noise, clip, read noise, quantisation."""
    uneven = isinstance(background_e, np.ndarray)
    frame, light_e, drawn = np.zeros(shape, np.uint8), np.zeros(shape), np.full(shape, uneven)
    if not uneven:
        beside = rng.integers(0, 2**32, shape, dtype=np.uint32)
        for begins in _levels_begin(background_e):
            frame += beside >= begins
    reach = int(np.ceil(6.0 * sigma_px)) + 2
    for u, v, total in spots:
        rows = np.arange(max(round(v) - reach, 0), min(round(v) + reach + 1, shape[0]))
        columns = np.arange(max(round(u) - reach, 0), min(round(u) + reach + 1, shape[1]))
        parts = [
            0.5 * (erf((x + 0.5 - c) / (sigma_px * np.sqrt(2.0))) - erf((x - 0.5 - c) / (sigma_px * np.sqrt(2.0))))
            for x, c in ((rows, v), (columns, u))
        ]
        light_e[np.ix_(rows, columns)] += total * np.outer(*parts)
        drawn[np.ix_(rows, columns)] = True
    received_e = np.broadcast_to(background_e, shape)[drawn] + light_e[drawn]
    electrons = np.minimum(rng.poisson(received_e), FULL_WELL_E)
    electrons += READ_NOISE_E * rng.standard_normal(len(electrons))
    frame[drawn] = np.clip(np.rint(electrons * GAIN), 0, 255)
    return frame


@lru_cache
def _levels_begin(background_e: float) -> NDArray[np.uint32]:
    """2^32 times the probability that a pixel without a spot has less than level 1, 2, ...

    By these a draw of the frame's law takes a whole number and no Poisson variate for each of two million pixels.
    """
    counts = np.arange(poisson.ppf(1e-13, background_e), poisson.isf(1e-13, background_e) + 1)
    below_e = (np.arange(255) + 0.5)[:, np.newaxis] / GAIN - np.minimum(counts, FULL_WELL_E)
    below = ndtr(below_e / READ_NOISE_E) @ poisson.pmf(counts, background_e)
    begin = np.rint(2.0**32 * below)
    return begin[begin < 2.0**32].astype(np.uint32)


@pytest.fixture(name="render")
def render_fixture() -> Callable[..., NDArray[np.uint8]]:
    return _render


class RingScene:
    """A ring seen by the default camera, some LEDs hidden, clutter about, everything in random order."""

    def __init__(
        self,
        rng: np.random.Generator,
        *,
        visible: int = 8,
        clutter: int = 0,
        tilt_deg: float = 20.0,
        range_m: tuple[float, float] = (2.2, 30.0),
        sigma_px: float = 0.1,
        clutter_box_radii: float | None = None,
    ) -> None:
        camera = Camera()
        while True:
            self.range_m = rng.uniform(*range_m)
            self.R_CD = matrix_from_yaw_pitch_roll(*np.deg2rad(rng.uniform(-tilt_deg, tilt_deg, 3)))
            self.p_CD = self.range_m * np.array([1.0, rng.uniform(-0.25, 0.25), rng.uniform(-0.12, 0.12)])
            self.led_px: Array = camera.pixels_from_points(self.p_CD + LedRing().positions_D @ self.R_CD.T)
            if (self.led_px > 0).all() and (self.led_px < [2047, 1087]).all():
                break
        self.radius_px = camera.focal_length_px * 0.25 / self.p_CD[0]
        self.centre_px = camera.pixels_from_points(self.p_CD)[0]
        seen = rng.permutation(8)[:visible]
        low, high = np.zeros(2), np.array([2047.0, 1087.0])
        if clutter_box_radii is not None:
            low, high = (self.centre_px + side * clutter_box_radii * self.radius_px for side in (-1.0, 1.0))
        noise = sigma_px * rng.standard_normal((visible, 2))
        points = np.vstack([self.led_px[seen] + noise, rng.uniform(low, high, (clutter, 2))])
        order = rng.permutation(len(points))
        self.points = points[order]
        self.numbers = np.concatenate([seen, np.full(clutter, -1)])[order]  # -1 for clutter


@pytest.fixture(name="ring_scene")
def ring_scene_fixture() -> type[RingScene]:
    return RingScene
