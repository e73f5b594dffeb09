"""What must hold of an identification whatever the candidates are: order, place, turn, and rubbish."""

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.identify.ring import METHODS, IdentificationStatus, IdentifySettings, identify

FOUND = IdentificationStatus.FOUND
CAMERA = Camera()
both_methods = pytest.mark.parametrize("method", METHODS)
one_class = [HealthCheck.function_scoped_fixture]  # `ring_scene` is the same class for every example
scenes = given(seed=st.integers(0, 10**6), visible=st.integers(4, 8), clutter=st.integers(0, 20), near=st.booleans())


def named(result):
    """Status and LED number of each candidate that has one."""
    return result.status, dict(zip(result.members.tolist(), result.led_numbers.tolist(), strict=True))


@both_methods
@scenes
@settings(max_examples=60, deadline=None, suppress_health_check=one_class)
def test_the_order_of_the_candidates_does_not_matter(method, ring_scene, seed, visible, clutter, near):
    """With and without brightness and prediction: the same LEDs, the same numbers, the same ring to the last bit."""
    rng = np.random.default_rng(seed)
    scene = ring_scene(rng, visible=visible, clutter=clutter, clutter_box_radii=1.5 if near else None)
    brightness = rng.uniform(1.0, 10.0, len(scene.points)) if rng.random() < 0.5 else None
    expected = {}
    if rng.random() < 0.5:
        expected = {"expected_led_px": scene.led_px + rng.normal(0.0, 4.0, 2), "expected_sigma_px": 4.0}
    first = identify(scene.points, method, brightness=brightness, **expected)
    order = rng.permutation(len(scene.points))
    flux = None if brightness is None else brightness[order]
    second = identify(scene.points[order], method, brightness=flux, **expected)
    assert second.status is first.status
    np.testing.assert_array_equal(order[second.members], first.members)
    np.testing.assert_array_equal(second.led_numbers, first.led_numbers)
    np.testing.assert_array_equal(second.led_pixels_px, first.led_pixels_px)


@both_methods
@given(seed=st.integers(0, 10**6), turns=st.integers(1, 7))
@settings(max_examples=40, deadline=None, suppress_health_check=one_class)
def test_an_image_turned_by_some_eighths_about_the_optical_axis_has_its_numbers_moved_on_by_as_many(
    method, ring_scene, seed, turns
):
    rng = np.random.default_rng(seed)
    scene = ring_scene(rng, visible=int(rng.integers(6, 9)), clutter=int(rng.integers(0, 6)))
    first = identify(scene.points, method)
    assume(first.status is FOUND and abs(first.roll_rad) < np.deg2rad(22.0))  # at 22.5 deg LED 0 is another
    c, s = np.cos(turns * np.pi / 4), np.sin(turns * np.pi / 4)
    middle = np.array(CAMERA.principal_point_px)
    status, numbers = named(identify((scene.points - middle) @ np.array([[c, s], [-s, c]]) + middle, method))
    before = {k: (number + turns) % 8 for k, number in named(first)[1].items()}
    both = numbers.keys() & before.keys()  # Hough's cells are not turned: now and then it takes other members
    assert status is FOUND and len(both) >= 5
    assert {k: numbers[k] for k in both} == {k: before[k] for k in both}


@both_methods
@scenes
@settings(max_examples=40, deadline=None, suppress_health_check=one_class)
def test_pixels_may_be_counted_from_anywhere(method, ring_scene, seed, visible, clutter, near):
    """Candidates and principal point shifted alike."""
    rng = np.random.default_rng(seed)
    scene = ring_scene(rng, visible=visible, clutter=clutter, clutter_box_radii=1.5 if near else None)
    shift = rng.integers(-3000, 3000, 2)
    camera = Camera(principal_point_px=tuple(np.array(CAMERA.principal_point_px) + shift))
    assert named(identify(scene.points + shift, method, camera=camera)) == named(identify(scene.points, method))


