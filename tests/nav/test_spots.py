"""Spots against their definition, written out pixel by pixel, and against what must not be one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.special import erf

from dockair.nav.image.spot_hits import find_hits
from dockair.nav.image.spot_kernels import (
    ARC,
    CUT_PX,
    REACHES_PX,
    ROW_STEPS,
    SPARE,
    WIDE_PX,
    _append_runs,
    _middle,
    ring_steps,
)
from dockair.nav.image.spots import SpotLimits, Spots, find_spots

LIMITS = SpotLimits(
    small_contrast_dn=2.0, middle_contrast_dn=4.0, wide_contrast_dn=48.0, isolation=3.0, texture=0.2, detection=6.0,
    beside=1.5, pixel=2.5, share=0.1,
    gain_dn_per_electron=0.0187, noise_dn=0.4,
)  # fmt: skip


def pixels_of(spots: Spots, k: int) -> list[tuple[int, int]]:
    runs = spots.runs
    return [
        (int(runs.row[r]), column)
        for r in range(runs.offset[k], runs.offset[k + 1])
        for column in range(runs.start[r], runs.stop[r])
    ]


def blurred(shape: tuple[int, int], spots: list[tuple[float, float, float, float]], background=0.0) -> np.ndarray:
    """Levels of round spots (u, v, peak, sigma) on a background: pixels integrate a Gaussian."""
    image = np.zeros(shape) + background
    for u, v, peak, sigma in spots:
        parts = [
            0.5 * (erf((np.arange(n) + 0.5 - c) / (sigma * 2**0.5)) - erf((np.arange(n) - 0.5 - c) / (sigma * 2**0.5)))
            for n, c in zip(shape, (v, u), strict=True)
        ]
        image += peak * np.outer(*parts) * 2 * np.pi * sigma**2
    return image


def digital(image: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def textured(seed: int, shape: tuple[int, int]) -> np.ndarray:
    """Ground, noise, and compact things of all sizes and levels."""
    rng = np.random.default_rng(seed)
    image = ndimage.gaussian_filter(rng.normal(size=shape), rng.uniform(1.0, 6.0))
    image = rng.uniform(3.0, 60.0) + rng.uniform(0.0, 15.0) * image / image.std()
    many = rng.integers(0, 12)
    places = rng.uniform(0.0, 1.0, (many, 2)) * [shape[1], shape[0]]
    spots = [(u, v, rng.choice([20.0, 60.0, 300.0]), rng.choice([0.5, 0.8, 2.5, 4.0])) for u, v in places]
    return digital(blurred(shape, spots, image) + rng.normal(size=shape))


def noise_of(level: float) -> float:
    return float(np.sqrt(LIMITS.gain_dn_per_electron * level + LIMITS.noise_dn**2))


def is_a_point(levels: np.ndarray, peak: tuple[int, int], b: float) -> bool:
    """Eq. (2), with NumPy."""
    i, j = peak
    w = np.outer([1, 2, 1], [1, 2, 1]) * (levels[i - 1 : i + 2, j - 1 : j + 2] - b)
    beside = np.delete(w.ravel(), 4)
    seven = beside.sum() - max(beside.max(), 0.0)
    least = max(LIMITS.beside * noise_of(b), LIMITS.share * (levels[i, j] - b))
    return w.sum() / 6.0 >= LIMITS.detection * noise_of(b) and seven / 4.0 >= least


def satisfies_the_definition(image: np.ndarray, threshold: int, background: float, pixels: list) -> bool:
    """Whether some reach and centre make Eqs. (1) and (2) true of these pixels, by trying all."""
    levels = image.astype(int)
    peak = max(levels[p] for p in pixels)
    for reach in REACHES_PX:
        for i, j in {(i + a, j + b) for i, j in pixels for a in (-1, 0, 1) for b in (-1, 0, 1)}:
            if not (reach <= i < image.shape[0] - reach and reach <= j < image.shape[1] - reach):
                continue
            if any((a - i) ** 2 + (b - j) ** 2 >= (reach - 0.5) ** 2 for a, b in pixels):
                continue
            ring = np.array([levels[i + a, j + b] for a, b in ring_steps(reach)])
            if reach == CUT_PX:
                most = min(np.roll(ring, -k)[ARC:].max() for k in range(len(ring)))
                rest = ring[ring <= most]
            else:
                rest = ring[ring <= np.sort(ring)[len(ring) - len(ring) // SPARE - 1]]
            m, b = rest.max(), rest.mean()
            least = {2: LIMITS.small_contrast_dn, 4: LIMITS.middle_contrast_dn}.get(reach, LIMITS.wide_contrast_dn)
            isolation = np.hypot(LIMITS.isolation * noise_of(m), LIMITS.texture * m)
            if peak - m < max(least, isolation, m - b) or abs(b - background) > 1e-9:
                continue
            if not any(is_a_point(levels, p, b) for p in pixels if levels[p] == peak):
                continue
            near = np.hypot(*(np.indices(image.shape) - np.array([i, j])[:, None, None])) ** 2 < (reach - 0.5) ** 2
            above = (levels > threshold) & (near if reach == CUT_PX else True)
            labels, _ = ndimage.label(above, np.ones((3, 3)))
            if set(zip(*np.nonzero(labels == labels[pixels[0]]), strict=True)) == set(pixels):
                return True
    return False


def test_the_pixels_of_every_ring_are_at_its_distance_and_close_it():
    for reach in REACHES_PX:
        steps = ring_steps(reach)
        ring = np.zeros((2 * reach + 3,) * 2, bool)
        ring[tuple(steps.T + reach + 1)] = True
        assert ndimage.label(~ring)[1] == 2  # inside and outside
        np.testing.assert_array_equal(ring, ring.T)
        distance = np.hypot(*steps.T)
        assert (np.abs(distance - reach) <= (0.5 if reach != CUT_PX else 0.83)).all()


@pytest.mark.parametrize("seed", range(40))
def test_every_spot_satisfies_the_definition_and_spots_do_not_overlap(seed):
    image = textured(seed, (70, 160))
    spots = find_spots(image, LIMITS)
    seen: set[tuple[int, int]] = set()
    for k in range(spots.runs.count):
        pixels = pixels_of(spots, k)
        assert satisfies_the_definition(image, spots.threshold_dn[k], spots.background_dn[k], pixels)
        peak = max(pixels, key=lambda p: image[p])
        assert peak not in seen
        seen |= set(pixels)


def test_spots_come_in_raster_order_of_their_first_pixel():
    spots = find_spots(textured(7, (200, 300)), LIMITS)
    runs = spots.runs
    first = list(zip(runs.row[runs.offset[:-1]], runs.start[runs.offset[:-1]], strict=True))
    assert len(first) > 5
    assert first == sorted(first)


@settings(max_examples=150, deadline=None)
@given(
    du=st.floats(-0.5, 0.5), dv=st.floats(-0.5, 0.5), sigma=st.sampled_from([0.5, 0.7, 1.0, 1.4]),
    contrast=st.floats(14.0, 230.0), background=st.floats(0.0, 15.0), column=st.integers(15, 145),
)  # fmt: skip
def test_a_lone_spot_on_an_even_background_is_found_wherever_it_lies(du, dv, sigma, contrast, background, column):
    spot = (column + du, 20 + dv, contrast / 0.6, sigma)  # the brightest pixel has at least 0.6 of a narrow one's peak
    image = digital(blurred((41, 161), [spot], background))
    spots = find_spots(image, LIMITS)
    assert spots.runs.count == 1
    rows, columns = np.array(pixels_of(spots, 0)).T
    assert abs(rows.mean() - spot[1]) < 0.6 and abs(columns.mean() - spot[0]) < 0.6


@pytest.mark.parametrize("radius", range(1, 11))
def test_clipped_discs_of_every_size_up_to_ten_pixels_are_found_whole(radius):
    for du, dv in ((0.0, 0.0), (0.3, 0.4), (0.5, -0.2)):
        rows, columns = np.indices((80, 90))
        disc = np.hypot(rows - 40 - dv, columns - 45 - du) <= radius
        spots = find_spots(np.where(disc, 255, 5).astype(np.uint8), LIMITS)
        assert spots.runs.count == 1
        assert spots.runs.area_px.tolist() == [disc.sum()]


def test_the_middle_is_come_nearer_to_by_column_and_row_twice():
    """Ellipse at 45 degrees, 2 : 1: a chord's middle is off by 0.6 of the chord's own offset, 0.6^4 of it is left."""
    down, right = np.indices((121, 121)) - 60
    ellipse = np.hypot((down + right) / 2.0, down - right) <= 40.0 * 2**0.5 / 2.0
    i, j = _middle(np.where(ellipse, 255, 5).astype(np.uint8), 75, 85, 128, 40)
    assert i - 60 == pytest.approx(25.0 * 0.6**3, abs=1.2)
    assert j - 60 == pytest.approx(25.0 * 0.6**4, abs=1.2)


@pytest.mark.parametrize(("tail", "rise"), [(0.05, 0.0), (0.15, 0.125), (0.27, 0.25), (0.45, 0.5), (0.6, None)])
def test_a_spot_is_cut_off_from_a_thin_tail_by_the_lowest_threshold_that_does_it(tail, rise):
    """Eq. (3): b + 0.1 (P - b), and from there by its rises towards P; a tail above the highest keeps it from being."""
    rows, columns = np.indices((80, 90))
    disc = np.hypot(rows - 40, columns - 45) <= 6.0
    image = np.where(disc, 205, np.where((rows == 40) & (columns > 45), round(5 + 200 * tail), 5)).astype(np.uint8)
    spots = find_spots(image, LIMITS)
    if rise is None:
        assert spots.runs.count == 0
        return
    assert spots.runs.area_px.tolist() == [disc.sum()]
    b = spots.background_dn[0]
    assert b == pytest.approx(5.0, abs=0.1)  # the tail is one of the pixels that are spared
    assert spots.threshold_dn[0] == int(b + (0.1 + 0.9 * rise) * (205.0 - b))


def test_a_disc_wider_than_the_widest_ring_is_no_spot():
    rows, columns = np.indices((100, 100))
    assert (
        find_spots(np.where(np.hypot(rows - 50, columns - 50) <= 16.0, 255, 5).astype(np.uint8), LIMITS).runs.count == 0
    )


@pytest.mark.parametrize("angle_deg", range(0, 180, 15))
@pytest.mark.parametrize("width", [1, 2, 3, 6, 12])
def test_ribs_edges_and_slopes_are_no_spots(angle_deg, width):
    """As a lens of PSF sigma 0.6 px shows them: the steps of an unblurred rib are a row of spots."""
    rows, columns = np.indices((120, 120)) - 59.5
    across = rows * np.cos(np.deg2rad(angle_deg)) - columns * np.sin(np.deg2rad(angle_deg))
    rib = 20.0 + 180.0 * np.clip(0.5 * width + 0.5 - np.abs(across), 0, 1)
    edge = 20.0 + 180.0 * np.clip(across / width + 0.5, 0, 1)
    slope = np.clip(120.0 + across * 2.0, 0, 255)
    for image in (rib, edge, slope):
        assert find_spots(digital(ndimage.gaussian_filter(image, 0.6)), LIMITS).runs.count == 0


def test_waves_have_no_spots_and_an_led_between_them_is_the_only_one():
    rows, columns = np.indices((150, 200))
    sea = 50.0 + 15.0 * np.sin(rows / 3.0) + 10.0 * np.sin(columns / 17.0)
    assert find_spots(digital(sea), LIMITS).runs.count == 0
    spots = find_spots(digital(blurred(sea.shape, [(90.2, 70.4, 80.0, 0.7)], sea)), LIMITS)
    assert spots.runs.count == 1
    assert (70, 90) in pixels_of(spots, 0)


def test_an_led_on_a_rib_and_one_two_pixels_from_a_canopy_are_found():
    rows, columns = np.indices((60, 120))
    rib = 20.0 + 30.0 * (np.abs(columns - 30) <= 1)
    canopy = 70.0 * (rows <= 27)
    image = digital(
        blurred(rib.shape, [(30.0, 30.0, 120.0, 0.7), (90.0, 30.0, 90.0, 0.6)], rib + canopy * (columns > 60))
    )
    found = [pixels_of(find_spots(image, LIMITS), k) for k in range(find_spots(image, LIMITS).runs.count)]
    assert len(found) == 2
    assert sorted((30, 30) in pixels for pixels in found) == [False, True]
    assert sorted((30, 90) in pixels for pixels in found) == [False, True]


def test_the_sun_s_veil_hides_no_led_that_stands_a_half_above_it():
    rng = np.random.default_rng(5)
    rows, columns = np.indices((200, 300))
    veil = 200.0 * 40.0 / np.hypot(np.hypot(rows - 100, columns - 20), 40.0)
    true = [(u, v) for u in range(100, 290, 40) for v in (40, 100, 160)]
    image = blurred(veil.shape, [(u + 0.3, v - 0.2, 45.0, 0.7) for u, v in true], veil)
    image = digital(image + np.sqrt(0.0187 * image + 0.06) * rng.normal(size=veil.shape))
    spots = find_spots(image, LIMITS)
    found = [set(pixels_of(spots, k)) for k in range(spots.runs.count)]
    assert len(found) == len(true)
    assert all(any((v, u) in pixels for pixels in found) for u, v in true)


@pytest.mark.parametrize(("reach", "radius"), [("small", 1.5), ("middle", 1.5), ("wide", 5.0)])
def test_a_reach_s_contrast_is_the_least_that_its_spots_have(reach, radius):
    """A disc of level 5 on 0, with none of the other reaches' contrasts: 5 is enough, and 5.1 is not."""
    rows, columns = np.indices((60, 90))
    disc = np.where(np.hypot(rows - 30, columns - 45) <= radius, 5, 0).astype(np.uint8)
    contrasts = {f"{name}_contrast_dn": 200.0 for name in ("small", "middle", "wide")}
    for contrast, count in ((5.0, 1), (5.1, 0)):
        limits = replace(LIMITS, **{**contrasts, f"{reach}_contrast_dn": contrast})
        assert find_spots(disc, limits).runs.count == count


