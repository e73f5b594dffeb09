"""The receiver's place by its own commands."""

import numpy as np
import pytest

from dockair.nav.guidance.own_path import OwnPath

RESPONSE_S, STRAYING_S = np.array([0.4, 0.17, 0.14]), np.array([0.9, 0.6, 0.45])
LIMIT_M_S = np.full(3, 0.5)


def test_each_axis_flies_its_commands_a_response_time_later():
    path, u = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 4.0, LIMIT_M_S), np.random.default_rng(1).normal(size=(300, 3))
    sums = np.vstack([np.zeros(3), np.cumsum(u, axis=0) * 0.01])
    for k in range(300):
        path.step(u[k])
        late = [max(k + 1 - n, 0) for n in (40, 17, 14)]
        np.testing.assert_allclose(path.place_m, [sums[n, i] for i, n in enumerate(late)], atol=1e-12)
        np.testing.assert_allclose(path.velocity_m_s, [u[n - 1, i] if n else 0.0 for i, n in enumerate(late)])
        np.testing.assert_allclose(path.place_ahead_m, sums[k + 1], atol=1e-12)


def test_what_is_felt_besides_the_commands_is_part_of_the_way():
    """A gust takes the tip to 0.3 m/s left at once, besides a command of 0.5 m/s: place and rate are those flown."""
    path, left, flown = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 1e6, LIMIT_M_S), np.array([0.0, 1.0, 0.0]), 0.0
    before = 0.0
    for k in range(100):
        commanded = 0.5 if k >= 17 else 0.0  # felt a response time after it was given
        v = commanded + (0.3 if k >= 50 else 0.0)
        path.feel((v - before) * left)
        before, flown = v, flown + 0.01 * (v - commanded)
        path.step(0.5 * left)
    np.testing.assert_allclose(path.velocity_m_s, 0.8 * left, atol=1e-6)
    np.testing.assert_allclose(path.place_m, (0.5 * 0.01 * 83 + flown) * left, atol=0.006)  # a tick of the command


def test_it_goes_on_to_stray_until_that_has_died_away():
    path, strayed = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 1e6, LIMIT_M_S), np.array([0.1, -0.2, 0.3])
    path.feel(strayed)
    here = path.place_m
    for time_s in (RESPONSE_S, np.full(3, 0.8), np.full(3, 20.0)):
        way = strayed * STRAYING_S * (1.0 - np.exp(-time_s / STRAYING_S))
        np.testing.assert_allclose(path.places_m(path.strays_s(time_s)) - here, way, atol=1e-12)
    np.testing.assert_allclose(path.place_ahead_m, path.places_m(path.strays_s(RESPONSE_S)))
    np.testing.assert_allclose(path.straying_ahead_m_s, strayed * np.exp(-RESPONSE_S / STRAYING_S))


def test_it_tells_what_gusts_gave_inside_the_limit_and_nothing_where_nothing_was_felt():
    """A push up to 0.7 m/s within 0.1 s: 0.5 of it. A gap tells nothing, nor an axis with no limit."""
    path, told = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 1e6, LIMIT_M_S), []
    for _ in range(10):
        path.feel(np.array([0.0, 0.0, 0.07]))
        told.append(path.blown_m_s)
        path.step(np.zeros(3))
    felt = np.minimum(0.07 * np.arange(11), 0.5)
    given = felt[1:] - np.exp(-0.01 / STRAYING_S[2]) * felt[:-1]  # what flight control takes back is given, too
    np.testing.assert_allclose(np.array(told)[:, 2], given, atol=1e-6)
    assert not np.array(told)[:, :2].any()
    path.feel(np.full(3, np.nan))
    np.testing.assert_array_equal(path.blown_m_s, np.zeros(3))
    unfelt = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 4.0, np.array([0.5, 0.0, 0.5]))
    unfelt.feel(np.full(3, 0.1))
    np.testing.assert_allclose(unfelt.blown_m_s, (0.1, 0.0, 0.1), rtol=0.01)
    assert unfelt.blown_m_s[1] == 0.0


