import numpy as np
import pytest
from scipy import ndimage

from dockair.nav.image.centroid import NoiseModel, measure_blobs
from dockair.nav.image.detect import detect
from dockair.nav.image.labelling import foreground_runs

NOISE = NoiseModel(gain_dn_per_electron=0.02, noise_dn=0.4, saturation_dn=255, floor_px=0.0, clipped_floor_px=0.05)


def test_weighted_centre_is_that_of_scipy_on_the_blob_and_its_neighbours():
    rng = np.random.default_rng(5)
    image = rng.integers(0, 8, (40, 60)).astype(np.uint8)
    for row, column in ((8, 9), (20, 30), (30, 50)):
        image[row : row + 4, column : column + 5] = rng.integers(60, 250, (4, 5))
    runs = foreground_runs(image, 30)
    ours = measure_blobs(image, runs, 30, NOISE, background_dn=4.0, local_background=False)
    labels, count = ndimage.label(image > 30, np.ones((3, 3)))
    grown = ndimage.grey_dilation(labels, (3, 3))
    weights = image.astype(float) - 4.0
    theirs = np.array(ndimage.center_of_mass(weights, grown, range(1, count + 1)))[:, ::-1]
    np.testing.assert_allclose(ours.centroids_px, theirs, atol=1e-12)
    np.testing.assert_allclose(ours.flux, ndimage.sum(weights, grown, range(1, count + 1)), atol=1e-9)
    np.testing.assert_array_equal(ours.peak, ndimage.maximum(image, labels, range(1, count + 1)))


def test_two_unequal_pixels_have_their_centre_between_them():
    """Levels 100 and 50 over background 0: u = 10 + 1/3; shot noise g I: var = g sum (u_i-u)^2 I_i / F^2."""
    image = np.zeros((9, 21), np.uint8)
    image[4, 10], image[4, 11] = 100, 50
    noise = NoiseModel(gain_dn_per_electron=0.02, noise_dn=0.0, saturation_dn=255, floor_px=0.0, clipped_floor_px=0.0)
    blob = measure_blobs(image, foreground_runs(image, 20), 20, noise, background_dn=0.0)
    np.testing.assert_allclose(blob.centroids_px, [[10.0 + 1.0 / 3.0, 4.0]], atol=1e-12)
    variance = 0.02 * ((1 / 3) ** 2 * 100 + (2 / 3) ** 2 * 50) / 150.0**2
    assert blob.sigma_px[0] == pytest.approx(np.sqrt(variance), rel=1e-12)


def test_a_level_added_everywhere_moves_no_centre():
    rng = np.random.default_rng(6)
    image = np.zeros((20, 20), np.uint8)
    image[8:12, 7:12] = rng.integers(60, 120, (4, 5))
    before = measure_blobs(image, foreground_runs(image, 40), 40, NOISE, background_dn=0.0)
    lifted = (image + 90).astype(np.uint8)
    after = measure_blobs(lifted, foreground_runs(lifted, 130), 130, NOISE, background_dn=90.0)
    np.testing.assert_allclose(after.centroids_px, before.centroids_px, atol=1e-12)


def test_a_row_of_n_pixels_is_n_times_as_long_as_wide():
    image = np.zeros((20, 40), np.uint8)
    image[5, 5:15] = image[10:14, 5:9] = 100
    blobs = measure_blobs(image, foreground_runs(image, 50), 50, NOISE, background_dn=0.0)
    np.testing.assert_allclose(blobs.elongation, [10.0, 1.0], rtol=1e-12)


def test_a_blob_at_the_frame_edge_is_measured_inside_the_frame():
    image = np.zeros((10, 10), np.uint8)
    image[0:2, 8:10] = 100
    blob = measure_blobs(image, foreground_runs(image, 50), 50, NOISE, background_dn=0.0)
    np.testing.assert_allclose(blob.centroids_px, [[8.5, 0.5]], atol=1e-12)


def _errors(render, electrons, sigma_px, frames, seed):
    """Errors and normalised errors of both coordinates over random sub-pixel phases."""
    rng = np.random.default_rng(seed)
    errors, normalised, clipped = [], [], []
    for _ in range(frames):
        spots = [
            (20 + 30 * i + rng.uniform(-0.5, 0.5), 20 + 30 * j + rng.uniform(-0.5, 0.5), electrons)
            for j in range(4)
            for i in range(4)
        ]
        blobs = detect(render((130, 130), spots, rng, sigma_px=sigma_px))
        assert len(blobs) == 16
        for u, v, _ in spots:
            offsets = blobs.centroids_px - [u, v]
            k = np.argmin((offsets**2).sum(axis=1))
            errors.append(offsets[k])
            normalised.append(offsets[k] / blobs.sigma_px[k])
            clipped.append(blobs.clipped[k])
    return np.array(errors), np.array(normalised), np.array(clipped)


def test_centre_error_at_twenty_thousand_electrons_is_below_three_hundredths_of_a_pixel(render):
    errors, normalised, clipped = _errors(render, 2e4, 0.7, 40, seed=7)
    assert not clipped.any()
    assert np.sqrt((errors**2).sum(axis=1).mean()) <= 0.03
    assert np.abs(errors.mean(axis=0)).max() < 0.002  # five standard errors of 640 spots at 0.01 px
    # honest: 1280 normal errors have a root mean square of 1 +- 0.02
    assert 0.85 < np.sqrt((normalised**2).mean()) < 1.15


@pytest.mark.parametrize("electrons", [1e5, 1e6])
def test_clipped_centres_are_flagged_and_stay_within_a_tenth_of_a_pixel(render, electrons):
    """1e6 electrons in a spot of sigma 0.7 px are 20 full wells in its brightest pixel."""
    errors, normalised, clipped = _errors(render, electrons, 0.7, 20, seed=8)
    assert clipped.all()
    assert np.sqrt((errors**2).sum(axis=1).mean()) <= 0.1
    assert np.sqrt((normalised**2).mean()) < 1.2
