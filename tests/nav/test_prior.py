"""Gates of the ring's identification from what is expected."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.identify.prior import make_prior, ring_from_leds

NOTHING = {"centre_px": None, "radius_px": None, "roll_rad": None, "led_px": None, "sigma_px": None}


def prior(**expected):
    return make_prior((12.0, 700.0), 1.0, 0.25, **(NOTHING | expected))


def ring(centre=(900.0, 500.0), radius=100.0, roll=0.0):
    angle = roll + np.arange(8) * np.pi / 4
    return np.asarray(centre) - radius * np.column_stack([np.cos(angle), np.sin(angle)])


def test_radius_and_roll_of_a_tilted_ring_are_those_of_its_parallel_projection():
    angle = 0.3 + np.arange(8) * np.pi / 4
    ring = np.column_stack([0.8 * np.cos(angle), np.sin(angle)])
    centre, radius, roll = ring_from_leds([40.0, 30.0] - 50.0 * ring)
    np.testing.assert_allclose(centre, [40, 30], atol=1e-12)
    assert radius == pytest.approx(50.0)
    # diag(0.8, 1) R(0.3) = rotation part: atan2(1.8 sin, 1.8 cos)
    assert roll == pytest.approx(0.3)


def test_an_led_that_is_seen_beside_the_lens_makes_a_ring_without_end_and_no_error():
    leds = ring()
    leds[3] = 1e160
    with np.errstate(over="ignore"):
        assert not np.isfinite(ring_from_leds(leds)[1])


def test_leds_off_their_places_shift_neither_centre_nor_roll_when_their_angles_are_known():
    angle = np.arange(8) * np.pi / 4 + np.array([0, 0, 0, 0, 0, 0, 0, 0.2])
    led_px = np.array([40.0, 30.0]) - 50.0 * np.column_stack([0.8 * np.cos(angle + 0.3), np.sin(angle + 0.3)])
    centre, radius, roll = ring_from_leds(led_px, angle)
    np.testing.assert_allclose(centre, [40, 30], atol=1e-12)
    assert (radius, roll) == (pytest.approx(50.0), pytest.approx(0.3))
    assert prior(led_px=led_px, led_angle_rad=angle).roll_rad == pytest.approx(0.3)
    assert abs(prior(led_px=led_px).roll_rad - 0.3) > 0.01


def test_without_expectation_every_gate_is_open():
    nothing = prior()
    assert not nothing.has_centre and nothing.prediction_px is None
    assert nothing.radius_range_px == (12.0, 700.0)
    assert nothing.roll_gate == (0.0, np.pi)
    assert nothing.gate[2] > 1e5


def test_what_leds_say_gives_way_to_what_is_said_beside_them():
    given = prior(led_px=ring(roll=0.3), radius_px=80.0)
    np.testing.assert_allclose(given.centre_px, [900.0, 500.0])
    assert given.roll_rad == pytest.approx(0.3)
    assert given.expected_radius_px == 80.0
    assert given.radius_range_px == pytest.approx((60.0, 100.0))


def test_a_centre_is_gated_by_its_sigma_and_without_one_by_radii():
    assert prior(centre_px=np.zeros(2), radius_px=80.0).centre_tolerance_px == pytest.approx(100.0)
    assert prior(centre_px=np.zeros(2), radius_px=80.0, sigma_px=3.0).centre_tolerance_px == pytest.approx(15.0 + 2.0)


@pytest.mark.parametrize("key", ["centre_px", "led_px"])
def test_an_expectation_that_is_not_finite_is_none(key):
    value = np.full(2, np.nan) if key == "centre_px" else np.where(np.arange(16).reshape(8, 2) == 5, np.inf, 1.0)
    assert not prior(**{key: value}).has_centre


def test_wrong_shapes_are_refused():
    with pytest.raises(DockairError, match="expected_led_px"):
        prior(led_px=np.zeros((7, 2)))
    with pytest.raises(DockairError, match="expected_centre_px"):
        prior(centre_px=np.zeros(3))


def test_shape_error_forgives_shift_turn_and_scale_and_nothing_else():
    expected = ring() @ np.diag([0.8, 1.0])
    tracked = prior(led_px=expected, sigma_px=1.0)
    numbers = np.array([0, 2, 3, 5, 6])
    turn = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    seen = 1.1 * expected[numbers] @ turn.T + [40.0, -7.0]
    assert tracked.shape_error_px(seen, numbers) == pytest.approx(0.0, abs=1e-9)
    seen[1] += [6.0, 0.0]
    assert 2.0 < tracked.shape_error_px(seen, numbers) <= 6.0
    assert prior(centre_px=np.zeros(2)).shape_error_px(seen, numbers) == 0.0


def test_a_ring_is_allowed_where_and_as_large_as_the_gates_have_it():
    prior = make_prior((10.0, 500.0), 1.0, 0.25, np.array([600.0, 400.0]), 100.0, None, None, 10.0)
    # five sigma, and two per cent of the largest radius
    assert prior.allows(np.array([652.0, 400.0]), 100.0) and not prior.allows(np.array([653.0, 400.0]), 100.0)
    centre = np.array([600.0, 400.0])
    assert prior.allows(centre, 76.0) and prior.allows(centre, 124.0)
    assert not prior.allows(centre, 74.0) and not prior.allows(centre, 126.0)


@pytest.mark.parametrize(("radius", "roll", "prefers"), [(None, None, False), (90.0, None, True), (None, 0.1, True)])
def test_one_of_several_rings_is_preferred_for_its_size_or_its_roll(radius, roll, prefers):
    assert make_prior((10.0, 500.0), 1.0, 0.25, np.zeros(2), radius, roll, None, None).prefers is prefers


def test_what_is_expected_by_itself_counts_before_the_leds_prediction():
    led_px = ring(roll=0.2)
    alone = prior(led_px=led_px)
    np.testing.assert_allclose(alone.centre_px, [900.0, 500.0])
    assert (alone.expected_radius_px, alone.roll_rad) == (pytest.approx(100.0), pytest.approx(0.2))
    told = prior(led_px=led_px, centre_px=np.array([910.0, 490.0]), radius_px=80.0, roll_rad=-0.1)
    np.testing.assert_array_equal(told.centre_px, [910.0, 490.0])
    assert (told.expected_radius_px, told.roll_rad) == (80.0, -0.1)


def test_only_leds_expected_with_a_sigma_are_a_prediction():
    assert prior(led_px=ring()).prediction_px is None
    np.testing.assert_array_equal(prior(led_px=ring(), sigma_px=1.0).prediction_px, ring())
