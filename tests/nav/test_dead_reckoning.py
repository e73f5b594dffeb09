"""Where a drogue that is out of view should be."""

import numpy as np

from dockair.nav.guidance.dead_reckoning import DeadReckoning
from dockair.nav.guidance.guidance_settings import GuidanceSettings

SETTINGS, STEP_S = GuidanceSettings(), 0.01


def reckoned(ring_m, drift_m_s, u_m_s, ticks, bearable=True):
    reckoning = DeadReckoning(SETTINGS, STEP_S)
    reckoning.step(np.array(ring_m), np.zeros(3), np.zeros(3), bearable=bearable)
    for _ in range(ticks):
        reckoning.step(None, np.array(drift_m_s), np.array(u_m_s), bearable=bearable)
    return reckoning


def test_flies_toward_where_the_drogue_has_drifted_by_its_own_way():
    """Seen 0.2 m left, then 2 s unseen with 0.4 m/s of drift to the left and 0.1 m/s of its own: 0.8 m left."""
    reckoning = reckoned((4.0, 0.2, 0.0), (0.0, 0.4, 0.0), (0.0, 0.1, 0.0), 200)
    np.testing.assert_allclose(reckoning.astern_m_s(), (0.0, 0.8 * SETTINGS.reckoned_gain_1_s, 0.0), atol=1e-9)


def test_a_drift_of_half_a_swing_is_believed_only_so_far():
    reckoning = reckoned((4.0, 0.0, 0.0), (0.0, -3.0, 0.3), (0.0, 0.0, 0.0), 100)
    most = SETTINGS.unseen_drift_m_s
    np.testing.assert_allclose(reckoning.believed(np.array([2.0, -3.0, 0.3])), (most, -most, 0.3))
    np.testing.assert_allclose(reckoning.astern_m_s()[1:], SETTINGS.reckoned_gain_1_s * np.array([-most, 0.3]))


def test_in_gusts_that_cannot_be_borne_less_of_it_is_believed():
    """A receiver in severe gusts (seed 14029, by camera) had sunk 24 m below the drogue by 0.5 m/s in 20 s."""
    reckoning = reckoned((4.0, 0.0, 0.0), (0.0, -3.0, 0.1), (0.0, 0.0, 0.0), 100, bearable=False)
    most = SETTINGS.unseen_drift_in_gusts_m_s
    assert most < SETTINGS.unseen_drift_m_s
    np.testing.assert_allclose(reckoning.believed(np.array([2.0, -3.0, 0.1])), (most, -most, 0.1))


def test_no_faster_than_it_backs_off_and_not_beside_the_drogue():
    far = reckoned((4.0, -9.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1)
    np.testing.assert_allclose(far.astern_m_s(), (0.0, -SETTINGS.back_off_speed_m_s, 0.0))
    beside = reckoned((0.5, -9.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1)
    np.testing.assert_array_equal(beside.astern_m_s(), np.zeros(3))


def test_a_drogue_that_is_seen_again_is_where_it_is_seen():
    reckoning = reckoned((4.0, 1.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.0), 300)
    reckoning.step(np.array([4.0, 0.0, 0.0]), np.zeros(3), np.zeros(3), bearable=True)
    np.testing.assert_array_equal(reckoning.astern_m_s(), np.zeros(3))
