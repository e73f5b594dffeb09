"""Pictures of one size: what they keep of a frame."""

import numpy as np
import pytest

from dockair.scenarios.envs.picture import pooled_picture


@pytest.mark.parametrize(
    ("frame", "k"), [((100, 128), 1), ((128, 129), 2), ((300, 120), 3), ((1, 1), 1), ((1088, 2048), 16)]
)
def test_the_factor_is_the_smallest_at_which_the_frame_fits(frame, k):
    picture, pooled = pooled_picture(np.full(frame, 7, np.uint8), (128, 128))
    assert pooled == k
    assert picture.shape == (128, 128)


def test_each_pixel_is_the_brightest_of_its_block_and_the_rest_is_black():
    pixels = np.random.default_rng(3).integers(1, 255, (270, 250)).astype(np.uint8)
    picture, k = pooled_picture(pixels, (128, 128))
    assert k == 3
    padded = np.zeros((384, 384), np.uint8)
    padded[:270, :250] = pixels
    np.testing.assert_array_equal(picture, padded.reshape(128, 3, 128, 3).max(axis=(1, 3)))


def test_a_read_only_frame_is_no_other_frame():
    pixels = np.arange(64, dtype=np.uint8).reshape(8, 8)
    frozen = pixels.copy()
    frozen.setflags(write=False)
    np.testing.assert_array_equal(pooled_picture(frozen, (4, 4))[0], pooled_picture(pixels, (4, 4))[0])
