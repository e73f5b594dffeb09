"""The push that guidance anticipates, and what it learns of it."""

import numpy as np
import pytest

from dockair.nav.guidance.bow_wave_push import BowWavePush

PUSH = BowWavePush(radius_m=0.75)


def test_it_is_a_source_s_flow_away_from_the_nose_turned_into_an_acceleration():
    """u/V = R^2/4 / r^2 along r: at r = (2, -1, 2), |r| = 3, the flow across is 0.140625/9 (-1, 2)/3."""
    p = np.array(PUSH.source_from_tip_m) + [2.0, -1.0, 2.0]
    expected = PUSH.side_acceleration_m_s2 * 0.140625 / 9.0 * np.array([0.0, -1.0, 2.0]) / 3.0
    np.testing.assert_allclose(PUSH.at(p), expected, rtol=1e-12)


def test_the_drogue_of_a_probe_right_of_the_nose_goes_to_the_right_and_up_and_more_so_close_to_it():
    near, far = PUSH.at(np.zeros(3)), PUSH.at(np.array([4.0, 0.0, 0.0]))
    assert near[1] < far[1] < 0.0 < far[2] < near[2]
    assert far[1] > 0.1 * near[1]


def test_without_a_bow_wave_nothing_is_pushed_and_within_the_body_it_falls_linearly_to_nothing():
    """On the sphere of radius R/2 about the source u is V along r."""
    assert not BowWavePush().at(np.array([0.5, 0.0, 0.0])).any()
    source, across = np.array(PUSH.source_from_tip_m), np.array([0.0, 0.6, 0.8])
    for share, pushed in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (2.0, 0.25)):  # of R/2, and of c
        expected = pushed * PUSH.side_acceleration_m_s2 * across
        np.testing.assert_allclose(PUSH.at(source + share * 0.5 * PUSH.radius_m * across), expected, rtol=1e-12)


def test_a_share_of_a_miss_is_learnt_and_never_more_than_the_bow_wave_could_do():
    aim = PUSH.learnt(np.zeros(2), np.array([0.05, -0.1]))
    np.testing.assert_allclose(aim, [0.02, -0.04], rtol=1e-12)
    for _ in range(50):
        aim = PUSH.learnt(aim, np.array([3.0, 4.0]))
    assert np.hypot(*aim) == pytest.approx(PUSH.learnt_max_m)
    np.testing.assert_allclose(aim / np.hypot(*aim), [0.6, 0.8], atol=1e-3)


def test_where_the_drogue_swings_more_slowly_it_is_pushed_less():
    """c = omega^2 L: at 0.61 of the dynamic pressure the swing has 0.61^0.4 of its frequency."""
    push = BowWavePush(radius_m=0.9)
    at = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(push.at_pressure(0.61 * 10_690.0).at(at), 0.61**0.8 * push.at(at), rtol=1e-12)