@pytest.mark.parametrize("limit", ["detection", "beside", "share"])
def test_what_noise_may_not_make_begins_at_its_limit(limit):
    """Eq. (2) of a bright pixel with one that is nearly as bright beside it, on a ring that is uneven."""
    image = np.full((60, 90), 10, np.uint8)
    image[29:32, 44:47] = 12
    image[30, 45], image[30, 46] = 40, 38
    ring = ring_steps(4) + [30, 45]
    image[tuple(ring[ring[:, 1] < 45].T)] = 14
    b = image[tuple(ring.T)].mean()
    total = 4.0 * (40 - b) + 2.0 * (38 - b) + (3 * 2.0 + 4 * 1.0) * (12 - b)
    seven = total - 4.0 * (40 - b) - 2.0 * (38 - b)
    most = {
        "detection": total / 6.0 / noise_of(b),
        "beside": seven / 4.0 / noise_of(b),
        "share": seven / 4.0 / (40 - b),
    }
    for factor, count in ((0.99, 1), (1.01, 0)):
        others = {"detection": 6.0, "beside": 0.1, "share": 0.01, limit: factor * most[limit]}
        limits = replace(LIMITS, small_contrast_dn=200.0, wide_contrast_dn=200.0, **others)
        spots = find_spots(image, limits)
        assert sum((30, 45) in pixels_of(spots, k) for k in range(spots.runs.count)) == count


