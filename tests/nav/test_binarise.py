import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.image.binarise import FrameStatistics, adaptive_threshold, binarise, frame_statistics


def test_a_pixel_at_the_threshold_is_background():
    image = np.array([[9, 10, 11]], np.uint8)
    assert binarise(image, 10).tolist() == [[False, False, True]]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_statistics_of_normal_noise_are_its_mean_and_standard_deviation(dtype):
    # 16384 of 10^6 pixels are looked at: the median's standard error is 1.25 * 6 / 128 = 0.06; five of them, and more
    # for the quantile
    image = np.rint(np.random.default_rng(1).normal(40.0, 6.0, (1000, 1000))).astype(dtype)
    statistics = frame_statistics(image)
    assert statistics.background_dn == pytest.approx(40.0, abs=0.3)
    assert statistics.noise_dn == pytest.approx(6.0, abs=0.4)


def test_statistics_do_not_see_the_sun_or_the_leds():
    image = np.random.default_rng(2).poisson(4.0, (400, 400)).astype(np.uint8)
    before = frame_statistics(image)
    image[100:127, 100:127] = 255
    image[::50, ::50] = 200
    after = frame_statistics(image)
    assert after.background_dn == pytest.approx(before.background_dn, abs=0.1)
    assert after.noise_dn == pytest.approx(before.noise_dn, abs=0.1)


def test_a_constant_image_has_the_noise_of_its_quantisation():
    # all pixels in one level: the interpolated quantiles are those of a uniform level, 0.5 - 0.158655 wide
    statistics = frame_statistics(np.full((64, 64), 7, np.uint8))
    assert statistics.background_dn == pytest.approx(7.0, abs=1e-12)
    assert statistics.noise_dn == pytest.approx(0.341345, abs=1e-6)


@pytest.mark.parametrize(("noise_dn", "threshold"), [(0.1, 12), (2.0, 20), (50.0, 44)])
def test_contrast_follows_the_noise_between_its_limits(noise_dn, threshold):
    statistics = FrameStatistics(background_dn=4.0, noise_dn=noise_dn)
    assert adaptive_threshold(statistics, noise_factor=8.0, min_contrast_dn=8.0, max_contrast_dn=40.0) == threshold


@pytest.mark.parametrize(
    "image", [np.zeros((2, 2), float), np.zeros((2, 2), bool), np.zeros(4, np.uint8), np.zeros((0, 5), np.uint8)]
)
def test_what_is_no_grey_frame_is_refused(image):
    with pytest.raises(DockairError, match="image"):
        frame_statistics(image)
