"""Guidance against a plain plant: a receiver that flies the velocity asked for a response time later."""

from collections import deque

import numpy as np
import pytest

from dockair.nav.guidance.approach import Guidance, GuidanceSettings, RelativeState
from dockair.nav.guidance.bow_wave_push import BowWavePush
from dockair.nav.guidance.phases import Phase

RATE_HZ = 100
DEPTH_M = 0.3  # ring plane to coupling
CALM = GuidanceSettings(bow_wave=BowWavePush(at_contact_m=(0.0, 0.0)))  # as most of these plants are
DELAY_S = 0.25  # as the flight control answers a command that comes with its rate


class Plant:
    """Drogue at rest unless held by the probe; the receiver's velocity has a bias that nobody knows."""

    def __init__(
        self, offset=(4.0, 0.3, -0.2), bias=(0.0, 0.0, 0.0), drogue=lambda t: np.zeros(3), holds=True, push=None
    ):
        self.p_WP, self.bias, self.drogue, self.holds = np.zeros(3), np.array(bias), drogue, holds
        self.push = push
        self.p_WD0, self.v, self.t, self.latched, self.take_in = np.array(offset), np.zeros(3), 0.0, False, 0.0
        self.waiting = deque([np.zeros(3)] * round(DELAY_S * RATE_HZ), maxlen=round(DELAY_S * RATE_HZ))
        self.closure_at_contact = self.radial_at_contact = np.nan

    @property
    def p_WD(self):
        coupling_offset = np.array([DEPTH_M, 0.0, 0.0])
        return self.p_WP - coupling_offset if self.latched else self.p_WD0 + self.drogue(self.t) + self.pushed

    @property
    def pushed(self):
        if self.push is None:
            return np.zeros(3)
        x = max(self.p_WD0[0] - self.p_WP[0], 0.0)
        return np.array([0.0, *self.push.at_contact_m]) / (1.0 + x / self.push.reach_m) ** 2

    def step(self, command):
        before, dt = self.p_WD - self.p_WP, 1.0 / RATE_HZ
        self.v = self.waiting[0] + self.bias
        self.waiting.append(command.velocity_m_s)
        self.p_WP = self.p_WP + self.v * dt
        self.t += dt
        after = self.p_WD - self.p_WP
        rate = (after - before) / dt
        if self.latched:
            self.take_in += self.v[0] * dt
            self.latched = self.take_in > -0.05
        elif self.holds and np.isnan(self.closure_at_contact) and after[0] < -DEPTH_M:
            self.latched, self.closure_at_contact = True, -rate[0]
            self.radial_at_contact = float(np.hypot(after[1], after[2]))
        return RelativeState(
            usable=True, p_PD_B=after, rate_PD_B=rate, p_PK_B=after + [DEPTH_M, 0, 0], sigma_lateral_m=0.0
        )


def fly(plant, seconds=60.0, settings=None):
    guidance = Guidance(settings or CALM, RATE_HZ)
    phases, take_in = [guidance.phase], []
    state = plant.step(guidance.step(plant.step(_still())))
    for _ in range(int(seconds * RATE_HZ)):
        state = plant.step(guidance.step(state))
        if guidance.phase is not phases[-1]:
            phases.append(guidance.phase)
        if guidance.phase is Phase.HOLD:
            take_in.append(plant.take_in)
        if guidance.phase is Phase.CLEAR:
            break
    return phases, np.array(take_in)


def _still():
    from dockair.messages import ReceiverCommand

    return ReceiverCommand()


@pytest.mark.parametrize("bias", [(0.0, 0.0, 0.0), (0.2, -0.3, 0.3)])
def test_docks_through_every_phase_whatever_the_bias_of_the_velocity(bias):
    plant = Plant(bias=bias)
    phases, take_in = fly(plant)
    assert phases == [
        Phase.PRE_CONTACT,
        Phase.APPROACH,
        Phase.CONTACT,
        Phase.HOLD,
        Phase.DISCONNECT,
        Phase.CLEAR,
    ]
    assert 1.1 < plant.closure_at_contact < 1.3
    assert plant.radial_at_contact < 0.02
    assert np.abs(take_in - GuidanceSettings().limits.take_in_m).max() < 0.4


def test_closure_speed_is_relative_to_a_drifting_drogue():
    plant = Plant(drogue=lambda t: np.array([0.15, 0.1, 0.0]) * t)
    fly(plant)
    assert plant.closure_at_contact == pytest.approx(1.2, abs=0.05)
    assert plant.radial_at_contact < 0.02


def test_follows_a_slow_swing_of_the_drogue():
    plant = Plant(drogue=lambda t: 0.2 * np.array([0.0, np.sin(0.3 * t), np.cos(0.3 * t)]))
    fly(plant)
    assert plant.radial_at_contact < 0.05  # of 0.2 m


def test_the_push_of_its_own_bow_wave_is_met_where_it_will_be_at_contact():
    """This plant's drogue gives way at once, and its receiver lags by its delay alone: a shorter lead is right."""
    missed = []
    for settings in (CALM, GuidanceSettings(bow_wave=BowWavePush(lead_s=0.2))):
        plant = Plant(push=BowWavePush())
        fly(plant, settings=settings)
        missed.append(plant.radial_at_contact)
    assert missed[0] > 0.02 and missed[1] < 0.5 * missed[0]


def test_breaks_away_when_the_drogue_does_not_come_along():
    phases, _ = fly(Plant(holds=False))
    assert phases[-2:] == [Phase.BREAKAWAY, Phase.CLEAR]


def test_does_not_close_on_an_unusable_state():
    guidance = Guidance(GuidanceSettings(), RATE_HZ)
    state = RelativeState(
        usable=False,
        p_PD_B=np.array([4.0, 0, 0]),
        rate_PD_B=np.zeros(3),
        p_PK_B=np.array([4.3, 0, 0]),
        sigma_lateral_m=1.0,
    )
    for _ in range(10 * RATE_HZ):
        command = guidance.step(state)
    assert guidance.phase is Phase.PRE_CONTACT
    assert not command.velocity_m_s.any()


def test_commands_respect_their_limits():
    settings = GuidanceSettings()
    guidance = Guidance(settings, RATE_HZ)
    state = RelativeState(
        usable=True,
        p_PD_B=np.array([30.0, 20, 9]),
        rate_PD_B=np.zeros(3),
        p_PK_B=np.array([30.3, 20, 9]),
        sigma_lateral_m=0.0,
    )
    for _ in range(10 * RATE_HZ):
        command = guidance.step(state)
        assert np.linalg.norm(command.velocity_m_s) <= settings.velocity_limit_m_s * (1 + 1e-12)
        assert np.linalg.norm(command.acceleration_m_s2) <= settings.acceleration_limit_m_s2 * (1 + 1e-12)
