"""The ring that a prediction names, against the search that it saves and against the truth."""

from dataclasses import replace
from math import comb

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.identify import ring
from dockair.nav.identify.chance import densities_px2, log10_false_rings, member_odds
from dockair.nav.identify.followed import _chances, _roll_and_radius, _shape_error, followed_ring
from dockair.nav.identify.perspective import fit_ring
from dockair.nav.identify.prior import make_prior, ring_from_leds
from dockair.nav.identify.ring import IdentificationStatus, IdentifySettings, identify
from dockair.rotations import matrix_from_yaw_pitch_roll

CAMERA, SETTINGS, SIGMA_PX = Camera(), IdentifySettings(), 0.1
CENTRE, RADIUS = np.array([900.0, 500.0]), 100.0


def leds(scale=1.0, turn_rad=0.0, visible=range(8), squeeze=1.0):
    """A frontal ring by the convention; squeezed along u it looks tilted."""
    angle = np.array(list(visible)) * np.pi / 4 + turn_rad
    return CENTRE - scale * RADIUS * np.column_stack([squeeze * np.cos(angle), np.sin(angle)])


def followed(blobs, predicted=None, sigma_px=1.0, flux=None, roll_rad=None, camera=CAMERA, settings=SETTINGS):
    predicted = leds() if predicted is None else predicted
    return followed_ring(blobs, flux, predicted, sigma_px, roll_rad, camera, SIGMA_PX, settings)


def searched(monkeypatch, *arguments, **expected):
    with monkeypatch.context() as patch:
        patch.setattr(ring, "followed_ring", lambda *_: None)
        return identify(*arguments, **expected)


@pytest.mark.parametrize("flux", [False, True])
@pytest.mark.parametrize(("visible", "clutter"), [(8, 0), (8, 4), (7, 3), (6, 2)])
def test_what_it_names_the_search_names_alike_and_the_truth_too(visible, clutter, flux, ring_scene, monkeypatch):
    """Clutter lies about the ring. At nine named of ten, fewer than 30 of 40 happen once in 300."""
    rng = np.random.default_rng(100 * visible + clutter)
    said = 0
    for _ in range(40):
        scene = ring_scene(rng, visible=visible, clutter=clutter)
        sigma_px = 0.01 * scene.radius_px
        predicted = scene.led_px + rng.normal(0.0, sigma_px, 2)
        brightness = np.exp(rng.normal(5.0, 0.3, len(scene.points))) if flux else None
        ours = followed(scene.points, predicted, sigma_px, brightness)
        if ours is None:
            continue
        said += 1
        theirs = searched(
            monkeypatch, scene.points, brightness=brightness, expected_led_px=predicted, expected_sigma_px=sigma_px
        )
        assert theirs.status is IdentificationStatus.FOUND and theirs.absolute
        np.testing.assert_array_equal(ours.members, theirs.members)
        np.testing.assert_array_equal(ours.led_numbers, theirs.led_numbers)
        np.testing.assert_array_equal(scene.numbers[ours.members], ours.led_numbers)
        room_px = SETTINGS.ring_sigma * scene.radius_px  # two mirror images may fit alike: either is taken
        np.testing.assert_allclose(ours.led_pixels_px, theirs.led_pixels_px, atol=room_px)
        np.testing.assert_allclose(ours.centre_px, theirs.centre_px, atol=room_px)
        assert ours.radius_px == pytest.approx(theirs.radius_px, abs=room_px)
        assert ours.roll_rad == pytest.approx(theirs.roll_rad, abs=SETTINGS.ring_sigma)
    assert said >= 30


def test_clutter_close_to_an_led_never_takes_its_name():
    """A blob 3 to 50 % of the radius from an LED: either the LED keeps its name or nothing is said."""
    rng = np.random.default_rng(1)
    named = 0
    for _ in range(300):
        away, direction = RADIUS * rng.uniform(0.03, 0.5), rng.uniform(0.0, 2.0 * np.pi)
        extra = leds()[rng.integers(8)] + away * np.array([np.cos(direction), np.sin(direction)])
        found = followed(np.vstack([leds() + rng.normal(0.0, 0.1, (8, 2)), extra]), leds() + rng.normal(0.0, 1.0, 2))
        if found is not None:
            named += 1
            np.testing.assert_array_equal(found.members, np.arange(8))
    assert named > 150


@pytest.mark.parametrize(
    ("what", "blobs"),
    [
        ("a second blob in an LED's place", np.vstack([leds(), leds()[2] + [4.0, 0.0]])),
        (
            "two blobs near the ring that are no members",
            np.vstack([leds(), leds()[2] + [12.0, 0], leds()[5] - [12.0, 0]]),
        ),
        ("five LEDs", leds(visible=range(5))),
        ("a ring a tenth larger", leds(scale=1.1)),
        ("a ring turned by ten degrees", leds(turn_rad=np.deg2rad(10.0))),
        ("another tilt", leds(squeeze=0.951)),  # 2.45 px out of shape, 4.9 px off: the first is too much
        ("an LED off by two tolerances", leds() + np.where(np.arange(8)[:, None] == 3, [1.5, 0.0], 0.0)),
        ("a crowd", np.vstack([leds(), CENTRE + np.random.default_rng(2).uniform(-40.0, 40.0, (20, 2))])),
        ("nothing", np.empty((0, 2))),
    ],
)
def test_nothing_is_said_of(what, blobs):
    assert followed(leds()) is not None
    assert followed(blobs) is None, what