@pytest.mark.parametrize(("sides", "found"), [(1, True), (2, False)])
def test_a_brighter_surface_may_fill_one_side_of_the_smallest_ring_but_not_two(sides, found):
    """Five pixels of 100 two pixels from a peak of 60, or nine that lie at a corner's two sides."""
    image = np.full((60, 90), 5, np.uint8)
    image[:29] = 100
    if sides == 2:
        image[:, :45] = 100
    image[29:32, 45:48] = [[12, 25, 12], [25, 60, 25], [12, 25, 12]]
    spots = find_spots(image, LIMITS)
    assert any((30, 46) in pixels_of(spots, k) for k in range(spots.runs.count)) == found


@pytest.mark.parametrize("row", range(40, 44))
def test_a_dome_is_found_whole_from_whichever_of_its_rows_is_looked_at(row):
    """Every fourth row is: from two rows off it is two steps up to the peak."""
    rows, columns = np.indices((80, 90))
    distance = np.hypot(rows - row, columns - 45)
    dome = np.where(distance <= 10.0, np.rint(250.0 - distance**2), 5.0).astype(np.uint8)
    spots = find_spots(dome, LIMITS)
    assert spots.runs.area_px.tolist() == [(distance <= 10.0).sum()]


@pytest.mark.parametrize(("name", "reach", "radius"), [("small", 2, 1.5), ("middle", 4, 1.5), ("wide", 8, 5.0)])
def test_a_spot_s_ring_may_touch_the_frame_s_edge_and_not_leave_it(name, reach, radius):
    contrasts = {f"{other}_contrast_dn": 200.0 for other in ("small", "middle", "wide")}
    limits = replace(LIMITS, **{**contrasts, f"{name}_contrast_dn": 5.0})
    rows, columns = np.indices((60, 90))
    for edge in (0, 1):
        for i, j in ((reach - edge, 45), (59 - reach + edge, 45), (30, reach - edge), (30, 89 - reach + edge)):
            disc = np.where(np.hypot(rows - i, columns - j) <= radius, 80, 5).astype(np.uint8)
            assert find_spots(disc, limits).runs.count == 1 - edge


