import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy import ndimage

from dockair.errors import DockairError
from dockair.nav.image.labelling import Runs, first_pass, foreground_runs, label_contour_tracing, label_two_pass

MASKS = arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=16))
CONNECTIVITY = st.sampled_from([4, 8])


def from_runs(runs: Runs, shape: tuple[int, int]) -> np.ndarray:
    labels = np.zeros(shape, np.int32)
    for c in range(runs.count):
        for k in range(runs.offset[c], runs.offset[c + 1]):
            assert (labels[runs.row[k], runs.start[k] : runs.stop[k]] == 0).all()
            labels[runs.row[k], runs.start[k] : runs.stop[k]] = c + 1
    return labels


def in_raster_order(labels: np.ndarray) -> np.ndarray:
    """The same partition, numbered by first pixel."""
    values, first = np.unique(labels, return_index=True)
    new = np.zeros(labels.max() + 1, int)
    new[values[np.argsort(first)][values[np.argsort(first)] > 0]] = np.arange(1, np.count_nonzero(values) + 1)
    return new[labels]


def all_labellings(mask: np.ndarray, connectivity: int) -> list[np.ndarray]:
    runs = foreground_runs(mask.astype(np.uint8) * 100, 50, connectivity)
    tracing, count = label_contour_tracing(mask, connectivity)
    two_pass, other_count = label_two_pass(mask, connectivity)
    assert count == other_count == runs.count
    return [tracing, two_pass, from_runs(runs, mask.shape)]


def check_against_scipy_and_opencv(mask: np.ndarray, connectivity: int) -> None:
    reference, _ = ndimage.label(mask, np.ones((3, 3)) if connectivity == 8 else None)
    _, opencv = cv2.connectedComponents(mask.astype(np.uint8), connectivity=connectivity)
    expected = in_raster_order(reference)
    np.testing.assert_array_equal(in_raster_order(opencv), expected)
    for labels in all_labellings(mask, connectivity):
        np.testing.assert_array_equal(labels, expected)


@given(mask=MASKS, connectivity=CONNECTIVITY)
@settings(max_examples=1000, deadline=None)
def test_every_labelling_is_the_partition_of_scipy_and_opencv(mask, connectivity):
    check_against_scipy_and_opencv(mask, connectivity)


