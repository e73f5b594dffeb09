from dataclasses import replace

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.image.binarise import frame_statistics
from dockair.nav.image.centroid import NoiseModel, measure_blobs
from dockair.nav.image.detect import DetectSettings, detect
from dockair.nav.image.labelling import foreground_runs


def ring_spots(centre, radius, electrons):
    angle = np.arange(8) * np.pi / 4
    return [(centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a), electrons) for a in angle]


def match(blobs, spots):
    """Largest distance from a spot to its nearest blob [px]."""
    true = np.array([s[:2] for s in spots])
    return max(np.hypot(*(blobs.centroids_px - p).T).min() for p in true)


METHODS = pytest.mark.parametrize("settings", [DetectSettings(), DetectSettings(method="frame")])


@METHODS
@pytest.mark.parametrize(("radius", "electrons"), [(24, 1.2e4), (60, 3e4), (200, 2e5), (330, 1e6)])
def test_a_ring_is_eight_blobs_at_every_range(render, radius, electrons, settings):
    spots = ring_spots((400.3, 360.7), radius, electrons)
    blobs = detect(render((720, 800), spots, np.random.default_rng(radius)), settings)
    assert len(blobs) == 8
    assert match(blobs, spots) < 0.15


@METHODS
def test_a_far_led_of_four_pixels_survives(settings):
    image = np.full((60, 60), 2, np.uint8)
    image[30:32, 30:32] = 70
    blobs = detect(image, settings)
    np.testing.assert_allclose(blobs.centroids_px, [[30.5, 30.5]])
    assert blobs.area_px.tolist() == [4]


@METHODS
def test_hot_pixels_streaks_and_the_sun_are_no_leds(render, settings):
    rng = np.random.default_rng(9)
    spots = ring_spots((150, 150), 60, 3e4)
    image = render((400, 400), spots, rng)
    image[20, 20] = image[300, 30] = 255  # hot pixels
    image[350, 100:300] = 120  # streak
    rows, columns = np.indices(image.shape)
    image[(rows - 320) ** 2 + (columns - 320) ** 2 < 13.5**2] = 255  # 27 px disc
    blobs = detect(image, settings)
    assert len(blobs) == 8
    assert match(blobs, spots) < 0.05


@METHODS
def test_a_frame_of_noise_has_no_blobs(render, settings):
    for seed, background in enumerate((0.0, 100.0, 2000.0)):
        assert (
            len(detect(render((1088, 2048), [], np.random.default_rng(seed), background_e=background), settings)) == 0
        )


def test_a_window_gives_the_full_frame_s_centroids(render):
    spots = ring_spots((500, 400), 80, 3e4)
    full = render((700, 900), spots, np.random.default_rng(10))
    window = Window(row_start=290, row_stop=510, column_start=395, column_stop=605)
    part = detect(full[290:510, 395:605], None, window)
    whole = detect(full)
    assert len(part) == len(whole) == 8
    # the threshold comes from each one's own statistics, hence the pixels that belong to a blob may differ
    np.testing.assert_allclose(part.centroids_px, whole.centroids_px, atol=0.01)


def test_ten_bit_frames_in_sixteen_bit_words_give_the_same_centres(render):
    image = render((200, 200), ring_spots((100, 100), 50, 3e4), np.random.default_rng(11))
    wide = image.astype(np.uint16) * 4
    settings = DetectSettings(
        spot_contrast_dn=8.0,
        middle_spot_contrast_dn=16.0,
        wide_spot_contrast_dn=192.0,
        min_contrast_dn=32.0,
        max_contrast_dn=160.0,
        gain_dn_per_electron=4 * 255 / 13500,
        noise_dn=1.0,
        saturation_dn=1020,
    )
    a, b = detect(image), detect(wide, settings)
    np.testing.assert_allclose(b.centroids_px, a.centroids_px, atol=0.02)
    np.testing.assert_array_equal(b.clipped, a.clipped)


@pytest.mark.parametrize(("method", "areas"), [("local", [50]), ("frame", [25, 25])])
def test_connectivity_is_a_frame_s_and_spots_always_have_eight_neighbours(method, areas):
    """Two squares of 5 x 5 pixels that touch at a corner; four neighbours make two of them."""
    image = np.full((80, 90), 5, np.uint8)
    image[30:35, 30:35] = image[35:40, 35:40] = 255
    assert detect(image, DetectSettings(method=method, connectivity=4)).area_px.tolist() == areas
    assert detect(image, DetectSettings(method=method)).area_px.tolist() == [50]