def test_the_table_of_runs_grows_with_what_is_put_into_it():
    """A board of 5 x 5 has 13 runs of one pixel, three times into a table of one row."""
    board = (np.indices((5, 5)).sum(axis=0) % 2 == 0).astype(np.uint8)
    table, n = np.empty((1, 3), np.int32), 0
    for top in (10, 20, 30):
        table, n = _append_runs(board, top, 7, 5, table, n)
    rows, columns = np.nonzero(board)
    expected = [(top + i, 7 + j, 8 + j) for top in (10, 20, 30) for i, j in zip(rows, columns, strict=True)]
    assert table[:n].tolist() == [list(run) for run in expected]


@pytest.mark.parametrize("width", [30, 100, 160])
def test_hits_are_the_pixels_that_stand_out_from_their_second_brightest_neighbour_at_a_distance(width):
    """13/16 x - n >= c, but for the rounding of 3/16 x to whole numbers, which is off by -1.5 to 0.5."""
    rng = np.random.default_rng(31)
    places = rng.uniform(0.0, 1.0, (60, 2)) * [width, 60]
    spots = [(u, v, rng.choice([10.0, 40.0, 150.0]), rng.choice([0.7, 1.5, 4.0])) for u, v in places]
    spots += [(0.3 * width, 57.0, 400.0, 0.5), (0.7 * width, 2.0, 400.0, 0.5)]  # in the last and the first row of all
    image = digital(blurred((60, width), spots, 3.0) + rng.normal(size=(60, width)))
    contrasts, x = (4, 2, 8, 8), image.astype(float)
    hits = find_hits(image, REACHES_PX, ROW_STEPS, contrasts, WIDE_PX)
    for k, (reach, step, contrast) in enumerate(zip(REACHES_PX, ROW_STEPS, contrasts, strict=True)):
        inside = np.zeros(image.shape, bool)
        inside[reach : 60 - reach : step, reach : width - reach] = True
        around = lambda d: np.sort([np.roll(x, s, axis) for s in (d, -d) for axis in (0, 1)], axis=0)  # noqa: E731
        n, beside = around(reach)[-2], np.maximum(np.roll(x, 1, 1), np.roll(x, -1, 1))
        if reach < WIDE_PX:
            inside &= (around(1)[-1] if step == 1 else beside) <= x
        i, j, second = hits[hits[:, 0] == k, 1:].T
        np.testing.assert_array_equal(second, n[i, j])
        found = np.zeros(image.shape, bool)
        found[i, j] = True
        assert len(i) == found.sum()
        certain, possible = (inside & (13.0 / 16.0 * x - n >= contrast + more) for more in (0.5, -1.5))
        assert (found | ~certain).all() and (possible | ~found).all()
        assert certain.any() or width == 30
        assert reach > 2 or (certain[57].any() and certain[2].any())


