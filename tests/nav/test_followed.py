"""The ring that a prediction names, against the search that it saves and against the truth."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.identify import ring
from dockair.nav.identify.followed import followed_ring
from dockair.nav.identify.ring import IdentificationStatus, IdentifySettings, identify

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


def test_a_distorted_camera_s_ring_is_named_and_its_places_distorted():
    camera = Camera(distortion=(-0.1, 0.02, 1e-4, -1e-4, 0.0))
    rays = np.column_stack([np.ones(8), -(leds() + [700.0, 300.0] - np.array(camera.principal_point_px)) / 2909.1])
    seen = camera.pixels_from_points(rays)
    found = followed(seen, seen, camera=camera)
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    np.testing.assert_allclose(found.led_pixels_px, seen, atol=0.02)


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
