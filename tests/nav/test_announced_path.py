"""The path that was announced, what the tanker's own is learnt to differ by, and what guidance makes of it."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from dockair.messages import Light, PodSignal, ReceiverCommand, TankerAnnouncement
from dockair.nav.guidance.announced_path import AnnouncedPath, AnnouncedPathSettings
from dockair.nav.guidance.approach import Guidance, GuidanceSettings, PhaseLimits, RelativeState
from dockair.nav.guidance.formation import Formation
from dockair.nav.guidance.phases import Phase
from dockair.rotations import exp, log

TURN, AIRSPEED, GRAVITY = 0.0254, 180.0, 9.80665


def _said(starts_s=2.0, entry_s=10.0, turn=TURN, climb=0.0, at_s=0.0):
    return TankerAnnouncement(
        time_stamp_s=at_s, starts_s=starts_s, entry_s=entry_s, turn_rate_rad_s=turn, climb_rad=climb
    )


def _flown(path, seconds, step_s=0.01):
    out = []
    for _ in range(round(seconds / step_s)):
        path.step(step_s)
        out.append((path.turn_rate_rad_s, path.climb_rad))
    return np.array(out)


def _step(u):
    """The simulator's own, written down again."""
    u = min(max(u, 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


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


def test_changes_come_in_the_order_in_which_they_begin_whatever_was_said_first():
    told, other = AnnouncedPath(), AnnouncedPath()
    early, late = _said(starts_s=2.0), _said(starts_s=20.0, turn=0.0)
    for path, said in ((told, (early, late)), (other, (late, early))):
        for announcement in said:
            path.announce(announcement)
    flown = _flown(told, 35.0)
    np.testing.assert_array_equal(_flown(other, 35.0), flown)
    assert flown[1500, 0] == pytest.approx(TURN) and flown[-1, 0] == pytest.approx(0.0)


def test_a_change_that_begins_while_the_last_one_comes_in_goes_on_from_where_that_has_come_to():
    path = AnnouncedPath()
    path.announce(_said(starts_s=0.0, entry_s=6.0))
    path.announce(_said(starts_s=3.0, entry_s=6.0, turn=0.0, climb=-0.05))
    turn = _flown(path, 10.0)[:, 0]
    assert turn[298] == pytest.approx(0.5 * TURN, rel=0.02) and turn[-1] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(np.diff(turn)).max() < 1.1 * 1.875 * TURN * 0.01 / 6.0  # the step's steepest


def test_bank_of_a_turn_is_that_of_coordinated_flight():
    path = AnnouncedPath()
    path.announce(_said(starts_s=0.0, entry_s=0.1, turn=GRAVITY * np.tan(np.radians(25.0)) / AIRSPEED))
    _flown(path, 1.0)
    assert np.degrees(path.bank_rad) == pytest.approx(-25.0)  # left wing down


def _behind(path, less, late_s, bias, seconds, swing=lambda t: 0.0, rng=None, step_s=0.01):
    """Fly the path behind a tanker that turns by a share `less` less and begins late; return v and e true and learnt.

    v' = V (turn flown by the tanker - turn flown by the receiver), written down again.
    """
    v, rows = bias, []
    noise = 0.0 if rng is None else np.sqrt(AnnouncedPathSettings().swing_m2_s / step_s)
    for k in range(round(seconds / step_s)):
        t = k * step_s
        path.step(step_s, v + swing(t) + (noise * rng.standard_normal() if noise else 0.0))
        v += AIRSPEED * (TURN * (1.0 - less) * _step((t + step_s - 2.0 - late_s) / 10.0) - path.flown_rad_s) * step_s
        rows.append((v, less, path.left_m_s, path._e))
    return np.array(rows)


def test_a_turn_that_is_less_than_announced_is_learnt_and_the_path_leans_on_it():
    """Swings of a drogue to and fro, 0.3 m/s, hide neither the velocity nor the turn that the error leaves."""
    path = AnnouncedPath()
    path.announce(_said())
    v, e, v_learnt, e_learnt = _behind(path, 0.02, 0.2, -0.2, 40.0, swing=lambda t: 0.3 * np.cos(2.1 * t)).T
    assert np.abs(v).max() > 0.8  # what there is to learn
    assert e_learnt[2200] == pytest.approx(e[0], rel=0.25)  # 10 s after the turn has come in
    assert e_learnt[-1] == pytest.approx(e[0], rel=0.1)
    assert abs(v_learnt[-1] - v[-1]) < 0.03
    assert abs(v[-1]) < 0.05 * np.abs(v).max()
    assert path.flown_rad_s == pytest.approx(0.98 * TURN, rel=2e-3)


def test_a_descent_that_is_announced_in_a_turn_leaves_what_was_learnt_of_the_turn():
    """The turn goes on at the same rate, and with the same error; another rate has another one."""
    learnt = {}
    for turn in (TURN, 1.01 * TURN):
        path = AnnouncedPath()
        path.announce(_said())
        path.announce(_said(starts_s=40.0, entry_s=5.0, turn=turn, climb=-0.03))
        _behind(path, 0.02, 0.2, -0.2, 39.9)
        before = path._e
        for _ in range(20):
            path.step(0.01)
        learnt[turn] = path._e, before
    assert before == pytest.approx(0.02, rel=0.1)
    assert learnt[TURN][0] == learnt[TURN][1]
    assert learnt[1.01 * TURN][0] == 0.0


def test_a_descent_that_comes_in_sooner_or_later_than_said_makes_no_velocity_to_the_side_less_known():
    """The turn goes on as it was: only what changes of it may come in late."""
    known = []
    for descends in (False, True):
        path = AnnouncedPath()
        path.announce(_said())
        if descends:
            path.announce(_said(starts_s=30.0, entry_s=5.0, climb=-0.03))
        _behind(path, 0.02, 0.2, -0.2, 34.0)
        assert (path.climb_rad < 0.0) is descends
        known.append(path._covariance)
    np.testing.assert_allclose(known[1], known[0], rtol=1e-9)


def test_the_share_by_which_a_turn_is_another_than_announced_wanders():
    """As it was told, (sigma / r)^2, and the wander's density times the time in which nothing is seen."""
    path, s, seconds = AnnouncedPath(), AnnouncedPathSettings(), 40.0
    path.announce(_said(starts_s=0.0))
    path.step(0.01)
    _flown(path, seconds)
    expected = (s.turn_rate_sigma_rad_s / TURN) ** 2 + s.wander_1_sqrt_s**2 * seconds
    assert path._covariance[2] == pytest.approx(expected, rel=1e-9)


def test_another_turn_leaves_what_was_learnt_of_the_velocity_as_well_known_as_it_was():
    """A drogue that swings by 1 m/s for a tick then moves what is learnt as little as before, not as at the first."""
    moved = {}
    for when, seconds, turns in (("at first", 0.0, False), ("later", 30.0, False), ("later, anew", 30.0, True)):
        path = AnnouncedPath()
        path.announce(_said(starts_s=60.0))
        if turns:
            path.announce(_said(starts_s=30.0, entry_s=0.0, turn=0.01))
        for _ in range(round(seconds / 0.01) + 2):
            path.step(0.01, 0.0)
        path.step(0.01, 1.0)
        moved[when] = path.left_m_s
    assert moved["later"] < 0.5 * moved["at first"]
    assert moved["later, anew"] == pytest.approx(moved["later"], rel=0.05)


def test_nothing_is_learnt_of_a_path_before_one_is_announced():
    path = AnnouncedPath()
    for _ in range(100):
        path.step(0.01, 0.5)
    assert path.left_m_s == path.flown_rad_s == 0.0


def test_without_sight_of_the_drogue_the_path_goes_on_as_learnt():
    path = AnnouncedPath()
    path.announce(_said())
    *_, (v, _, learnt, share) = _behind(path, 0.01, 0.0, 0.2, 20.0)
    for _ in range(500):
        path.step(0.01)
    assert path._e == share
    assert path.left_m_s == pytest.approx(learnt * np.exp(-5.0 * AnnouncedPathSettings().lean_1_s), rel=1e-2)
    assert v != 0.0


def test_errors_of_what_is_learnt_are_as_large_as_the_filter_says():
    """Forty turns with errors as announced ones have; chi-square of 80, false alarm 1 in 1000 on each side."""
    s, total, rng = AnnouncedPathSettings(), 0.0, np.random.default_rng(5)
    for _ in range(40):
        path = AnnouncedPath()
        path.announce(_said())
        less, late = s.turn_rate_sigma_rad_s / TURN * rng.standard_normal(), s.start_sigma_s * rng.standard_normal()
        rows = _behind(path, less, late, s.velocity_sigma_m_s * rng.standard_normal(), 18.0, rng=rng)
        vv, ve, ee = path._covariance
        off = rows[-1, 2:] - rows[-1, :2]
        total += off @ np.linalg.solve([[vv, ve], [ve, ee]], off)
    assert 46.5 < total < 124.8


class TurningPlant:
    """The drogue hangs straight behind a tanker that turns; the receiver flies its path and, a response later, u.

    W moves with the tanker's first velocity and does not turn; nor does the bias of the receiver's velocity.
    """

    RATE_HZ, TRAIL_M, DEPTH_M = 50, 15.0, 0.3

    def __init__(self, less_rad_s, late_s):
        self.less, self.late, self.bias = less_rad_s, late_s, np.array([0.2, -0.15, 0.1])
        self.t, self.heading, self.path, self.R_WB = 0.0, 0.0, 0.0, np.eye(3)
        self.p_WT, self.p_WP = np.zeros(3), np.array([-self.TRAIL_M - 4.0, 0.2, -0.2])
        self.latched, self.offset_m = False, np.nan
        self.waiting = [deque([0.0] * round(tau * self.RATE_HZ)) for tau in GuidanceSettings().response_s]
        self.p_PD_B = self.R_WB.T @ (self.p_WD - self.p_WP)

    @property
    def R_WT(self):
        return exp(np.array([0.0, 0.0, self.heading]))

    @property
    def p_WD(self):
        if self.latched:
            return self.p_WP - self.R_WB[:, 0] * self.DEPTH_M
        return self.p_WT - self.R_WT[:, 0] * self.TRAIL_M

    @property
    def tip_T(self):
        """(3,) the probe's tip from the tanker, along and across its way."""
        return self.R_WT.T @ (self.p_WP - self.p_WT)

    def step(self, command):
        dt, before, R_before = 1.0 / self.RATE_HZ, self.p_PD_B, self.R_WB
        self.heading += (TURN - self.less) * _step((self.t - 2.0 - self.late) / 10.0) * dt
        self.path += command.turn_rate_rad_s * dt
        bank = -np.arctan(AIRSPEED * command.turn_rate_rad_s / GRAVITY)
        self.R_WB = exp(np.array([0.0, 0.0, self.path])) @ exp(np.array([bank, 0.0, 0.0]))
        for queue, v in zip(self.waiting, command.velocity_m_s, strict=True):
            queue.append(v)
        own = self.R_WB @ np.array([queue.popleft() for queue in self.waiting]) + self.bias
        self.p_WT = self.p_WT + AIRSPEED * (self.R_WT[:, 0] - [1.0, 0.0, 0.0]) * dt
        ahead = np.array([np.cos(self.path) - 1.0, np.sin(self.path), 0.0])
        self.p_WP = self.p_WP + (AIRSPEED * ahead + own) * dt
        self.t += dt
        self.p_PD_B = self.R_WB.T @ (self.p_WD - self.p_WP)
        if before[0] >= 0.0 > self.p_PD_B[0]:
            self.offset_m = float(np.hypot(*self.p_PD_B[1:]))
        self.latched = self.latched or self.p_PD_B[0] < -self.DEPTH_M
        return RelativeState(
            usable=True,
            contact_usable=True,
            p_PD_B=self.p_PD_B,
            rate_PD_B=(self.p_PD_B - before) / dt,
            p_PK_B=self.p_PD_B + [self.DEPTH_M, 0.0, 0.0],
            w_WB_B=log(R_before.T @ self.R_WB) / dt,
            dv_WP_B=np.full(3, np.nan),
            sigma_lateral_m=0.0,
        )


@pytest.mark.parametrize(("less_rad_s", "late_s"), [(6e-4, 0.3), (-6e-4, 0.2)])
def test_in_a_turn_that_is_not_quite_the_announced_one_the_probe_meets_the_drogue_and_stays_with_it(less_rad_s, late_s):
    """Two sigma of rate and beginning; the drogue on the probe says nothing about the tanker, and is not led away."""
    plant = TurningPlant(less_rad_s, late_s)
    guidance = Guidance(GuidanceSettings(limits=PhaseLimits(stabilise_s=20.0)), plant.RATE_HZ)
    guidance.announce(_said())
    command, across, learnt, late = ReceiverCommand(), [], set(), []
    while guidance.phase is not Phase.DISCONNECT and plant.t < 60.0:
        if guidance.phase is Phase.HOLD:
            guidance.signal(PodSignal(time_stamp_s=plant.t, light=Light.GREEN))
        before, command = command, guidance.step(plant.step(command))
        if guidance.phase is Phase.HOLD:  # velocity and its rate go out together
            change = (command.velocity_m_s - before.velocity_m_s) * plant.RATE_HZ
            late.append(np.abs(change - command.acceleration_m_s2).max())
        if plant.latched:
            across.append(plant.tip_T[1:])
        if guidance._closure.committed:  # the drogue is pushed about from now on
            learnt.add(guidance._formation.path._e)
    assert guidance.phase is Phase.DISCONNECT
    assert plant.offset_m < 0.03
    assert len(learnt) == 1
    assert max(late[2:]) < 0.004
    assert np.hypot(*(np.array(across) - across[0]).T).max() < 0.2  # unlearnt, and with the turn left out, 1.4 m
    assert command.turn_rate_rad_s == pytest.approx(TURN - less_rad_s, abs=0.2 * abs(less_rad_s))


def _astern(left_m, dv_m_s=np.nan):
    """The drogue at rest 4 m ahead."""
    return RelativeState(
        usable=True,
        contact_usable=True,
        p_PD_B=np.array([4.0, left_m, 0.0]),
        rate_PD_B=np.zeros(3),
        p_PK_B=np.array([4.3, left_m, 0.0]),
        w_WB_B=np.zeros(3),
        sigma_lateral_m=0.01,
        dv_WP_B=np.full(3, dv_m_s),
    )


def test_a_descent_is_flown_as_announced():
    guidance = Guidance(GuidanceSettings(), 100)
    guidance.announce(_said(starts_s=0.0, entry_s=0.1, turn=0.0, climb=-0.05))
    still = _astern(0.0)
    for _ in range(50):
        command = guidance.step(still)
    assert (command.turn_rate_rad_s, command.climb_rad) == (0.0, -0.05)
    np.testing.assert_allclose(command.velocity_m_s[1:], 0.0, atol=1e-9)


def test_what_a_tip_feels_once_a_turn_is_announced_is_not_flown_against():
    commands = []
    for felt in (np.nan, 0.02):
        guidance = Guidance(GuidanceSettings(), 100)
        guidance.announce(_said())
        near = _astern(0.1, felt)
        commands.append(np.array([guidance.step(near).velocity_m_s for _ in range(100)]))
    np.testing.assert_array_equal(*commands)


def test_a_drogue_out_of_view_turns_with_the_tanker_where_it_is_reckoned_and_no_longer_than_that():
    """Eq. (1) of `formation`, n x p: the receiver falls back from 4 m to 10 m in the turn; then it is over."""
    guidance = Guidance(GuidanceSettings(), 100)
    guidance.announce(_said(starts_s=0.0, entry_s=0.1))
    guidance.announce(_said(starts_s=20.0, entry_s=0.1, turn=0.0))
    seen = _astern(0.0)
    for _ in range(200):
        guidance.step(seen)
    unseen = replace(seen, usable=False, contact_usable=False)
    for _ in range(800):
        guidance.step(unseen)
    ahead_m = guidance._reckoning.place_m[0]
    assert 9.0 < ahead_m < 12.0
    np.testing.assert_allclose(
        guidance._formation._turned[0], guidance._axes.turned(guidance._reckoning.place_m), atol=1e-3
    )
    assert np.hypot(*guidance._formation._turned[0, 1:]) == pytest.approx(TURN * ahead_m, rel=0.05)
    for _ in range(1100):
        guidance.step(unseen)
    np.testing.assert_array_equal(guidance._formation._turned, np.zeros((2, 3)))


def test_what_is_learnt_of_the_path_begins_with_what_was_commanded_before_it_was_announced():
    """A drogue that stays where it is while the receiver is told to go left goes left as fast."""
    guidance = Guidance(GuidanceSettings(), 100)
    beside = _astern(1.0)
    for _ in range(100):
        command = guidance.step(beside)
    guidance.announce(_said(starts_s=30.0))
    learnt = []
    for _ in range(2):
        guidance.step(beside)
        learnt.append(guidance._formation.path.left_m_s)
    assert command.velocity_m_s[1] > 0.1
    assert learnt[0] > 0.4 * learnt[1] > 0.0


def test_a_forecast_of_the_drogue_says_nothing_about_the_path():
    """One that is older than frames may be is of the fusion's own making: it leads nobody aside."""
    learnt = []
    for age_s in (0.02, 0.2):
        guidance = Guidance(GuidanceSettings(), 100)
        guidance.announce(_said())
        for _ in range(100):
            guidance.step(_astern(0.0))
        before = guidance._formation.path.left_m_s
        aside = replace(_astern(0.0), rate_PD_B=np.array([0.0, 0.2, 0.0]), age_s=age_s)
        guidance.step(aside)
        guidance.step(aside)
        learnt.append(guidance._formation.path.left_m_s - before)
    assert learnt[0] > 0.0 and learnt[1] == 0.0


@pytest.mark.parametrize(
    ("phase", "committed", "learns"),
    [
        (Phase.JOIN_UP, False, True),
        (Phase.PRE_CONTACT, False, True),
        (Phase.APPROACH, False, True),
        (Phase.APPROACH, True, False),
        (Phase.HOLD, False, False),
        (Phase.DISCONNECT, False, False),
        (Phase.BACK_OFF, False, False),
        (Phase.BREAKAWAY, False, False),
        (Phase.CLEAR, False, True),
    ],
)
def test_a_drogue_that_is_pushed_or_got_away_from_says_nothing_about_the_path(phase, committed, learns):
    """Only one that is followed, and before it comes into the bow wave, tells how the tanker goes aside."""
    guidance = Guidance(GuidanceSettings(), 100)
    guidance.announce(_said())
    guidance.step(_astern(0.0))
    guidance.phase, guidance._closure.committed = phase, committed
    guidance.step(replace(_astern(0.0), rate_PD_B=np.array([0.0, 0.2, 0.0])))
    assert bool(guidance._formation.path.left_m_s > 0.0) is learns


def test_in_a_turn_the_drogue_stays_on_the_probe_where_it_was_seen_whatever_is_reckoned_of_it():
    """Out of view for a moment of a hold, while the receiver pushes it in; n x p of Eq. (1) of `formation`."""
    guidance = Guidance(GuidanceSettings(), 100)
    guidance.announce(_said(starts_s=0.0, entry_s=0.1))
    place = np.array([-0.3, 0.05, 0.0])
    seen = replace(_astern(0.0), p_PD_B=place, p_PK_B=place + [0.3, 0.0, 0.0])
    moves = np.array([0.1, -0.2, 0.3])
    for _ in range(20):
        guidance.step(replace(seen, rate_PD_B=moves))
    axes = guidance._axes
    np.testing.assert_allclose(guidance._formation._turned[1], axes.turned(axes.R_NB @ moves), atol=1e-3)
    guidance.step(seen)
    guidance.phase = Phase.HOLD
    for _ in range(40):
        guidance.step(replace(seen, usable=False, rate_PD_B=np.array([0.5, 0.5, 0.5])))
    assert guidance.phase is Phase.HOLD
    assert np.linalg.norm(guidance._reckoning.place_m - place) > 0.05
    np.testing.assert_allclose(guidance._formation._turned, [axes.turned(axes.R_NB @ place), np.zeros(3)], atol=1e-4)


def test_how_far_the_drogue_was_pushed_in_leads_nobody_aside_once_it_is_off():
    """In a turn, beside a drogue near by: to keep company with it is all."""
    guidance = Guidance(GuidanceSettings(), 100)
    guidance.announce(_said(starts_s=0.0, entry_s=0.1))
    ahead = replace(_astern(0.0), p_PD_B=np.array([0.5, 0.0, 0.0]))
    for _ in range(20):
        guidance.step(ahead)
    guidance.phase, guidance._take_in.pushed_in_m = Phase.BACK_OFF, 2.5
    for _ in range(300):
        guidance.step(ahead)
    assert guidance.phase is Phase.BACK_OFF
    np.testing.assert_allclose(guidance._u[1:], guidance._controller.drift_m_s[1:], atol=0.01)


def test_what_the_path_is_told_of_a_drogue_that_keeps_company_is_what_is_commanded_to_the_left(monkeypatch):
    """Wherever it is: what the turn of the axes does to its place is in the command, Eq. (1) of `formation`."""
    formation, told, u = Formation(GuidanceSettings(), 0.01), [], np.array([0.1, 0.2, -0.3])
    formation.path.announce(_said(starts_s=0.0, entry_s=0.1))
    _flown(formation.path, 1.0)
    for _ in range(2):  # by then it does not roll any more
        formation.turn(np.zeros(3))
    monkeypatch.setattr(formation.path, "step", lambda step_s, left_m_s=None: told.append(left_m_s))
    place = np.array([4.0, 1.0, 0.5])
    assert abs(formation.axes.turned(place) @ formation.axes.left_N) > 0.05
    for _ in range(2):
        formation.follow(place, np.zeros(3), learns=True)
        formation.command(u, np.zeros(3))
    assert told[1] == pytest.approx(u @ formation.axes.left_N, abs=1e-12)
