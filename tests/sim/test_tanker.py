"""The tanker's path, against closed forms and its own derivatives."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.aircraft.tanker_motion import NODES, WEIGHTS, state_at

V = 180.0
BANK = np.radians(25.0)
TURN = STANDARD_GRAVITY_M_S2 * np.tan(BANK) / V  # of the heading, coordinated [rad/s]
ROLL_RATE = np.radians(5.0)
RACETRACK = TankerPathParameters(
    manoeuvre="racetrack", starts_s=5.0, leg_s=40.0, bank_rad=BANK, roll_rate_rad_s=ROLL_RATE
)
TOBOGGAN = TankerPathParameters(
    manoeuvre="toboggan", starts_s=3.0, descent_rad=np.radians(3.0), pull_over_rate_rad_s=np.radians(0.5)
)
ENTRY_S = 1.875 * np.tan(BANK) / ROLL_RATE
TURN_S = np.pi / TURN + ENTRY_S  # of 180 degrees, rolling in and out included


def _in_air(path, time_s):
    """(3,) place in the air mass."""
    return path.at(time_s).p_WT + [V * time_s, 0.0, 0.0]


@pytest.fixture(params=[RACETRACK, TOBOGGAN], ids=["racetrack", "toboggan"])
def path(request):
    return TankerPath(request.param, V, np.array([7.0, 12.0, 2.2]))


def test_straight_tanker_stands_still_in_w():
    path = TankerPath(TankerPathParameters(), V, np.array([7.0, 12.0, 2.2]))
    for time_s in (-3.0, 0.0, 1e4):
        state = path.at(time_s)
        np.testing.assert_array_equal(state.p_WT, [7.0, 12.0, 2.2])
        np.testing.assert_array_equal(state.R_WT, np.eye(3))
        for rest in (state.v_WT_W, state.a_WT_W, state.w_WT_T, state.alpha_WT_T):
            np.testing.assert_array_equal(rest, 0.0)
    assert path.is_straight and path.change_after(0.0) is None


def test_steady_turn_is_a_circle_of_the_textbook_radius_and_rate():
    """R = V^2 / (g tan bank), centre to the left; w = V/R about the vertical; load factor 1/cos(bank)."""
    path = TankerPath(RACETRACK, V)
    radius = V**2 / (STANDARD_GRAVITY_M_S2 * np.tan(BANK))
    centres = []
    for time_s in (20.0, 50.0, 100.0):
        state = path.at(time_s)
        left = np.array([-np.sin(state.heading_rad), np.cos(state.heading_rad), 0.0])
        centres.append(_in_air(path, time_s) + radius * left)
        np.testing.assert_allclose(state.R_WT @ state.w_WT_T, [0.0, 0.0, V / radius], atol=1e-15)
        np.testing.assert_allclose(state.a_WT_W, V**2 / radius * left, atol=1e-12)
        np.testing.assert_allclose(state.alpha_WT_T, 0.0, atol=1e-15)
        assert state.bank_rad == pytest.approx(-BANK, abs=1e-12)  # left wing down
        assert state.turn_rate_rad_s == pytest.approx(TURN, rel=1e-14)
    np.testing.assert_allclose(centres, np.tile(centres[0], (3, 1)), atol=1e-8)


def test_turn_to_the_right_is_the_mirror_image():
    left, right = (
        TankerPath(
            TankerPathParameters(
                manoeuvre="racetrack", bank_rad=BANK, roll_rate_rad_s=ROLL_RATE, turns_left=turns_left
            ),
            V,
        )
        for turns_left in (True, False)
    )
    for time_s in (4.0, 30.0, 130.0, 250.0):
        a, b = left.at(time_s), right.at(time_s)
        np.testing.assert_allclose(b.p_WT, a.p_WT * [1.0, -1.0, 1.0], atol=1e-9)
        np.testing.assert_allclose(b.w_WT_T, a.w_WT_T * [-1.0, 1.0, -1.0], atol=1e-15)
        assert b.bank_rad == pytest.approx(-a.bank_rad, abs=1e-14)


def test_specific_force_has_no_side_component_and_the_nose_points_along_the_way_through_the_air(path):
    for time_s in np.linspace(0.0, 200.0, 401):
        state = path.at(time_s)
        felt_T = state.R_WT.T @ (state.a_WT_W + [0.0, 0.0, STANDARD_GRAVITY_M_S2])
        assert felt_T[1] == pytest.approx(0.0, abs=1e-12)
        assert felt_T[2] > 8.0  # pulling over at 0.5 deg/s takes 1.6 m/s^2 off
        np.testing.assert_allclose(state.R_WT.T @ (state.v_WT_W + [V, 0.0, 0.0]), [V, 0.0, 0.0], atol=1e-10)


def test_every_rate_is_the_derivative_of_its_place(path):
    """Central differences over 2 ms; the third derivatives are below 3 m/s^4."""
    h = 1e-3
    for time_s in np.linspace(0.1, 200.0, 333):
        a, b, c = (path.at(time_s + d) for d in (-h, 0.0, h))
        np.testing.assert_allclose((c.p_WT - a.p_WT) / (2 * h), b.v_WT_W, atol=1e-6)
        np.testing.assert_allclose((c.v_WT_W - a.v_WT_W) / (2 * h), b.a_WT_W, atol=1e-6)
        turn = b.R_WT.T @ (c.R_WT - a.R_WT) / (2 * h)
        np.testing.assert_allclose([turn[2, 1], turn[0, 2], turn[1, 0]], b.w_WT_T, atol=1e-7)
        np.testing.assert_allclose((c.w_WT_T - a.w_WT_T) / (2 * h), b.alpha_WT_T, atol=1e-6)
        np.testing.assert_allclose(b.R_WT @ b.R_WT.T, np.eye(3), atol=1e-14)


def test_rates_are_the_derivatives_also_where_turn_and_slope_change_together():
    """No manoeuvre does so; its equations hold all the same. From 5 to 29 degrees of bank, 3.4 of slope, in 8 s."""
    h, segment = 1e-3, np.array([[2.0, 8.0, 0.005, 0.03, 0.03, -0.03, 0.4, 7.0, 12.0, 2.2]])
    for time_s in np.linspace(2.5, 9.5, 29):
        a, b, c = (state_at(segment, time_s + d, V, NODES, WEIGHTS) for d in (-h, 0.0, h))
        np.testing.assert_allclose((c[:6] - a[:6]) / (2 * h), b[3:9], atol=1e-5)
        attitude, turn = b[9:18].reshape(3, 3), (c[9:18] - a[9:18]).reshape(3, 3) / (2 * h)
        spin = attitude.T @ turn
        np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], b[18:21], atol=1e-7)
        np.testing.assert_allclose((c[18:21] - a[18:21]) / (2 * h), b[21:24], atol=1e-6)
        felt_T = attitude.T @ (b[6:9] + [0.0, 0.0, STANDARD_GRAVITY_M_S2])
        assert felt_T[1] == pytest.approx(0.0, abs=1e-12)


def test_nothing_jumps_where_one_segment_meets_the_next(path):
    """Place, velocity, acceleration, attitude, turn: all the same just before and just after."""
    for start_s in path._segments[1:6, 0]:
        before, after = path.vector(start_s - 1e-9), path.vector(start_s + 1e-9)
        np.testing.assert_allclose(after, before, atol=1e-6, rtol=0.0)


def test_roll_rate_stays_below_its_limit_and_comes_near_it():
    rates = [abs(TankerPath(RACETRACK, V).at(t).w_WT_T[0]) for t in np.linspace(5.0, 5.0 + ENTRY_S, 400)]
    assert 0.85 * ROLL_RATE < max(rates) <= ROLL_RATE


def test_racetrack_closes_on_itself_in_the_air_mass():
    path = TankerPath(RACETRACK, V)
    lap_s = 2.0 * (RACETRACK.leg_s + TURN_S)
    for time_s in (0.0, 7.0, 60.0):
        begin, end = path.at(5.0 + time_s), path.at(5.0 + time_s + lap_s)
        np.testing.assert_allclose(_in_air(path, 5.0 + time_s + lap_s), _in_air(path, 5.0 + time_s), atol=1e-6)
        np.testing.assert_allclose(end.R_WT, begin.R_WT, atol=1e-12)
    half = path.at(5.0 + TURN_S)
    np.testing.assert_allclose(half.R_WT, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)


def test_two_paths_asked_at_different_times_are_the_same_path():
    far, near = TankerPath(RACETRACK, V), TankerPath(RACETRACK, V)
    far.at(900.0)
    for time_s in (3.0, 8.0, 100.0, 300.0, 899.0):
        np.testing.assert_array_equal(far.vector(time_s), near.vector(time_s))


def test_toboggan_ends_in_a_straight_descent_at_the_same_airspeed():
    """After the pull-over it goes down V sin(3 deg) a second; the pull-over is at most 0.5 deg/s."""
    path = TankerPath(TOBOGGAN, V)
    a, b = path.at(60.0), path.at(70.0)
    np.testing.assert_allclose(
        b.p_WT - a.p_WT, 10.0 * V * np.array([np.cos(np.radians(3.0)) - 1.0, 0.0, -np.sin(np.radians(3.0))]), atol=1e-8
    )
    assert a.climb_rad == pytest.approx(np.radians(-3.0))
    np.testing.assert_allclose(a.R_WT, exp(np.array([0.0, np.radians(3.0), 0.0])), atol=1e-14)  # nose down
    rates = [abs(path.at(t).w_WT_T[1]) for t in np.linspace(3.0, 20.0, 500)]
    assert 0.99 * np.radians(0.5) < max(rates) <= np.radians(0.5) * (1.0 + 1e-12)


def test_changes_are_told_in_their_order_with_what_follows():
    path = TankerPath(RACETRACK, V)
    first = path.change_after(-1.0)
    assert (first.starts_s, first.turn_rate_rad_s, first.climb_rad) == (5.0, pytest.approx(TURN), 0.0)
    assert first.entry_s == pytest.approx(ENTRY_S)
    out = path.change_after(first.starts_s)
    assert out.starts_s == pytest.approx(5.0 + np.pi / TURN) and out.turn_rate_rad_s == 0.0
    assert path.change_after(1000.0).starts_s > 1000.0
    down = TankerPath(TOBOGGAN, V)
    assert down.change_after(0.0).climb_rad == pytest.approx(np.radians(-3.0))
    assert down.change_after(3.0) is None


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"bank_rad": 0.0}, "tanker.bank_rad"),
        ({"bank_rad": 1.6}, "tanker.bank_rad"),
        ({"bank_rad": float("nan")}, "tanker.bank_rad"),
        ({"roll_rate_rad_s": -0.1}, "tanker.roll_rate_rad_s"),
        ({"roll_rate_rad_s": 0.001}, "parameters.tanker_path.roll_rate_rad_s"),
        ({"starts_s": -1.0}, "tanker.starts_s"),
        ({"leg_s": float("inf")}, "tanker.leg_s"),
    ],
)
def test_racetrack_that_cannot_be_flown_is_refused_by_its_key(changed, where):
    parameters = {"manoeuvre": "racetrack", "bank_rad": BANK, "roll_rate_rad_s": ROLL_RATE} | changed
    with pytest.raises(DockairError, match=where):
        TankerPath(TankerPathParameters(**parameters), V)


def test_racetrack_is_flown_as_long_as_rolling_in_and_out_fits_into_the_turn():
    """Rolling in takes as long as it does out, and turns half as far as the same time in the turn."""

    def racetrack(share: float) -> TankerPath:
        """One whose rolling in takes a share of the time in which the full bank turns by 180 degrees."""
        rate = 1.875 * np.tan(BANK) * TURN / np.pi / share  # 1.875: the peak of a smooth change's rate over its mean
        return TankerPath(TankerPathParameters(manoeuvre="racetrack", bank_rad=BANK, roll_rate_rad_s=rate), V)

    turned = racetrack(0.98).at(1.98 * np.pi / TURN)
    assert abs(turned.heading_rad) == pytest.approx(np.pi, abs=1e-9)
    with pytest.raises(DockairError, match=r"^parameters\.tanker_path\.roll_rate_rad_s: expected a rate at which"):
        racetrack(1.02)


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"descent_rad": 0.0}, "tanker.descent_rad"),
        ({"descent_rad": float("nan")}, "tanker.descent_rad"),
        ({"pull_over_rate_rad_s": 0.0}, "tanker.pull_over_rate_rad_s"),
        ({"starts_s": float("inf")}, "tanker.starts_s"),
    ],
)
def test_toboggan_that_cannot_be_flown_is_refused_by_its_key(changed, where):
    parameters = {"manoeuvre": "toboggan", "descent_rad": np.radians(3.0)} | changed
    with pytest.raises(DockairError, match=where):
        TankerPath(TankerPathParameters(**parameters), V)


def test_speed_and_time_must_be_numbers():
    with pytest.raises(DockairError, match="airspeed_m_s"):
        TankerPath(RACETRACK, 0.0)
    with pytest.raises(DockairError, match="time_s"):
        TankerPath(RACETRACK, V).at(float("nan"))
