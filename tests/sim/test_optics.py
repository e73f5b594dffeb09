"""The point spread function against closed forms and the Airy pattern."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j0, j1

from dockair.calibration import Camera
from dockair.parameters import load_parameters
from dockair.sim.camera.optics import AIRY_SIGMAS, AIRY_WEIGHTS, add_blobs, psf_sigmas_px
from dockair.sim.camera.radiometry import CameraParameters

CAMERA = load_parameters("camera", CameraParameters)
LED_M = 850e-9


def _blob(u: float, v: float, shape: tuple[int, int] = (121, 121), x: float = 10.0) -> np.ndarray:
    image = np.zeros(shape)
    sigmas = psf_sigmas_px(CAMERA, Camera(), LED_M, np.array([x]), 1e-3)
    add_blobs(image, (0, 0), np.array([[u, v]]), np.ones(1), sigmas)
    return image


@pytest.mark.parametrize("phase", [(0.0, 0.0), (0.25, -0.4), (0.5, 0.5), (-0.13, 0.31)])
def test_a_blobs_sum_is_one_and_its_first_moment_is_the_true_position(phase: tuple[float, float]) -> None:
    """A Gaussian integrated over pixels keeps its mean up to aliasing, exp(-2 (pi sigma)^2) of a pixel.

    That is 5e-4 px here (core 0.57 px) and largest a quarter pixel off a centre.
    """
    u, v = 60.0 + phase[0], 60.0 + phase[1]
    image = _blob(u, v)
    assert image.sum() == pytest.approx(1.0, abs=2e-6)
    rows, columns = np.indices(image.shape)
    assert (image * columns).sum() == pytest.approx(u, abs=1e-3)
    assert (image * rows).sum() == pytest.approx(v, abs=1e-3)


def test_a_blob_cut_by_a_window_is_the_full_frames_blob() -> None:
    full = _blob(60.3, 57.8)
    part = np.zeros((20, 30))
    sigmas = psf_sigmas_px(CAMERA, Camera(), LED_M, np.array([10.0]), 1e-3)
    add_blobs(part, (45, 50), np.array([[60.3, 57.8]]), np.ones(1), sigmas)
    assert np.allclose(part, full[45:65, 50:80], rtol=1e-9, atol=1e-15)


def test_a_blob_outside_the_image_adds_nothing() -> None:
    assert not _blob(400.0, -300.0).any()


def test_the_mixtures_encircled_energy_is_the_airy_patterns_within_2_1_percent() -> None:
    r = np.linspace(0.01, 8.0, 400)
    airy = 1.0 - j0(np.pi * r) ** 2 - j1(np.pi * r) ** 2  # [Born & Wolf, section 8.5.2]
    mixture = (AIRY_WEIGHTS[:, None] * (1.0 - np.exp(-0.5 * (r / AIRY_SIGMAS[:, None]) ** 2))).sum(0)
    assert np.abs(mixture - airy).max() < 0.021
    assert AIRY_WEIGHTS.sum() == pytest.approx(1.0, abs=1e-12)


def test_the_peak_pixel_is_the_airy_patterns_within_2_percent() -> None:
    """Independent: the optical transfer function of a round aperture x pixel x diffusion, transformed to the centre."""
    q = LED_M * CAMERA.f_number / Camera().pixel_pitch_m
    f = (np.arange(-1000, 1000) + 0.5) / 1000.0 / q  # cycles per pixel, up to the cut-off 1/q
    fx, fy = np.meshgrid(f, f)
    s = np.minimum(np.hypot(fx, fy) * q, 1.0)
    otf = 2.0 / np.pi * (np.arccos(s) - s * np.sqrt(1.0 - s**2))
    pixel = np.sinc(fx) * np.sinc(fy)
    die = np.sinc(fx * 0.016 * 1e-3 / 10.0 / 5.5e-6) * np.sinc(fy * 0.016 * 1e-3 / 10.0 / 5.5e-6)
    spread = np.exp(-2.0 * (np.pi * CAMERA.diffusion_px) ** 2 * (fx**2 + fy**2))
    peak = (otf * pixel * die * spread).sum() * (f[1] - f[0]) ** 2
    assert _blob(60.0, 60.0).max() == pytest.approx(peak, rel=0.02)


def test_defocus_adds_the_variance_of_its_disc() -> None:
    """f/8, 16 mm, focus 10 m: at 2 m the disc is 2.33 px wide, variance b^2/16 on each axis."""
    near, focus = psf_sigmas_px(CAMERA, Camera(), LED_M, np.array([2.0, 10.0]), 0.0)
    width_px = 0.016**2 / 8.0 * (1.0 / 2.0 - 1.0 / 10.0) / 5.5e-6
    assert width_px == pytest.approx(2.33, abs=0.01)
    assert near**2 - focus**2 == pytest.approx(np.full(3, width_px**2 / 16.0), rel=1e-9)


def test_a_stopped_down_lens_blurs_in_proportion_to_its_f_number() -> None:
    sharp = replace(CAMERA, diffusion_px=0.0)
    f8 = psf_sigmas_px(sharp, Camera(), LED_M, np.array([10.0]), 0.0)
    f16 = psf_sigmas_px(replace(sharp, f_number=16.0), Camera(), LED_M, np.array([10.0]), 0.0)
    assert f16 == pytest.approx(2.0 * f8, rel=1e-12)