@pytest.mark.parametrize("connectivity", [4, 8])
def test_larger_random_images_of_every_density_and_grain_are_labelled_alike(connectivity):
    """Near the density at which they begin to percolate (0.59 and 0.41) components wind most."""
    rng = np.random.default_rng(connectivity)
    for _ in range(500):
        grain = rng.integers(1, 4, 2)
        shape = rng.integers(1, 70, 2)
        coarse = rng.random(-(-shape // grain)) < rng.choice([0.1, 0.41, 0.5, 0.59, 0.9])
        check_against_scipy_and_opencv(np.kron(coarse, np.ones(grain, bool))[: shape[0], : shape[1]] > 0, connectivity)


@pytest.mark.parametrize("connectivity", [4, 8])
def test_components_at_the_ends_of_what_is_passed_over_at_once_are_labelled_alike(connectivity):
    """Sparse images wider than three times 64 pixels, with foreground on either side of every multiple of it."""
    rng = np.random.default_rng(10 + connectivity)
    for _ in range(100):
        mask = rng.random((12, int(rng.integers(190, 330)))) < 0.002
        for column in range(62, mask.shape[1] - 4, 64):
            mask[rng.integers(0, 12), column : column + 4] |= rng.random(4) < 0.5
        check_against_scipy_and_opencv(mask, connectivity)


def _spiral(size: int) -> np.ndarray:
    mask = np.zeros((size, size), bool)
    top, left, bottom, right = 0, 0, size - 1, size - 1
    while top <= bottom and left <= right:
        mask[top, left : right + 1] = mask[top : bottom + 1, right] = mask[bottom, left : right + 1] = True
        mask[top + 2 : bottom + 1, left] = True
        if top + 2 <= bottom:
            mask[top + 2, left : left + 2] = True
        top, left, bottom, right = top + 2, left + 2, bottom - 2, right - 2
    return mask


ADVERSARIAL = {
    "checkerboard": np.indices((31, 33)).sum(axis=0) % 2 == 0,
    "spiral": _spiral(31),
    "nested rings": np.isin(np.maximum(*np.abs(np.indices((41, 41)) - 20)) % 4, [0, 1]),
    "diagonal lines": np.indices((29, 29)).sum(axis=0) % 3 == 0,
    "comb": (np.indices((21, 41))[1] % 2 == 0) | (np.indices((21, 41))[0] == 20),
    "ring of corners": np.abs(np.indices((21, 21)) - 10).sum(axis=0) == 8,
    "full": np.ones((9, 11), bool),
    "empty": np.zeros((9, 11), bool),
    "one pixel": np.ones((1, 1), bool),
}


@pytest.mark.parametrize("connectivity", [4, 8])
@pytest.mark.parametrize("name", ADVERSARIAL)
def test_adversarial_images_are_labelled_like_scipy(name, connectivity):
    mask = ADVERSARIAL[name]
    expected = in_raster_order(ndimage.label(mask, np.ones((3, 3)) if connectivity == 8 else None)[0])
    for labels in all_labellings(mask, connectivity):
        np.testing.assert_array_equal(labels, expected)


def test_first_pass_leaves_a_u_in_two_labels_that_the_table_joins():
    """[Yoon 2018, Fig 8]: the arms of a U get their own labels until the bottom row shows that they are one."""
    mask = np.array([[1, 0, 1], [1, 0, 1], [1, 1, 1]], bool)
    labels, parent = first_pass(mask, 4)
    assert labels[0, 0] == 1
    assert labels[0, 2] == 2
    assert parent[2] == 1
    assert label_two_pass(mask, 4)[1] == 1


@pytest.mark.parametrize(("connectivity", "count"), [(4, 3), (8, 1)])
def test_the_table_has_an_entry_for_each_provisional_label_and_the_background(connectivity, count):
    labels, parent = first_pass(np.eye(3, dtype=bool), connectivity)
    assert labels.max() == count
    assert parent.tolist() == list(range(count + 1))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_threshold_that_no_pixel_can_have_is_the_nearest_that_one_can(dtype):
    most = int(np.iinfo(dtype).max)
    image = np.array([[0, 1, 0, most - 1, most]], dtype)
    for threshold, starts in ((-1, [1, 3]), (0, [1, 3]), (1, [3]), (most - 1, [4]), (most, []), (most + 1, [])):
        assert foreground_runs(image, threshold).start.tolist() == starts


def test_a_diagonal_pair_is_one_object_only_with_eight_neighbours():
    mask = np.eye(2, dtype=bool)
    assert label_contour_tracing(mask, 8)[1] == 1
    assert label_contour_tracing(mask, 4)[1] == 2


def test_areas_and_selection_of_runs_are_those_of_the_labels():
    mask = np.random.default_rng(3).random((40, 50)) < 0.35
    runs = foreground_runs(mask.astype(np.uint8), 0, 8)
    labels, count = label_contour_tracing(mask, 8)
    np.testing.assert_array_equal(runs.area_px, np.bincount(labels.ravel(), minlength=count + 1)[1:])
    keep = runs.area_px >= 4
    selected = from_runs(runs.select(keep), mask.shape) > 0
    np.testing.assert_array_equal(selected, np.isin(labels, np.flatnonzero(keep) + 1))


@pytest.mark.parametrize("shape", [(0, 7), (7, 0)])
def test_an_image_without_pixels_has_no_components(shape):
    assert label_contour_tracing(np.zeros(shape, bool))[1] == 0
    assert label_two_pass(np.zeros(shape, bool))[1] == 0
    none = foreground_runs(np.zeros(shape, np.uint8), 3)
    assert none.count == 0 and none.area_px.shape == (0,)


def test_an_image_that_is_not_contiguous_is_labelled_right():
    image = np.random.default_rng(4).integers(0, 255, (30, 60)).astype(np.uint8)[::2, ::-3]
    labels, _ = label_contour_tracing(image > 128)
    np.testing.assert_array_equal(from_runs(foreground_runs(image, 128), image.shape), labels)


def test_other_connectivities_and_grey_images_are_refused():
    with pytest.raises(DockairError, match="connectivity"):
        label_contour_tracing(np.zeros((2, 2), bool), 6)
    with pytest.raises(DockairError, match="connectivity"):
        foreground_runs(np.zeros((2, 2), np.uint8), 1, 6)
    with pytest.raises(DockairError, match="mask"):
        label_two_pass(np.zeros((2, 2), np.uint8))
    with pytest.raises(DockairError, match="mask"):
        label_contour_tracing(np.zeros((2, 2, 2), bool))
