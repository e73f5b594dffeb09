"""Features of pictures whose points are known: where they are said to be, and which grey levels are looked at."""

import numpy as np
import pytest

from dockair.nav.heading.features import _stretched, features_of
from dockair.nav.heading.turn import VisualSettings

SETTINGS = VisualSettings()  # images are halved
PLACES = np.array([[60.3, 50.8], [331.4, 170.9], [402.7, 233.4], [521.9, 350.2], [470.3, 150.6]])  # (u, v)


def picture(places=PLACES):
    """Round spots on an even ground, 400 rows of 600 pixels."""
    rows, columns = np.indices((400, 600))
    spots = sum(np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2.0 * 3.0**2)) for u, v in places)
    return np.rint(20.0 + 200.0 * spots).astype(np.uint8)


def nearest_px(features, place):
    return float(np.linalg.norm(features.pixels - place, axis=1).min())


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_feature_lies_where_its_spot_is_in_pixels_of_the_whole_image(dtype):
    features = features_of(picture().astype(dtype), SETTINGS, None, None)
    assert [nearest_px(features, place) < 0.05 for place in PLACES] == [True] * 5
    assert features.middle_px == 299.5


@pytest.mark.parametrize(("first", "last"), [((300, 140), (440, 260)), ((311, 153), (423, 251))])
def test_with_a_mask_the_features_inside_it_stay_where_they_are_and_others_are_left_out(first, last):
    """Only a part of the image around the mask is looked at; two spots are in the mask, and one is beside it."""
    mask = np.zeros((400, 600), bool)
    mask[first[1] : last[1], first[0] : last[0]] = True
    features = features_of(picture(), SETTINGS, mask, None)
    assert [nearest_px(features, place) < 0.15 for place in PLACES] == [False, True, True, False, False]
    u, v = np.rint(features.pixels).astype(int).T
    assert mask[np.clip(v, 0, 399), np.clip(u, 0, 599)].all()


def test_a_mask_that_allows_nothing_leaves_no_features():
    assert len(features_of(picture(), SETTINGS, np.zeros((400, 600), bool), None).pixels) == 0


def test_levels_from_the_darkest_to_the_brightest_hundredth_are_spread_over_eight_bits():
    levels = np.repeat(np.arange(1000, 1101), 404).reshape(404, 101)[::-1].astype(np.uint16)
    stretched = _stretched(levels, None)
    for level, expected in ((1000, 0), (1001, 0), (1050, 127), (1099, 255), (1100, 255)):
        assert np.unique(stretched[levels == level]) == pytest.approx(expected, abs=3)


def test_levels_outside_a_mask_do_not_count():
    levels = np.full((80, 80), 250, np.uint8)
    levels[:, :40] = np.arange(80)[:, None]
    mask = np.zeros((80, 80), bool)
    mask[:, :40] = True
    inside = _stretched(levels, mask)[:, :40]
    assert inside.min() == 0 and inside.max() == 255


def test_levels_that_are_nearly_alike_are_spread_as_if_there_were_sixteen_of_them():
    levels = np.where(np.indices((80, 80)).sum(axis=0) // 4 % 2, 100, 104).astype(np.uint8)
    stretched = _stretched(levels, None)
    assert np.unique(stretched).tolist() == [0, round(4 * 255 / 16 - 0.5)]