def test_a_peak_alone_is_no_spot():
    """Its neighbours are brighter than noise but under a tenth of it: above t there is one pixel."""
    image = np.full((40, 40), 3, np.uint8)
    image[18:21, 18:21] = 6
    image[19, 19] = 34
    assert find_spots(image, LIMITS).runs.count == 0
    image[19, 20] = 12
    assert find_spots(image, LIMITS).runs.area_px.tolist() == [2]


def test_noise_alone_makes_no_spot():
    """2.2 million pixels at each of three levels; normal noise is six standard deviations up in one of 1e9."""
    rng = np.random.default_rng(6)
    for level_e in (100.0, 2000.0, 8000.0):
        electrons = rng.normal(level_e, np.sqrt(level_e + 13.0**2), (1088, 2048))
        assert find_spots(digital(0.0187 * electrons), LIMITS).runs.count == 0


@pytest.mark.parametrize("seed", range(8))
def test_a_window_has_the_spots_of_the_frame_that_lie_well_inside_it(seed):
    """Windows of other widths are cut into other segments, and rows are stepped over from another first one."""
    image = textured(100 + seed, (180, 260))
    whole = find_spots(image, LIMITS)
    # a grid of rows that begins elsewhere meets the same small spots; wide ones are met, but from another side
    top, left = 12 * (1 + seed % 3), 7 * seed + 5  # 12 is a multiple of every step
    part = find_spots(image[top : top + 100, left : left + 61 + 9 * seed], LIMITS)
    inside = lambda pixels: all(  # noqa: E731
        top + 30 <= i < top + 70 and left + 30 <= j < left + 31 + 9 * seed for i, j in pixels
    )
    expected = [p for p in (pixels_of(whole, k) for k in range(whole.runs.count)) if inside(p)]
    shifted = [[(i + top, j + left) for i, j in pixels_of(part, k)] for k in range(part.runs.count)]
    assert [p for p in shifted if inside(p)] == expected


def test_sixteen_bit_words_have_the_same_spots():
    image = textured(11, (120, 200))
    a, b = find_spots(image, LIMITS), find_spots(image.astype(np.uint16), LIMITS)
    assert a.runs.count > 0
    for field in ("row", "start", "stop", "offset"):
        np.testing.assert_array_equal(getattr(a.runs, field), getattr(b.runs, field))
    np.testing.assert_array_equal(a.threshold_dn, b.threshold_dn)


@pytest.mark.parametrize("shape", [(0, 0), (0, 9), (1, 1), (4, 200), (200, 4), (9, 9), (29, 29)])
def test_images_too_small_for_a_ring_have_no_spots(shape):
    assert find_spots(np.full(shape, 200, np.uint8), LIMITS).runs.count == 0
