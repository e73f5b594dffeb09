"""Where a drogue that is out of view should be."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, Mounting
from dockair.nav.guidance.dead_reckoning import DeadReckoning
from dockair.nav.guidance.field_of_view import FieldOfView
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.rotations import exp

SETTINGS, STEP_S = GuidanceSettings(), 0.01
LEVEL, STILL = np.eye(3), np.zeros(3)
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.array([2.0, 0.0, 1.0]), p_BP=np.array([5.0, 0.0, 0.5]))
FIELD = FieldOfView(Camera(), MOUNTING)
HALF_FIELD = 544.0 / Camera().focal_length_px  # tangent of its height


def reckoned(ring_m, drift_m_s, u_m_s, ticks, bearable=True):
    reckoning = DeadReckoning(SETTINGS, STEP_S)
    place = np.array(ring_m)
    reckoning.see(place, place, np.array(drift_m_s), bearable=bearable)
    for _ in range(ticks):
        reckoning.miss(np.array(u_m_s), LEVEL, not_shown=True)
    return reckoning


def lower_edge_m(ahead_m):
    return 0.5 - HALF_FIELD * (ahead_m + 3.0)


def test_flies_toward_where_the_drogue_has_drifted_by_its_own_way():
    """Seen 0.2 m left, then 2 s unseen with 0.4 m/s of drift to the left and 0.1 m/s of its own: 0.8 m left."""
    reckoning = reckoned((4.0, 0.2, 0.0), (0.0, 0.4, 0.0), (0.0, 0.1, 0.0), 200)
    np.testing.assert_allclose(reckoning.astern_m_s(), (0.0, 0.8 * SETTINGS.reckoned_gain_1_s, 0.0), atol=1e-9)


def test_a_drift_of_half_a_swing_is_believed_only_so_far():
    reckoning = reckoned((4.0, 0.0, 0.0), (2.0, -3.0, 0.3), (2.0, 0.0, 0.0), 100)
    most = SETTINGS.unseen_drift_m_s
    np.testing.assert_allclose(reckoning.drift_m_s, (most, -most, 0.3))
    np.testing.assert_allclose(reckoning.astern_m_s()[1:], SETTINGS.reckoned_gain_1_s * np.array([-most, 0.3]))


def test_in_gusts_that_cannot_be_borne_less_of_it_is_believed():
    """A receiver in severe gusts (seed 14029, by camera) had sunk 24 m below the drogue by 0.5 m/s in 20 s."""
    reckoning = reckoned((4.0, 0.0, 0.0), (2.0, -3.0, 0.1), (0.0, 0.0, 0.0), 100, bearable=False)
    most = SETTINGS.unseen_drift_in_gusts_m_s
    assert most < SETTINGS.unseen_drift_m_s
    np.testing.assert_allclose(reckoning.drift_m_s, (most, -most, 0.1))


def test_no_faster_than_it_backs_off_and_not_beside_the_drogue():
    far = reckoned((4.0, -9.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1)
    np.testing.assert_allclose(far.astern_m_s(), (0.0, -SETTINGS.back_off_speed_m_s, 0.0))
    beside = reckoned((0.5, -9.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1)
    np.testing.assert_array_equal(beside.astern_m_s(), np.zeros(3))


def test_a_drogue_that_is_seen_again_is_where_it_is_seen():
    reckoning = reckoned((4.0, 1.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.0), 300)
    reckoning.see(np.array([4.0, 0.0, 0.0]), np.array([4.0, 0.0, 0.0]), np.zeros(3), bearable=True)
    np.testing.assert_array_equal(reckoning.astern_m_s(), np.zeros(3))


@pytest.mark.parametrize("bank_rad", [0.0, 0.2])
def test_frames_that_do_not_show_it_where_it_is_reckoned_put_it_beyond_the_edge_that_it_went_out_by(bank_rad):
    """Last seen at the lower edge, the middle of its swing higher, said to rise: it is below, and sinks."""
    R_NB = exp(np.array([bank_rad, 0.0, 0.0]))
    reckoning = DeadReckoning(SETTINGS, STEP_S, FIELD)
    low = R_NB @ np.array([5.0, 0.0, lower_edge_m(5.0) + 0.02])
    reckoning.see(low, np.array([5.0, 0.0, -0.9]), np.array([0.0, 0.0, 0.3]), bearable=True)
    for _ in range(600):
        reckoning.miss(STILL, R_NB, not_shown=True)
    place_B = R_NB.T @ reckoning.place_m
    assert place_B[2] == pytest.approx(lower_edge_m(place_B[0]), abs=0.1)
    assert reckoning.drift_m_s @ R_NB[:, 2] < 0.05
    assert reckoning.astern_m_s() @ R_NB[:, 2] < -0.4


def test_what_is_reckoned_below_the_field_is_left_there():
    reckoning = DeadReckoning(SETTINGS, STEP_S, FIELD)
    below = np.array([5.0, 0.3, lower_edge_m(5.0) - 0.5])
    reckoning.see(below, below, STILL, bearable=True)
    for _ in range(300):
        reckoning.miss(STILL, LEVEL, not_shown=True)
    np.testing.assert_array_equal(reckoning.place_m, below)


@pytest.mark.parametrize("case", ["frames show it or do not come", "no field", "beside"])
def test_frames_say_nothing_where(case):
    field = None if case == "no field" else FIELD
    place = np.array([0.9 if case == "beside" else 5.0, 0.0, -0.1])
    assert FIELD.out_m(place, FIELD.nearest_edge(place)).any()
    reckoning = DeadReckoning(SETTINGS, STEP_S, field)
    reckoning.see(place, place, STILL, bearable=True)
    for _ in range(300):
        reckoning.miss(STILL, LEVEL, not_shown=case != "frames show it or do not come")
    np.testing.assert_array_equal(reckoning.place_m, place)


def test_a_drogue_that_nobody_has_seen_is_nowhere():
    reckoning = DeadReckoning(SETTINGS, STEP_S, FIELD)
    for _ in range(300):
        reckoning.miss(STILL, LEVEL, not_shown=True)
    np.testing.assert_array_equal(reckoning.place_m, np.zeros(3))


def test_a_drogue_that_nobody_has_seen_went_out_by_no_edge():
    """The receiver falls straight back; once it had, it climbed away from an imagined drogue above the field."""
    reckoning, backward = DeadReckoning(SETTINGS, STEP_S, FIELD), np.array([-1.0, 0.0, 0.0])
    for _ in range(2000):
        reckoning.miss(backward, LEVEL, not_shown=True)
    np.testing.assert_array_equal(reckoning.drift_m_s, np.zeros(3))
    np.testing.assert_array_equal(reckoning.place_m[1:], np.zeros(2))
    assert reckoning.place_m[0] > 19.0


@pytest.mark.parametrize("bearable", [True, False])
def test_whatever_frames_do_not_show_it_drifts_no_faster_than_an_inertial_velocity_errs(bearable):
    """A camera that is blind, not out of view: the receiver is not led away faster than that, nor in gusts slower."""
    _, drifts = led_by_a_blind_camera(bearable, 250)
    most = SETTINGS.unseen_drift_m_s
    assert drifts[-1, 2] == pytest.approx(-most)
    assert (np.abs(drifts) <= most).all()


@pytest.mark.parametrize("bearable", [True, False])
def test_it_is_looked_for_beyond_one_edge_no_farther_than_it_swings_and_may_drift(bearable):
    """And then where it went out of view: a receiver (25302 of severe gusts, by camera) sank 20 m after it in 10 s."""
    places, drifts = led_by_a_blind_camera(bearable, 3000)
    beyond_m = SETTINGS.unseen_swing_m + SETTINGS.unseen_drift_m_s * STEP_S * np.arange(3001)
    moved_m = np.linalg.norm(places - places[0], axis=1)
    assert moved_m.max() > SETTINGS.unseen_swing_m
    assert (moved_m <= beyond_m).all()
    farthest = moved_m.argmax()
    assert moved_m[farthest] == pytest.approx(beyond_m[farthest], abs=0.02)  # at 0.9 m/s
    np.testing.assert_allclose(places[-1], places[0], atol=1e-9)
    np.testing.assert_array_equal(drifts[-1], STILL)


def test_seen_again_it_is_looked_for_beyond_the_edge_by_which_it_then_goes():
    reckoning = DeadReckoning(SETTINGS, STEP_S, FIELD)
    for upper in (False, True):
        edge = np.array([5.0, 0.0, 1.0 - lower_edge_m(5.0) if upper else lower_edge_m(5.0)])
        reckoning.see(0.98 * edge, np.array([5.0, 0.0, 0.5]), STILL, bearable=True)
        for _ in range(100):
            reckoning.miss(STILL, LEVEL, not_shown=True)
        assert np.sign(reckoning.drift_m_s[2]) == (1.0 if upper else -1.0)


def led_by_a_blind_camera(bearable, ticks):
    """(ticks + 1, 3) places on the receiver's own scale and drifts of a drogue that no frame shows any more."""
    place, own = np.array([5.0, 0.0, -0.5]), np.zeros(3)
    reckoning, places, drifts = DeadReckoning(SETTINGS, STEP_S, FIELD), [place], [STILL]
    reckoning.see(place, place, STILL, bearable=bearable)
    for _ in range(ticks):
        u = reckoning.drift_m_s + reckoning.astern_m_s()
        reckoning.miss(u, LEVEL, not_shown=True)
        own += u * STEP_S
        places.append(reckoning.place_m + own)
        drifts.append(reckoning.drift_m_s)
    return np.array(places), np.array(drifts)