@both_methods
def test_a_far_ring_may_stand_anywhere_in_the_frame(method, ring_scene):
    """The same pixels moved are another ring in space, a little turned; far away by no more than its tilt allows."""
    rng = np.random.default_rng(81)
    for _ in range(30):
        scene = ring_scene(rng, clutter=5, range_m=(10.0, 20.0), tilt_deg=15.0)
        moved = scene.points + rng.uniform(-200.0, 200.0, 2)
        assert named(identify(moved, method)) == named(identify(scene.points, method))


coordinate = st.one_of(
    st.floats(-100.0, 2200.0), st.sampled_from([0.0, 500.0, 500.1, np.nan, np.inf, -np.inf, 1e9, -1e18, 1e300, 5e-324])
)


@both_methods
@given(rows=st.lists(st.tuples(coordinate, coordinate), max_size=25), repeats=st.integers(1, 3), bright=st.booleans())
@settings(max_examples=300, deadline=None)
@pytest.mark.filterwarnings("error")
def test_whatever_the_candidates_the_answer_is_well_formed(method, rows, repeats, bright):
    points = np.array(rows * repeats, dtype=float).reshape(-1, 2)
    flux = np.resize([1.0, 3.0, np.nan, 0.0, -1.0, np.inf, 1e300], len(points)) if bright else None
    result = identify(points, method, brightness=flux)
    check(result, points)


def check(result, points):
    assert len(np.unique(result.members)) == len(result.members) == len(result.led_numbers)
    assert np.isfinite(points[result.members]).all()
    if result.status is FOUND:
        assert len(result.members) >= 4
        assert len(np.unique(result.led_numbers)) == len(result.members)
        assert np.isfinite(result.led_pixels_px).all()
    else:
        assert (result.led_numbers == -1).all()
        assert np.isnan(result.led_pixels_px).all()


@both_methods
@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_fewer_than_four_candidates_are_no_ring(method, count):
    points = np.random.default_rng(82).uniform(0.0, 1000.0, (count, 2))
    for expected in ({}, {"expected_led_px": np.full((8, 2), 500.0), "expected_sigma_px": 3.0}):
        assert identify(points, method, **expected).status is IdentificationStatus.NOT_FOUND


@both_methods
def test_ten_thousand_candidates_cost_what_sixty_do(method, ring_scene, monkeypatch):
    """The brightest, or those about the expected circle, take part; who cannot be told apart is cut off."""
    from dockair.nav.identify import ring

    looked_at = []
    original = ring.ring_fits
    monkeypatch.setattr(ring, "ring_fits", lambda c, *a: looked_at.append(len(c.points)) or original(c, *a))
    rng = np.random.default_rng(83)
    scene = ring_scene(rng, range_m=(4.0, 6.0))
    points = np.vstack([rng.uniform([0.0, 0.0], [2047.0, 1087.0], (10_000, 2)), scene.points])
    flux = np.concatenate([rng.uniform(0.0, 50.0, 10_000), rng.uniform(90.0, 110.0, 8)])
    check(identify(points, method), points)
    check(identify(points, method, brightness=flux), points)
    settings_ = IdentifySettings(max_candidates=30)
    result = identify(points, method, settings_, brightness=flux)
    assert result.status is FOUND and (result.members >= 10_000).all()
    check(identify(points, method, expected_led_px=scene.led_px, expected_sigma_px=2.0), points)
    assert max(looked_at) == IdentifySettings().max_candidates


def test_twice_the_same_blob_is_one_led(ring_scene):
    scene = ring_scene(np.random.default_rng(84), clutter=3)
    result = identify(np.repeat(scene.points, 2, axis=0))
    check(result, np.repeat(scene.points, 2, axis=0))
    assert result.status is FOUND
    assert len(np.unique(result.members // 2)) == len(result.members)


@pytest.mark.parametrize("flux", [np.ones(7), np.ones((8, 1)), np.ones(9)])
def test_brightness_of_other_than_the_candidates_is_refused(flux):
    with pytest.raises(DockairError, match="brightness"):
        identify(np.zeros((8, 2)), brightness=flux)