def test_a_fixed_threshold_is_taken_as_it_is(render):
    image = render((100, 100), [(50.0, 50.0, 2e4)], np.random.default_rng(12))
    assert detect(image, DetectSettings(threshold_dn=60)).threshold_dn == 60
    assert len(detect(image, DetectSettings(threshold_dn=250))) == 0
    assert detect(image[:0], DetectSettings(threshold_dn=60)).threshold_dn == 60


def test_the_frame_s_gain_sets_the_shot_noise(render):
    image = render((100, 100), [(50.0, 50.0, 2e4)], np.random.default_rng(13))
    settings = DetectSettings(sigma_floor_px=0.0)
    quiet, loud = (detect(image, settings, gain_dn_per_electron=g).sigma_px[0] for g in (0.0, 1.0))
    assert loud > 3.0 * quiet


def test_a_reversed_view_of_a_frame_is_detected_like_its_copy(render):
    image = render((150, 150), ring_spots((70, 80), 40, 3e4), np.random.default_rng(14))[::-1, ::-1]
    np.testing.assert_array_equal(detect(image).centroids_px, detect(image.copy()).centroids_px)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((0, 0), np.uint8),
        np.zeros((5, 0), np.uint8),
        np.zeros((1, 1), np.uint8),
        np.full((50, 70), 255, np.uint8),
        np.full((3, 2000), 65535, np.uint16),
    ],
)
def test_frames_without_contrast_have_no_blobs(image):
    assert len(detect(image)) == 0
    assert detect(image).centroids_px.shape == (0, 2)


def test_random_frames_give_finite_blobs_of_allowed_area():
    rng = np.random.default_rng(15)
    for _ in range(300):
        shape = rng.integers(1, 40, 2)
        image = (rng.random(shape) ** rng.uniform(0.2, 8.0) * 255).astype(np.uint8)
        blobs = detect(image)
        assert np.isfinite(blobs.centroids_px).all() and np.isfinite(blobs.sigma_px).all()
        assert ((blobs.area_px >= 2) & (blobs.area_px <= 400)).all()
        assert (blobs.sigma_px > 0).all()


def test_wrong_images_and_settings_are_refused():
    with pytest.raises(DockairError, match="dtype"):
        detect(np.zeros((4, 4)))
    with pytest.raises(DockairError, match="rows, columns"):
        detect(np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(DockairError, match="window"):
        detect(np.zeros((4, 4), np.uint8), None, Window(0, 5, 0, 4))
    with pytest.raises(DockairError, match="min_area_px"):
        DetectSettings(min_area_px=500)
    with pytest.raises(DockairError, match="method"):
        DetectSettings(method="global")
    with pytest.raises(DockairError, match="centroid"):
        DetectSettings(centroid="best")


@pytest.mark.parametrize("limit", ["spot_isolation", "texture", "spot_detection", "spot_beside", "spot_share"])
def test_a_limit_of_spots_is_that_of_their_equations_with_the_frame_s_own_gain(limit):
    """A pixel of 140 with one of 138 beside it on an even 100, all others at nought: a hundredth more is too much."""
    image = np.full((60, 90), 100, np.uint8)
    image[29:32, 44:47] = 102
    image[30, 45], image[30, 46] = 140, 138
    s = np.sqrt(0.005 * 100.0 + 0.25**2 + 1.0 / 12.0)
    seven = (3 * 2.0 + 4 * 1.0) * 2.0
    most = {
        "spot_isolation": 40.0 / s,
        "texture": 40.0 / 100.0,
        "spot_detection": (4.0 * 40.0 + 2.0 * 38.0 + seven) / 6.0 / s,
        "spot_beside": seven / 4.0 / s,
        "spot_share": seven / 4.0 / 40.0,
    }
    for factor, count in ((0.99, 1), (1.01, 0)):
        settings = DetectSettings(**{**dict.fromkeys(most, 1e-3), limit: factor * most[limit]})
        assert len(detect(image, settings, gain_dn_per_electron=0.005)) == count


def point(peak: int = 105) -> np.ndarray:
    """A point whose light is four times that of its brightest pixel above the background of 5."""
    image = np.full((60, 90), 5, np.uint8)
    above = peak - 5
    image[29:32, 44:47] = 5 + above * np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]]) // 4
    return image