def test_in_a_tick_place_and_drift_go_their_shares_of_the_way_out_of_the_field():
    """2/T and 1/T^2 of it: the place comes to the edge in T, and the drift with it."""
    place, drift, u = np.array([5.0, 0.0, -0.9]), np.array([0.0, 0.0, 0.1]), np.array([0.1, 0.0, 0.05])
    T = 2.0  # unlike a second, another power of it is another number
    reckoning = DeadReckoning(replace(SETTINGS, unseen_correction_s=T), STEP_S, FIELD)
    reckoning.see(place, place, drift, bearable=True)
    out_m = FIELD.out_m(place, FIELD.nearest_edge(place))
    assert out_m[2] < -0.05
    reckoning.miss(u, LEVEL, not_shown=True)
    np.testing.assert_allclose(reckoning.place_m - place, STEP_S * (drift - u + 2.0 * out_m / T), atol=1e-12)
    np.testing.assert_allclose(reckoning.drift_m_s - drift, STEP_S * out_m / T**2, atol=1e-12)


def test_looked_for_in_vain_beyond_an_edge_it_is_looked_for_beyond_no_other_until_it_is_seen_again():
    """A camera that stays blind: back where it went out of view it is left there."""
    places, _ = led_by_a_blind_camera(True, 3000)
    back = int(np.argmax(np.linalg.norm(np.diff(places, axis=0), axis=1) > 1.0)) + 1
    assert 100 < back < 1500
    np.testing.assert_allclose(places[back:], np.tile(places[0], (3001 - back, 1)), atol=1e-9)


