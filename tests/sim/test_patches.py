"""Wide patches keep their light, their place and their width; a window shows what the full frame shows."""

import numpy as np
import pytest

from dockair.sim.camera.patches import add_patches

FULL = (200, 300)


def _patch(start: tuple[int, int] = (0, 0), shape: tuple[int, int] = FULL, **change: np.ndarray) -> np.ndarray:
    image = np.zeros(shape, dtype=np.float32)
    patch = {"pixels": np.array([[140.3, 95.7]]), "electrons": np.array([5e4]), "sigma_px": np.array([12.5])} | change
    add_patches(image, start, patch["pixels"], patch["electrons"], patch["sigma_px"])
    return image


def test_a_patch_has_its_light_its_middle_and_its_variance() -> None:
    image = _patch().astype(float)
    rows, columns = np.indices(image.shape)
    total = image.sum()
    assert total == pytest.approx(5e4, rel=3e-6)
    assert (image * columns).sum() / total == pytest.approx(140.3, abs=1e-4)
    assert (image * rows).sum() / total == pytest.approx(95.7, abs=1e-4)
    # the pixel's own 1/12 comes on top
    assert (image * (columns - 140.3) ** 2).sum() / total == pytest.approx(12.5**2 + 1.0 / 12.0, rel=1e-4)


def test_a_patch_in_a_window_is_the_full_frames_bit_for_bit() -> None:
    pixels = np.array([[140.3, 95.7], [100.1, 60.9], [-20.0, 100.0]])
    many = {"pixels": pixels, "electrons": np.array([5e4, 1e3, 2e4]), "sigma_px": np.array([12.5, 3.0, 30.0])}
    window = _patch((37, 91), (80, 70), **many)
    assert window.any()
    assert np.array_equal(window, _patch(**many)[37:117, 91:161])


def test_patches_add_up_and_those_outside_or_nowhere_add_nothing() -> None:
    nowhere = np.array([[np.nan, 3.0], [5.0, np.inf], [900.0, 50.0], [50.0, -900.0]])
    assert not _patch(pixels=nowhere, electrons=np.full(4, 1e4), sigma_px=np.full(4, 10.0)).any()
    assert not _patch(electrons=np.array([np.nan])).any()
    twice = _patch(pixels=np.array([[140.3, 95.7]] * 2), electrons=np.full(2, 5e4), sigma_px=np.full(2, 12.5))
    np.testing.assert_allclose(twice, 2.0 * _patch(), rtol=1e-6)