@pytest.mark.parametrize(("widest", "count"), [(3.99, 0), (4.01, 1)])
def test_a_spot_that_is_not_clipped_has_at_most_the_light_that_is_allowed_to_its_peak(widest, count):
    settings = DetectSettings(max_equivalent_area_px=widest)
    assert len(detect(point(), settings)) == count
    assert len(detect(point(), replace(settings, method="frame"))) == 1  # all that is asked of a frame's is their area
    assert len(detect(point(), replace(settings, saturation_dn=105))) == 1


@pytest.mark.parametrize(("longest", "count"), [(2.99, 0), (3.01, 1)])
def test_a_row_of_three_pixels_is_three_times_as_long_as_wide(longest, count):
    image = np.full((60, 90), 5, np.uint8)
    image[30, 44:47] = 105
    assert len(detect(image, DetectSettings(threshold_dn=50, max_elongation=longest))) == count


def test_one_area_may_be_both_the_least_and_the_largest():
    image = np.zeros((60, 90), np.uint8)
    for n in (1, 2, 3):
        image[20 * n - 10 : 20 * n - 10 + n, 40:42] = 105
    settings = DetectSettings(threshold_dn=50, min_area_px=4, max_area_px=4)
    assert detect(image, settings).area_px.tolist() == [4]


@pytest.mark.parametrize("peak", [105, 255])
@pytest.mark.parametrize("windowed", [True, False])
@pytest.mark.parametrize("local_background", [True, False])
def test_blobs_are_measured_with_the_noise_that_the_settings_and_the_frame_say(peak, windowed, local_background):
    image = point(peak) + np.random.default_rng(21).integers(0, 3, (60, 90)).astype(np.uint8)
    image[30, 45] = peak
    settings = DetectSettings(
        threshold_dn=20, local_background=local_background, centroid="windowed" if windowed else "weighted",
        noise_dn=0.7, response_spread=0.03, sigma_floor_px=0.002, clipped_sigma_floor_px=0.02,
    )  # fmt: skip
    noise = NoiseModel(
        gain_dn_per_electron=0.05, noise_dn=np.sqrt(0.7**2 + 1.0 / 12.0), saturation_dn=255, floor_px=0.002,
        clipped_floor_px=0.02, response_spread=0.03,
    )  # fmt: skip
    expected = measure_blobs(
        image, foreground_runs(image, 20), 20, noise, background_dn=frame_statistics(image).background_dn,
        local_background=local_background, windowed=windowed,
    )  # fmt: skip
    blobs = detect(image, settings, gain_dn_per_electron=0.05)
    assert blobs.clipped.tolist() == [peak == 255]
    for field in ("centroids_px", "sigma_px", "flux", "peak", "clipped"):
        np.testing.assert_array_equal(getattr(blobs, field), getattr(expected, field))


def test_leds_before_a_bright_uneven_background_are_found_by_their_surroundings_alone(render):
    """A veil from 10 to 110 DN: one threshold is above the LEDs on one side or below the veil on the other."""
    spots = ring_spots((300, 150), 100, 8e3)
    veil_e = np.linspace(500.0, 6000.0, 600)[None] * np.ones((300, 1))
    image = render((300, 600), spots, np.random.default_rng(16), background_e=veil_e)
    blobs = detect(image)
    assert len(blobs) == 8
    assert match(blobs, spots) < 0.15
    assert match(detect(image, DetectSettings(method="frame")), spots) > 5.0


def test_a_spot_s_threshold_is_reported_and_lies_between_background_and_peak(render):
    blobs = detect(render((200, 200), ring_spots((100, 100), 60, 3e4), np.random.default_rng(17)))
    assert (blobs.thresholds_dn > 5).all() and (blobs.thresholds_dn < blobs.peak).all()
    assert blobs.threshold_dn == blobs.thresholds_dn.min()
    assert detect(np.zeros((9, 9), np.uint8)).threshold_dn == -1