def test_what_it_may_have_drifted_by_is_counted_from_when_it_was_seen_last():
    """Lost a second time, after a long while out of view, it is looked for no farther than the first time."""
    reckoning, place, farthest_m = DeadReckoning(SETTINGS, STEP_S, FIELD), np.array([5.0, 0.0, -0.5]), []
    for _ in range(2):
        reckoning.see(place, place, STILL, bearable=True)
        own, moved_m = np.zeros(3), []
        for _ in range(1500):
            u = reckoning.drift_m_s + reckoning.astern_m_s()
            reckoning.miss(u, LEVEL, not_shown=True)
            own = own + u * STEP_S
            moved_m.append(np.linalg.norm(reckoning.place_m + own - place))
        farthest_m.append(max(moved_m))
    assert farthest_m[0] > SETTINGS.unseen_swing_m
    assert farthest_m[1] == pytest.approx(farthest_m[0])


@pytest.mark.parametrize("bank_rad", [-0.4, 0.4])
def test_the_edge_that_it_goes_out_by_is_the_one_that_the_camera_sees_it_nearest_to(bank_rad):
    """Low and outside of a turn: nearest to the lower edge of a level field, and to the side of a banked one."""
    R_NB, reckoning = exp(np.array([bank_rad, 0.0, 0.0])), DeadReckoning(SETTINGS, STEP_S, FIELD)
    place = np.array([5.0, -1.8 * np.sign(bank_rad), -0.6])
    reckoning.see(place, place, STILL, bearable=True)
    for _ in range(100):
        reckoning.miss(STILL, R_NB, not_shown=True)
    _, left_m, up_m = R_NB.T @ (reckoning.place_m - place)
    assert abs(left_m) > 0.1 > 10.0 * abs(up_m)


def test_once_gusts_can_be_borne_again_more_of_what_is_learnt_is_believed():
    reckoning = reckoned((4.0, 0.0, 0.0), (0.0, 3.0, 0.0), STILL, 1, bearable=False)
    place = np.array([4.0, 0.0, 0.0])
    reckoning.see(place, place, np.array([0.0, 3.0, 0.0]), bearable=True)
    reckoning.miss(STILL, LEVEL, not_shown=True)
    np.testing.assert_allclose(reckoning.drift_m_s, (0.0, SETTINGS.unseen_drift_m_s, 0.0))


@pytest.mark.parametrize("left_m", [-9.0, 9.0])
def test_to_either_side_it_goes_astern_no_faster_than_it_backs_off(left_m):
    far = reckoned((4.0, left_m, left_m), STILL, STILL, 1)
    np.testing.assert_allclose(far.astern_m_s()[1:], np.sign(left_m) * SETTINGS.back_off_speed_m_s)


def test_once_an_edge_is_given_up_no_more_is_believed_of_the_drift_than_before():
    """Half a swing had taught 3 m/s to the left."""
    reckoning, place, drifts = DeadReckoning(SETTINGS, STEP_S, FIELD), np.array([5.0, 0.0, -0.5]), []
    reckoning.see(place, place, np.array([0.0, 3.0, 0.0]), bearable=True)
    for _ in range(3000):
        reckoning.miss(reckoning.drift_m_s + reckoning.astern_m_s(), LEVEL, not_shown=True)
        drifts.append(reckoning.drift_m_s)
    assert np.abs(drifts).max() == pytest.approx(SETTINGS.unseen_drift_m_s)
    np.testing.assert_allclose(drifts[-1], (0.0, SETTINGS.unseen_drift_m_s, 0.0))