def test_gravity_that_is_not_quite_taken_off_is_forgotten():
    """0.05 m/s^2 from now on: felt as 0.07 m/s at most, within half a minute as nothing."""
    path, most = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 4.0, LIMIT_M_S), 0.0
    for _ in range(3000):
        path.feel(np.full(3, 0.0005))
        path.step(np.zeros(3))
        most = max(most, float(path.velocity_m_s.max()))
    assert 0.06 < most < 0.08  # a T_f / e
    assert np.abs(path.velocity_m_s).max() < 0.002


def test_where_nothing_is_felt_any_more_straying_dies_away():
    path = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 4.0, LIMIT_M_S)
    path.feel(np.full(3, 0.3))
    straying = path.velocity_m_s
    for k in range(1, 300):
        path.feel(np.full(3, np.nan))
        path.step(np.zeros(3))
        np.testing.assert_allclose(path.velocity_m_s, straying * np.exp(-k * 0.01 / STRAYING_S), atol=1e-12)


def test_a_turn_that_nobody_announced_is_not_flown_against_for_more_than_the_limit():
    path, most = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 4.0, LIMIT_M_S), 0.0
    for _ in range(1000):
        path.feel(np.full(3, 0.05))  # 5 m/s^2
        path.step(np.zeros(3))
        most = max(most, float(path.velocity_m_s.max()))
    assert 0.4 < most <= 0.5
    assert (path.velocity_m_s <= 0.5).all() and (path.velocity_m_s > 0.0).all()


@pytest.mark.parametrize("most_m_s", [0.4, 1.0, 3.0])
def test_who_was_blown_aside_and_is_at_rest_again_strays_no_more_though_the_limit_was_met(most_m_s):
    path, strays = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 1e6, LIMIT_M_S), []
    for change_m_s in np.repeat([most_m_s / 50.0, -most_m_s / 50.0], 50):  # up and down again, 0.5 s each
        path.feel(np.full(3, change_m_s))
        path.step(np.zeros(3))
        strays.append(path.velocity_m_s)
    assert np.max(strays) == pytest.approx(min(most_m_s, 0.5), abs=1e-5)
    assert np.min(strays) > -1e-5
    np.testing.assert_allclose(strays[-1], 0.0, atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_change_that_is_not_known_whole_was_not_felt(axis):
    path, change = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 4.0, LIMIT_M_S), np.full(3, 0.1)
    change[axis] = np.nan
    path.feel(change)
    np.testing.assert_array_equal([path.velocity_m_s, path.blown_m_s], np.zeros((2, 3)))


def test_what_was_felt_before_a_gap_is_no_part_of_what_gusts_give_after_it():
    """0.4 m/s, a gap, and 0.3 m/s more: of the sum the limit would have left 0.1."""
    path, given = OwnPath(RESPONSE_S, 0.01, STRAYING_S, 1e6, LIMIT_M_S), []
    for change_m_s in (0.4, np.nan, 0.3):
        path.feel(np.full(3, change_m_s))
        given.append(path.blown_m_s)
        path.step(np.zeros(3))
    np.testing.assert_allclose(given, np.outer([0.4, 0.0, 0.3], np.ones(3)), rtol=1e-7)


def test_who_answers_within_less_than_a_tick_has_flown_a_command_after_the_period_that_it_is_given_for():
    path, u = OwnPath(np.full(3, 0.002), 0.01, STRAYING_S, 4.0, LIMIT_M_S), np.array([0.5, -0.2, 0.1])
    path.step(u)
    np.testing.assert_array_equal([path.place_m, path.velocity_m_s], np.zeros((2, 3)))
    path.step(np.zeros(3))
    np.testing.assert_allclose([path.place_m, path.velocity_m_s], [0.01 * u, u], rtol=1e-12)
