"""Hose whip: what hose, reel and coupling do after contact, with a probe on rails that slows down evenly to a stop."""

from dataclasses import dataclass

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.rotations import Array

STOP_M = 3.0


@dataclass
class Contact:
    """One run from the moment at which the coupling holds, a row a millisecond."""

    static_n: float
    tension_n: Array
    pull_n: Array
    latched: Array
    wound_in_m: Array
    shapes: list[Array]

    @property
    def bow_m(self) -> Array:
        return np.array([bow(shape) for shape in self.shapes])


def bow(p_WH: Array) -> float:
    """Greatest distance of the hose outside the pod from the straight line between exit and end."""
    along = p_WH[-1] / np.linalg.norm(p_WH[-1])
    outside = p_WH[p_WH[:, 0] <= 0.0]
    return float(np.linalg.norm(outside - np.outer(outside @ along, along), axis=1).max(initial=0.0))


def engage(make_world, speed_m_s: float, *, dead: bool, duration_s: float, **overrides: dict[str, float]) -> Contact:
    world = make_world(p_PD_B=(0.1, 0.0, 0.0), reel_locked=lambda time_s: dead, **overrides)
    while not world.truth.latched:
        assert world.step(_forward(speed_m_s)).p_DP[0] < 1.0
    rows, shapes = [], []
    for tick in range(round(1000 * duration_s)):
        speed = max(speed_m_s - 0.5 * speed_m_s**2 / STOP_M * tick * 1e-3, 0.0)
        truth = world.step(_forward(speed))
        rows.append((truth.root_tension_n, truth.coupling_force_n, truth.latched, truth.reel_position_m))
        if tick % 10 == 0:
            shapes.append(truth.p_WH)
    tension, pull, latched, wound_in = np.array(rows, dtype=float).T
    return Contact(world.rest.root_tension_n, tension, pull, latched > 0.5, wound_in, shapes)


def _forward(speed_m_s: float) -> ReceiverCommand:
    return ReceiverCommand(velocity_m_s=np.array([speed_m_s, 0.0, 0.0]))


@pytest.mark.parametrize("speed", [1.2, 2.5])
def test_working_reel_takes_up_the_slack_and_the_hose_does_not_whip(make_world, speed):
    """Tension hardly ever above its static value, and no wave: the hose stays as straight as it was."""
    contact = engage(make_world, speed, dead=False, duration_s=2.0 * STOP_M / speed)
    assert contact.latched.all()
    assert contact.tension_n.max() < 1.15 * contact.static_n
    assert contact.bow_m.max() < contact.bow_m[0] + 0.1
    assert contact.wound_in_m[-1] == pytest.approx(STOP_M, abs=0.1)


def test_dead_reel_lets_the_hose_bow_whip_and_come_off_the_probe(make_world):
    """The inextensible hose has nowhere to go but aside, and snaps back taut."""
    contact = engage(make_world, 1.2, dead=True, duration_s=4.0)
    assert np.abs(contact.wound_in_m).max() < 0.15
    assert contact.bow_m.max() > 1.0
    assert contact.tension_n.max() > 2.0 * contact.static_n
    assert (contact.tension_n < 0.3 * contact.static_n).sum() > 200  # slack before it
    assert not contact.latched[-1]


def test_hose_behind_a_locked_drum_keeps_its_length_while_its_chord_shortens(make_world):
    """So that it can only bow: the probe has gone 0.1 m and more forward within 0.4 s."""
    contact = engage(make_world, 1.2, dead=True, duration_s=0.4, coupling={"release_force_n": 5000.0})
    shape = contact.shapes[-1]
    assert np.linalg.norm(np.diff(shape, axis=0), axis=1).sum() == pytest.approx(15.0, abs=1e-6)
    chord = [float(np.linalg.norm(s[-1] - s[0])) for s in (contact.shapes[0], shape)]
    assert chord[1] < chord[0] - 0.1


def test_tension_at_the_exit_is_negative_while_the_contact_pushes_the_hose_together(make_world):
    contact = engage(make_world, 1.2, dead=False, duration_s=0.05)
    assert contact.tension_n.min() < 0.0 and contact.pull_n.min() < 0.0
    assert contact.tension_n[-1] > 0.5 * contact.static_n


def test_breakaway_faster_than_the_brake_lets_the_hose_run_is_let_go_long_before_the_outer_stop(make_world):
    world = make_world(p_PD_B=(0.1, 0.0, 0.0))
    while world.truth.reel_position_m < 4.0:
        world.step(_forward(1.2))
    assert world.truth.latched
    tick = 0
    while world.truth.latched:
        tick += 1
        assert tick < 3000
        world.step(_forward(max(1.2 - 5e-3 * tick, -5.0)))
    released_at = world.truth.reel_position_m
    assert released_at > 2.0
    fastest = deepest = 0.0
    for _ in range(4000):
        truth = world.step(_forward(-2.0))
        fastest, deepest = min(fastest, truth.reel_rate_m_s), min(deepest, truth.reel_position_m)
    reel = world.parameters.reel
    assert fastest > -(reel.pay_out_speed_m_s + reel.speed_band_m_s)
    assert -0.1 < deepest < 0.0 and abs(truth.reel_position_m) < 0.01  # back at full trail, unaided
