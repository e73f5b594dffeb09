import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy import ndimage
from scipy.special import erf

from dockair.errors import DockairError
from dockair.nav.image.labelling import foreground_runs
from dockair.nav.image.morphology import (
    close,
    dilate,
    erode,
    open_,
    open_and_trace,
    open_components,
    structuring_element,
)

MASKS = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=18), elements=st.booleans())
ELEMENTS = [("square", 3), ("cross", 3), ("square", 5), ("disc", 5), ("square", 1)]


@given(mask=MASKS, element=st.sampled_from(ELEMENTS))
@settings(max_examples=300, deadline=None)
def test_every_operation_is_that_of_scipy(mask, element):
    S = structuring_element(*element)
    reference = {
        erode: ndimage.binary_erosion,
        dilate: ndimage.binary_dilation,
        open_: ndimage.binary_opening,
    }
    for ours, theirs in reference.items():
        np.testing.assert_array_equal(ours(mask, S), theirs(mask, S))
    # scipy's closing erodes from outside the frame as ours does
    np.testing.assert_array_equal(close(mask, S), ndimage.binary_erosion(ndimage.binary_dilation(mask, S), S))


def test_dilation_of_one_pixel_is_the_element_and_erosion_of_the_element_is_one_pixel():
    """[Yoon 2018, Figs 4-5]."""
    point = np.zeros((7, 7), bool)
    point[3, 3] = True
    for name in ("cross", "square"):
        S = structuring_element(name, 3)
        grown = dilate(point, S)
        np.testing.assert_array_equal(grown[2:5, 2:5], S.astype(bool))
        np.testing.assert_array_equal(erode(grown, S), point)


@given(mask=MASKS, element=st.sampled_from(ELEMENTS), spare=st.integers(1, 14), connectivity=st.sampled_from([4, 8]))
@settings(max_examples=300, deadline=None)
def test_opening_the_components_is_opening_the_image_but_for_the_spared(mask, element, spare, connectivity):
    S = structuring_element(*element)
    runs = foreground_runs(mask.astype(np.uint8), 0, connectivity)
    opened = open_components(runs, S, spare, connectivity)
    ours = np.zeros(mask.shape, np.int32)
    for c in range(opened.count):
        for k in range(opened.offset[c], opened.offset[c + 1]):
            ours[opened.row[k], opened.start[k] : opened.stop[k]] = c + 1
    structure = np.ones((3, 3)) if connectivity == 8 else None
    labels, _ = ndimage.label(mask, structure)
    small = np.isin(labels, np.flatnonzero(np.bincount(labels.ravel()) < spare)) & mask
    expected = small | ndimage.binary_opening(mask & ~small, S)
    np.testing.assert_array_equal(ours > 0, expected)
    assert opened.count == ndimage.label(small, structure)[1] + ndimage.label(expected & ~small, structure)[1]


def test_opening_never_loses_a_round_spot_of_thirteen_pixels_or_more():
    S = structuring_element("square", 3)
    grid = np.arange(31) - 15.0
    smallest = 10**9
    for sigma in (0.5, 0.7, 1.0, 1.5):
        for du in np.linspace(-0.5, 0.5, 7):
            for dv in np.linspace(-0.5, 0.5, 7):
                u, v = (
                    0.5 * (erf((grid + 0.5 - d) / (sigma * 2**0.5)) - erf((grid - 0.5 - d) / (sigma * 2**0.5)))
                    for d in (du, dv)
                )
                spot = np.outer(v, u)
                for level in (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 1e-3, 1e-4):
                    mask = spot > level * spot.max()
                    if mask.sum() >= 13:
                        smallest = min(smallest, int(open_(mask, S).sum()))
    assert smallest >= 9


def test_opening_takes_a_bridge_from_between_two_leds():
    image = np.zeros((12, 24), np.uint8)
    image[4:8, 4:8] = image[4:8, 14:18] = image[5, 8:14] = 200
    runs = foreground_runs(image, 100)
    assert runs.count == 1
    opened = open_components(runs, structuring_element("square", 3), 13)
    assert opened.area_px.tolist() == [16, 16]