def test_nothing_is_said_where_the_prediction_is_poor_or_the_roll_another():
    assert followed(leds(), sigma_px=2.0) is not None
    assert followed(leds(), sigma_px=2.1) is None  # five of them are a tenth of the radius
    assert followed(leds(), roll_rad=np.deg2rad(7.0)) is not None
    assert followed(leds(), roll_rad=np.deg2rad(45.0)) is None
    assert followed(leds(), roll_rad=np.nan) is not None
    turned = leds(turn_rad=3.13)
    assert followed(turned, turned, roll_rad=-3.13) is not None  # to both sides of half a turn, 1.3 degrees apart


def test_a_prediction_off_as_a_whole_is_moved_to_the_ring_as_far_as_its_sigma_lets_it():
    found = followed(leds(), leds() + [8.0, 0.0], sigma_px=2.0)
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    assert followed(leds(), leds() + [8.0, 0.0], sigma_px=0.5) is None


@pytest.mark.parametrize(("off_px", "is_said"), [(4.5, True), (5.5, False)])
def test_a_ring_may_be_off_by_five_sigma_and_two_per_cent_of_its_largest_radius(off_px, is_said):
    """Half a pixel of sigma, and a radius of 100 px that may be a quarter larger: 2.5 px each."""
    assert (followed(leds(), leds() + [0.0, off_px], sigma_px=0.5) is not None) == is_said


@pytest.mark.parametrize(("tilt_deg", "is_said"), [(38.0, True), (43.0, False)])
def test_a_ring_predicted_to_be_tilted_too_much_is_left_to_the_search(tilt_deg, is_said):
    R_CD = matrix_from_yaw_pitch_roll(np.deg2rad(tilt_deg), 0.0, 0.0)
    tilted = CAMERA.pixels_from_points(LedRing().positions_D @ R_CD.T + [7.0, 0.0, 0.0])
    assert (followed(tilted, tilted) is not None) == is_said


@pytest.mark.parametrize(("away_px", "is_said"), [(30.0, False), (40.0, True)])
def test_two_blobs_may_be_another_ring_s_as_far_from_a_place_as_ring_and_prediction_may_be_off(away_px, is_said):
    """A fifth of the radius, and twice 7.5 px by which the centres may differ."""
    inward = (CENTRE - leds()[[1, 6]]) / RADIUS
    assert (followed(np.vstack([leds(), leds()[[1, 6]] + away_px * inward])) is not None) == is_said


@pytest.mark.parametrize(("radii", "is_said"), [(1.55, False), (1.75, True)])
def test_blobs_count_as_far_as_the_largest_ring_s_near_side_reaches(radii, is_said):
    """A quarter more of a radius a quarter larger, and 7.5 px: 1.64 radii, within which 25 blobs are a crowd."""
    angle = np.linspace(0.1, 6.2, 17)
    crowd = CENTRE + radii * RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    assert (followed(np.vstack([leds(), crowd])) is not None) == is_said


def test_a_shape_may_be_off_by_two_per_cent_and_four_sigma():
    """By 2.25 px: of 100 px the one is 2, of 0.1 px the other 0.4."""
    assert followed(leds(squeeze=0.955)) is not None
    assert followed(leds(squeeze=0.955), settings=replace(SETTINGS, predicted_shape_sigmas=0.1)) is None


def test_accidents_and_impostors_are_weighed_by_what_is_allowed_of_a_predicted_ring():
    """Eq. (1) at 42 hypotheses of every three of ten blobs, to ten per cent."""
    blobs = np.vstack([leds(), CENTRE + [[10.0, 20.0], [-30.0, 5.0]]])
    fit = fit_ring(
        blobs, np.arange(8), CAMERA.focal_length_px, CAMERA.principal_point_px,
        tolerance_px=0.4, tolerance_per_radius=4.0 * SETTINGS.ring_sigma,
    )  # fmt: skip
    accident, impostor = densities_px2(blobs, fit)
    rings = 10.0 ** float(log10_false_rings(42 * comb(10, 3), 8, accident * np.pi * fit.tolerance_px**2))
    impostors = float(member_odds(blobs, fit, impostor, 4.0).sum())
    for allowed, number in (("max_false_rings_predicted", rings), ("max_impostors_with_prior", impostors)):
        for share, is_said in ((1.1, True), (0.9, False)):
            settings = replace(SETTINGS, **{allowed: share * number})
            assert (followed(blobs, settings=settings) is not None) == is_said, allowed