@pytest.mark.parametrize("local_background", [True, False])
def test_what_is_dropped_for_its_area_changes_nothing_of_what_is_said_of_others(local_background):
    """A disc of 69 pixels before a spot on a brighter background, where 40 pixels are allowed."""
    settings = DetectSettings(max_area_px=40, local_background=local_background)
    rows, columns = np.indices((60, 120))
    spot = 40.0 + 90.0 * np.exp(-((columns - 95.3) ** 2 + (rows - 40.2) ** 2) / (2 * 0.7**2))
    alone = np.rint(np.where(columns < 60, 5.0, spot)).astype(np.uint8)
    beside = np.where(np.hypot(columns - 25, rows - 15) <= 4.6, 255, alone).astype(np.uint8)
    assert len(detect(beside)) == 2
    one, other = detect(alone, settings), detect(beside, settings)
    assert len(one) == len(other) == 1
    for field in ("centroids_px", "area_px", "peak", "sigma_px", "clipped", "flux", "thresholds_dn", "threshold_dn"):
        np.testing.assert_array_equal(getattr(other, field), getattr(one, field))


@pytest.mark.parametrize(("dtype", "clipped"), [(np.uint8, True), (np.uint16, False)])
def test_a_pixel_is_clipped_at_the_largest_level_of_its_own_word(dtype, clipped):
    rows, columns = np.indices((40, 40))
    image = np.rint(5.0 + 250.0 * np.exp(-((columns - 20) ** 2 + (rows - 20) ** 2) / (2 * 0.7**2))).astype(dtype)
    assert image.max() == 255
    assert detect(image).clipped.tolist() == [clipped]


def test_gaps_in_cloud_are_dropped_by_their_softness_and_an_led_before_them_is_kept():
    """Gaussians of sigma 1.8 px: flux over peak is 2 pi sigma^2 = 20 pixels, where 7 are allowed."""
    rng = np.random.default_rng(18)
    rows, columns = np.indices((200, 300))
    gaps = [(u, v) for u in range(30, 280, 40) for v in range(30, 180, 40)]
    image = 20.0 + sum(40.0 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 1.8**2)) for u, v in gaps)
    image += 60.0 * np.exp(-((columns - 130.3) ** 2 + (rows - 91.2) ** 2) / (2 * 0.7**2))
    image = np.rint(image + rng.normal(0.0, 0.8, image.shape)).astype(np.uint8)
    assert len(detect(image, DetectSettings(max_equivalent_area_px=100.0))) > len(gaps) / 2
    blobs = detect(image)
    assert len(blobs) == 1
    np.testing.assert_allclose(blobs.centroids_px, [[130.3, 91.2]], atol=0.05)


def test_pairs_of_hot_pixels_are_no_leds():
    rng = np.random.default_rng(19)
    image = np.rint(rng.normal(3.2, 0.45, (500, 900))).clip(0, 255).astype(np.uint8)
    places = [(i, j) for i in range(10, 490, 12) for j in range(10, 880, 12)]
    for i, j in places:
        image[i, j] = rng.integers(6, 256)
        image[i + rng.integers(0, 2), j + 1] = rng.integers(6, 256)
    assert len(detect(image)) < 0.005 * len(places)  # faint ones, under 10 DN, of which noise makes a third pixel


@pytest.mark.parametrize(("ratio", "least"), [(8.0, 0.35), (12.0, 0.85), (18.0, 0.99)])
def test_leds_are_found_as_their_ratio_of_signal_to_noise_allows(ratio, least):
    """Gaussian spots of sigma 0.65 px at random phases in the noise of 14 us; the ratio is the matched filter's.

    Noise is 0.35 DN before rounding, which adds 1/12 DN^2; of 400 LEDs a share of 0.85 has a standard error of 0.018.
    """
    rng = np.random.default_rng(20)
    x, image = np.arange(820), np.full((820, 820), 3.2)
    places = np.array([(20 + 40 * k, 20 + 40 * m) for k in range(20) for m in range(20)])
    true = places + rng.uniform(-0.5, 0.5, (400, 2))
    for u, v in true:
        spot = np.outer(*(np.exp(-((x[int(c) - 8 : int(c) + 9] - c) ** 2) / (2 * 0.65**2)) for c in (v, u)))
        spot *= ratio * np.hypot(0.35, 12**-0.5) / np.linalg.norm(spot)
        image[int(v) - 8 : int(v) + 9, int(u) - 8 : int(u) + 9] += spot
    blobs = detect(np.rint(image + rng.normal(0.0, 0.35, image.shape)).astype(np.uint8))
    near = np.linalg.norm(blobs.centroids_px[:, None] - true[None], axis=2) < 2.0
    assert near.any(axis=0).mean() >= least
    assert (~near.any(axis=1)).sum() <= 1
