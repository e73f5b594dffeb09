"""The path that was announced, and what guidance makes of it."""

import numpy as np
import pytest

from dockair.messages import TankerAnnouncement
from dockair.nav.guidance.announced_path import AnnouncedPath
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState

TURN = 0.0254


def _said(starts_s=2.0, entry_s=10.0, turn=TURN, climb=0.0, at_s=0.0):
    return TankerAnnouncement(
        time_stamp_s=at_s, starts_s=starts_s, entry_s=entry_s, turn_rate_rad_s=turn, climb_rad=climb
    )


def _flown(path, seconds, step_s=0.01):
    return np.array([path.step(step_s) for _ in range(round(seconds / step_s))])


def test_path_is_straight_until_something_is_announced():
    path = AnnouncedPath()
    assert not path.is_announced
    np.testing.assert_array_equal(_flown(path, 5.0), 0.0)


def test_heading_of_an_entry_is_half_its_time_at_the_full_rate():
    """The integral of the step over its time is 1/2: closed form, whatever its shape's symmetry."""
    path = AnnouncedPath()
    path.announce(_said())
    turn = _flown(path, 20.0)[:, 0]
    assert turn[:199].max() == 0.0 and turn[1300] == pytest.approx(TURN)
    assert turn.sum() * 0.01 == pytest.approx(TURN * (0.5 * 10.0 + 8.0), rel=2e-3)
    assert turn[699] == pytest.approx(0.5 * TURN, rel=1e-2)


def test_announced_path_is_the_one_that_the_tanker_flies():
    """The simulator's own step, written down again: u^3 (10 - 15 u + 6 u^2) between the same two rates."""
    path = AnnouncedPath()
    path.announce(_said(starts_s=0.0, entry_s=4.0))
    u = np.arange(1, 401) / 400.0
    np.testing.assert_allclose(_flown(path, 4.0)[:, 0], TURN * u**3 * (10 - 15 * u + 6 * u**2), atol=1e-12)


def test_change_announced_while_the_last_one_comes_in_waits_for_its_own_start():
    path = AnnouncedPath()
    path.announce(_said(starts_s=0.0, entry_s=6.0))
    _flown(path, 3.0)
    path.announce(_said(starts_s=12.0, entry_s=2.0, turn=0.0, climb=-0.05, at_s=3.0))
    later = _flown(path, 11.0)
    assert later[400, 0] == pytest.approx(TURN) and later[400, 1] == 0.0
    np.testing.assert_allclose(later[-1], [0.0, -0.05], atol=1e-12)


def test_guidance_commands_the_announced_path_and_leans_on_the_drift_it_sees():
    def drifting(t, turn=0.0):
        drifts, left = t > 2.0, 0.6 * max(t - 2.0, 0.0)  # at first it is at rest: nobody follows a swing unseen yet
        return RelativeState(
            usable=True,
            contact_usable=True,
            p_PD_B=np.array([4.0, left, 0.0]),
            rate_PD_B=np.array([0.0, 0.6 * drifts, 0.0]),
            p_PK_B=np.array([4.3, left, 0.0]),
            w_WB_B=np.array([0.0, 0.0, turn]),
            sigma_lateral_m=0.01,
        )

    silent, told = (Guidance(GuidanceSettings(), 100) for _ in range(2))
    told.announce(_said(starts_s=0.0, entry_s=0.1, climb=-0.05))
    path, turn = AnnouncedPath(), 0.0
    path.announce(_said(starts_s=0.0, entry_s=0.1, climb=-0.05))
    for k in range(300):
        a, b = silent.step(drifting(0.01 * k)), told.step(drifting(0.01 * k, turn))  # the body turns as announced
        turn, _ = path.step(0.01)
    assert (a.turn_rate_rad_s, a.climb_rad) == (0.0, 0.0)
    assert b.climb_rad == -0.05
    assert b.velocity_m_s[1] > 0.3  # the drogue drifts to the left: so does the turn tighten
    assert b.turn_rate_rad_s > TURN + 2e-4
    np.testing.assert_allclose(a.velocity_m_s, b.velocity_m_s, rtol=1e-9)