@pytest.mark.parametrize(("visible", "clutter"), [(8, 0), (8, 9), (7, 2), (6, 5)])
def test_what_it_counts_of_chance_and_of_a_prediction_is_what_chance_and_prior_count(visible, clutter, ring_scene):
    scene = ring_scene(np.random.default_rng(visible), visible=visible, clutter=clutter, clutter_box_radii=1.8)
    slots = np.full(8, -1)
    slots[scene.numbers[scene.numbers >= 0]] = np.flatnonzero(scene.numbers >= 0)
    fit = fit_ring(
        scene.points, slots, CAMERA.focal_length_px, CAMERA.principal_point_px, tolerance_px=1.0, tolerance_per_radius=0
    )
    beyond = np.vstack([[np.nan, 0.0], scene.points, [5000.0, 0.0]])  # neither within reach
    inside = np.arange(len(beyond)) % (len(beyond) - 1) > 0
    n, m, p, odds = _chances(
        beyond, inside, np.where(fit.candidate < 0, -1, fit.candidate + 1), fit.slots_px, fit.centre_px, fit.radius_px,
        1.0, 0.25**2,
    )  # fmt: skip
    accident, impostor = densities_px2(scene.points, fit)
    assert (n, m, p) == (len(scene.points), fit.count, pytest.approx(accident * np.pi))
    np.testing.assert_allclose(odds, member_odds(scene.points, fit, impostor, 4.0))

    _, radius_px, roll_rad = ring_from_leds(scene.led_px)
    assert _roll_and_radius(scene.led_px) == pytest.approx((roll_rad, radius_px))
    other = np.ascontiguousarray(scene.led_px @ np.array([[1.02, 0.1], [-0.08, 0.97]]))
    prior, seen = make_prior((1.0, 1e3), 1.0, 0.1, None, None, None, other, 1.0), np.flatnonzero(slots >= 0)
    error_px = prior.shape_error_px(scene.points[slots[seen]], seen)
    assert _shape_error(scene.points, slots, other) == pytest.approx(error_px) and error_px > 0.01


def test_scale_and_roll_are_held_to_the_settings():
    blobs = leds(scale=1.04, turn_rad=0.02)
    assert followed(blobs) is not None
    assert followed(blobs, settings=replace(SETTINGS, predicted_radius_tolerance=0.03)) is None
    assert followed(blobs, settings=replace(SETTINGS, predicted_roll_tolerance_rad=0.01)) is None


def test_a_member_as_bright_as_no_led_makes_the_ring_doubtful():
    """One blob a hundred times fainter is an LED at odds that the search's own count has to settle."""
    flux = np.full(8, 100.0)
    assert followed(leds(), flux=flux) is not None
    blobs = leds() + np.where(np.arange(8)[:, None] == 3, [0.9, 0.0], 0.0)
    assert followed(blobs, flux=flux) is not None
    assert followed(blobs, flux=np.where(np.arange(8) == 3, 1.0, flux)) is None


def test_brightness_is_of_the_blobs_within_reach_of_the_ring():
    """Three faint ones far away come first, so that the places among all blobs and among those within reach differ."""
    blobs = leds() + np.where(np.arange(8)[:, None] == 3, [0.9, 0.0], 0.0)
    flux = np.append([1.0, 1.0, 1.0], np.full(8, 100.0))
    found = followed(np.vstack([CENTRE + [[600.0, 0.0], [0.0, 400.0], [-600.0, 0.0]], blobs]), flux=flux)
    np.testing.assert_array_equal(found.members, np.arange(3, 11))


def test_a_distorted_camera_s_ring_is_named_and_its_places_distorted():
    camera = Camera(distortion=(-0.1, 0.02, 1e-4, -1e-4, 0.0))
    rays = np.column_stack([np.ones(8), -(leds() + [700.0, 300.0] - np.array(camera.principal_point_px)) / 2909.1])
    seen = camera.pixels_from_points(rays)
    found = followed(seen, seen, camera=camera)
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    np.testing.assert_allclose(found.led_pixels_px, seen, atol=0.02)
    middle = -(CENTRE + [700.0, 300.0] - np.array(camera.principal_point_px)) / 2909.1
    np.testing.assert_allclose(found.centre_px, camera.pixels_from_points(np.array([[1.0, *middle]]))[0], atol=0.02)


def test_blobs_that_are_not_finite_are_passed_over():
    found = followed(np.vstack([[np.nan, 1.0], leds(), [np.inf, 2.0]]))
    np.testing.assert_array_equal(found.members, np.arange(1, 9))


def test_identification_takes_the_short_way_and_a_coded_ring_the_search():
    """The search alone looks for an ellipse."""
    expected = {"expected_led_px": leds(), "expected_sigma_px": 1.0}
    assert identify(leds(), **expected).ellipse is None
    coded = LedRing(brightness=(2.0, 2.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0))
    assert identify(leds(), ring=coded, **expected).ellipse is not None
    assert identify(leds(), expected_radius_px=RADIUS, **expected).ellipse is not None