def test_of_an_element_that_is_not_symmetric_dilation_is_the_element_and_opening_keeps_it():
    """Dilation looks the other way than erosion: with the same sign an opening would move what it keeps."""
    S = np.array([[0, 0, 0], [0, 1, 1], [0, 0, 0]], np.uint8)
    point = np.zeros((7, 7), bool)
    point[3, 3] = True
    grown = dilate(point, S)
    np.testing.assert_array_equal(grown[2:5, 2:5], S.astype(bool))
    np.testing.assert_array_equal(erode(grown, S), point)
    mask = np.random.default_rng(5).random((40, 50)) < 0.7
    np.testing.assert_array_equal(open_(mask, S), ndimage.binary_opening(mask, S))
    runs = foreground_runs(mask.astype(np.uint8), 0)
    assert open_components(runs, S, 1).area_px.sum() == open_(mask, S).sum()


def test_a_disc_is_the_square_without_its_corners():
    expected = np.ones((5, 5), np.uint8)
    expected[[0, 0, 0, 0, 4, 4, 4, 4], [0, 1, 3, 4, 0, 1, 3, 4]] = 0
    np.testing.assert_array_equal(structuring_element("disc", 5), expected)


@pytest.mark.parametrize("shape", [(0, 5), (5, 0), (0, 0)])
@pytest.mark.parametrize("operation", [erode, dilate, open_, close])
def test_a_mask_without_pixels_stays_one(operation, shape):
    assert operation(np.zeros(shape, bool), structuring_element()).shape == shape


@pytest.mark.parametrize(("connectivity", "areas"), [(4, [9, 9]), (8, [18])])
def test_pieces_that_touch_at_a_corner_are_one_only_with_eight_neighbours(connectivity, areas):
    """Two squares, corner to corner, and a pixel in the angle between them that opening takes away."""
    mask = np.zeros((8, 8), bool)
    mask[1:4, 1:4] = mask[4:7, 4:7] = mask[3, 4] = True
    runs = foreground_runs(mask.astype(np.uint8), 0, connectivity)
    assert runs.count == 1
    assert open_components(runs, structuring_element(), 1, connectivity).area_px.tolist() == areas


def test_wrong_elements_are_refused():
    with pytest.raises(DockairError, match="square"):
        structuring_element("star", 3)
    with pytest.raises(DockairError, match="odd"):
        structuring_element("cross", 4)
    with pytest.raises(DockairError, match="odd"):
        structuring_element("cross", -1)
    with pytest.raises(DockairError, match="mask"):
        erode(np.zeros((3, 3)), structuring_element())
    with pytest.raises(DockairError, match="mask"):
        erode(np.zeros((3, 3, 2), bool), structuring_element())


def test_opening_keeps_what_has_the_right_area_before_and_after_and_says_whence():
    mask = np.zeros((12, 40), bool)
    mask[1:3, 1:3] = True  # 4 pixels, spared
    mask[1:7, 6:12] = True  # 36 pixels, too large
    mask[1:4, 16:28] = True  # two squares on a bridge, 36 pixels less 10
    mask[[1, 3], 19:24] = False
    mask[9, 1] = True  # one pixel, too small
    mask[8:11, 31:34] = mask[9, 34:37] = True  # a square with a streak, 12 pixels
    mask[10:12, 10:12] = True  # 4 pixels again, after others
    runs, S = foreground_runs(mask.astype(np.uint8), 0), structuring_element("square", 3)
    for area_range_px in ((3, 30), (4, 26)):
        opened, origin, area = open_and_trace(runs, S, 9, 8, area_range_px)
        assert area.tolist() == opened.area_px.tolist() == [4, 9, 12, 9, 4]
        assert runs.area_px[origin].tolist() == [4, 26, 26, 12, 4]
    assert open_and_trace(runs, S, 9, 8, (9, 26))[2].tolist() == [9, 12, 9]
    assert len(open_and_trace(runs, structuring_element("square", 3), 9, 8, (10, 12))[0].offset) == 1
