"""The closure speed and the last moment, on a tip that answers late."""

import dataclasses

import numpy as np
import pytest

from dockair.nav.guidance.closing import ClosingSettings
from dockair.nav.guidance.closure import Closure

SETTINGS, STEP_S, FULL_M_S, RAMP_M_S2 = ClosingSettings(), 0.01, 1.2, 0.6
LAG_S, BRAKES_M_S2 = 0.3, 0.75
DEPTH_M = 0.3  # ring plane to coupling


def _flown(moment, seconds=60.0, settings=SETTINGS, start_m=4.0, blown_m_s=0.0, brakes=BRAKES_M_S2):
    """Distance and speed tick by tick of a tip with a first-order lag; `moment(t, distance)` says miss and unrest."""
    closure, distance, speed, out = Closure(settings, FULL_M_S, RAMP_M_S2, STEP_S), start_m, blown_m_s, []
    for i in range(round(seconds / STEP_S)):
        miss, unrest = moment(i * STEP_S, distance)
        closure.step(distance, distance + DEPTH_M, speed, known=np.isfinite(miss), miss=miss, unrest=unrest)
        wanted = (closure.speed_m_s + blown_m_s - speed) / LAG_S
        speed += STEP_S * float(np.clip(wanted, -brakes, brakes))
        distance -= STEP_S * speed
        out.append((distance, speed, closure.committed))
        if distance <= 0.0:
            break
    return np.array(out)


def test_in_calm_air_it_closes_without_a_halt_and_arrives_at_full_speed():
    path = _flown(lambda t, d: (0.5, 0.5))
    assert path[-1, 0] <= 0.0
    assert path[-1, 1] == pytest.approx(FULL_M_S, abs=0.1)
    assert len(path) * STEP_S < 6.5


@pytest.mark.parametrize(("miss", "unrest"), [(1.3, 0.5), (0.5, 1.3), (float("nan"), 0.5)])
def test_a_moment_that_is_not_good_at_the_last_is_called_back_short_of_the_ring(miss, unrest):
    path = _flown(lambda t, d: (0.5, 0.5) if d > 1.8 else (miss, unrest), 12.0)
    assert not path[:, 2].any()
    assert 0.2 < path[:, 0].min() < 1.5
    assert path[:, 0].max() <= 4.0
    assert path[path[:, 0].argmin() :, 0].max() > SETTINGS.wait_at_m


@pytest.mark.parametrize(
    ("miss", "unrest", "committed"), [(0.99, 0.5, True), (1.01, 0.5, False), (0.5, 0.99, True), (0.5, 1.01, False)]
)
def test_at_the_last_moment_neither_miss_nor_swing_may_be_more_than_one(miss, unrest, committed):
    """Run up far off, then 1.5 m from the ring, of the 1.8 m that it stops within."""
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    for _ in range(200):
        closure.step(4.0, 4.0 + DEPTH_M, closure.speed_m_s, known=True, miss=0.5, unrest=0.5)
    assert closure.speed_m_s == SETTINGS.run_up_m_s and not closure.committed
    closure.step(1.5, 1.5 + DEPTH_M, closure.speed_m_s, known=True, miss=miss, unrest=unrest)
    assert closure.committed is committed


def test_called_back_it_runs_up_again_and_meets_the_next_good_moment_at_speed():
    path = _flown(lambda t, d: (0.5, 1.3 if t < 8.0 and d < 1.8 else 0.5))
    turned = path[:, 0].argmin() if path[-1, 0] > 0.0 else path[: round(8.0 / STEP_S), 0].argmin()
    assert path[turned, 0] > 0.2
    assert path[-1, 0] <= 0.0
    assert path[-1, 1] > 1.0


def test_a_moment_that_turns_good_too_near_is_not_taken_slowly():
    path = _flown(lambda t, d: (2.5 if d < 1.9 and t < 5.0 else 0.5, 0.5))
    assert path[-1, 1] > 1.0
    assert path[np.flatnonzero(path[:, 2])[0], 0] > 0.9


def test_once_committed_nothing_calls_it_back():
    path = _flown(lambda t, d: (0.5, 0.5) if d > 1.2 else (9.0, 9.0), 8.0)
    assert path[-1, 0] <= 0.0
    assert path[-1, 1] > 1.0


def test_a_standing_receiver_waits_for_calm_and_a_running_one_for_hope():
    standing = _flown(lambda t, d: (0.5, 1.2), 10.0)
    assert np.ptp(standing[:, 0]) < 1e-9
    running = _flown(lambda t, d: (0.5, 0.9 if t < 1.0 else 1.2), 3.0)
    assert running[-1, 1] > 0.7


@pytest.mark.parametrize(("unrest", "goes"), [(1.0, True), (1.01, False)])
def test_of_a_standing_receiver_the_swing_is_asked_to_be_calm(unrest, goes):
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    told(closure, 4.0, unrest=unrest)
    assert (closure.speed_m_s > 0.0) is goes


@pytest.mark.parametrize("which", ["miss", "unrest"])
def test_a_running_receiver_goes_on_up_to_what_is_hopeful(which):
    closure = running_up()
    told(closure, 3.5, **{which: SETTINGS.hopeful})
    assert closure.speed_m_s == SETTINGS.run_up_m_s
    told(closure, 3.5, **{which: 1.01 * SETTINGS.hopeful})
    assert closure.speed_m_s < SETTINGS.run_up_m_s


def test_who_has_only_begun_to_run_up_goes_on_in_a_swing_that_nobody_would_begin_in():
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    told(closure, 4.0)
    told(closure, 4.0, unrest=1.2)
    assert closure.speed_m_s == pytest.approx(2.0 * RAMP_M_S2 * STEP_S)


def test_a_tip_that_is_blown_closer_is_called_back_earlier():
    near = [_flown(lambda t, d: (1.3, 0.5), 9.0, blown_m_s=v)[:, 0].min() for v in (0.0, 0.2, 0.4)]
    assert min(near) > SETTINGS.margin_m
    deaf = dataclasses.replace(SETTINGS, margin_m=SETTINGS.margin_m - 0.4)
    assert _flown(lambda t, d: (1.3, 0.5), 9.0, deaf)[:, 0].min() < near[0] - 0.3


def test_an_airframe_that_brakes_half_as_well_is_called_back_short_of_the_ring_too():
    """Blown toward it at 0.2 m/s, and still closes at full speed; with the other's run-up it comes nearer."""
    brakes = 0.38
    settings = SETTINGS.braked_at(brakes)
    near, nearer = (
        _flown(lambda t, d: (1.3, 0.5), 9.0, each, brakes=brakes, blown_m_s=0.2)[:, 0].min()
        for each in (settings, SETTINGS)
    )
    assert near > SETTINGS.margin_m
    assert nearer < near - 0.4
    path = _flown(lambda t, d: (0.5, 0.5), settings=settings, brakes=brakes)
    assert path[-1, 0] <= 0.0
    assert path[-1, 1] == pytest.approx(FULL_M_S, abs=0.1)


def test_its_speed_changes_by_the_ramp_but_when_it_is_called_back_by_the_rate_for_that():
    """Run up, hope lost far off, run up again, called back, and at the place to run up from run up once more."""
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    for distance_m, miss, rate_m_s2, comes_to in (
        (4.0, 0.5, RAMP_M_S2, SETTINGS.run_up_m_s),
        (3.0, 9.0, -RAMP_M_S2, 0.0),
        (3.0, 0.5, RAMP_M_S2, SETTINGS.run_up_m_s),
        (1.9, 9.0, -SETTINGS.recall_m_s2, -SETTINGS.retreat_m_s),
        (SETTINGS.wait_at_m, 0.5, RAMP_M_S2, SETTINGS.run_up_m_s),
    ):
        speeds = []
        for _ in range(round(3.0 / STEP_S)):
            closure.step(distance_m, distance_m + DEPTH_M, closure.speed_m_s, known=True, miss=miss, unrest=0.5)
            speeds.append(closure.speed_m_s)
        assert speeds[1] - speeds[0] == pytest.approx(rate_m_s2 * STEP_S)
        assert speeds[-1] == pytest.approx(comes_to)


def _at(closure, coupling_m, *, miss=0.5, ticks=1):
    for _ in range(ticks):
        closure.step(coupling_m - DEPTH_M, coupling_m, closure.speed_m_s, known=True, miss=miss, unrest=0.5)
    return closure.eases_off


def test_it_eases_off_one_response_time_short_of_the_coupling_and_only_once_committed():
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    assert not _at(closure, 4.0, ticks=500)
    assert not _at(closure, 0.1, miss=9.0)  # called back, and blown there
    closure.begin()
    _at(closure, 4.0, ticks=500)
    assert not _at(closure, 1.5, ticks=100)
    assert closure.committed and closure.speed_m_s == FULL_M_S
    assert not _at(closure, FULL_M_S * SETTINGS.response_s + 1e-6)
    assert _at(closure, FULL_M_S * SETTINGS.response_s - 1e-6)
    assert _at(closure, 1.0)  # a drogue that is pushed away does not make it gain speed again
    assert closure.speed_m_s == FULL_M_S  # by which contact is timed
    closure.begin()
    assert not closure.eases_off


def running_up(full_m_s=FULL_M_S):
    """Run up as fast as it does, 4 m from the ring, in calm air."""
    closure = Closure(SETTINGS, full_m_s, RAMP_M_S2, STEP_S)
    told(closure, 4.0, ticks=200)
    return closure


def told(closure, distance_m, *, ticks=1, known=True, miss=0.5, unrest=0.5):
    for _ in range(ticks):
        at = distance_m, distance_m + DEPTH_M, closure.speed_m_s
        closure.step(*at, known=known, miss=miss, unrest=unrest)


def test_who_is_called_back_is_not_committed_by_a_good_moment_while_it_still_closes():
    """What it has lost of its speed it would not gain again on the rest of the way."""
    closure = running_up()
    told(closure, 1.9, miss=9.0)
    told(closure, 1.4)
    assert closure.speed_m_s > 0.0 and not closure.committed
    told(closure, 1.4, ticks=200)
    assert closure.speed_m_s == -SETTINGS.retreat_m_s and not closure.committed


@pytest.mark.parametrize("distance_m", [0.5, 2.5])
def test_who_stands_too_near_to_gain_its_speed_falls_back_first_however_good_the_moment(distance_m):
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    told(closure, distance_m, ticks=200)
    assert closure.speed_m_s == -SETTINGS.retreat_m_s and not closure.committed
    told(closure, SETTINGS.wait_at_m, ticks=500)
    assert closure.speed_m_s == SETTINGS.run_up_m_s


def test_it_neither_runs_up_nor_is_committed_on_what_contact_may_not_be_flown_on():
    standing = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    told(standing, 4.0, ticks=200, known=False)
    assert standing.speed_m_s == 0.0
    closing = running_up()
    told(closing, 1.5, known=False)
    assert not closing.committed


def test_it_runs_up_no_faster_than_it_is_to_close():
    assert running_up(full_m_s=0.5).speed_m_s == 0.5


def test_it_waits_for_as_long_as_it_has_not_closed_since_it_last_did():
    closure = Closure(SETTINGS, FULL_M_S, RAMP_M_S2, STEP_S)
    told(closure, 4.0, ticks=100, miss=9.0)
    assert closure.waiting_s == pytest.approx(1.0)
    told(closure, 4.0)
    assert closure.speed_m_s > 0.0 and closure.waiting_s == 0.0
    told(closure, 4.0, ticks=10, miss=9.0)
    assert closure.speed_m_s == 0.0 and closure.waiting_s == pytest.approx(0.1, abs=1.1 * STEP_S)
    told(closure, 2.5, ticks=100, miss=9.0)  # falling back is no closing either
    assert closure.speed_m_s < 0.0 and closure.waiting_s == pytest.approx(1.1, abs=1.1 * STEP_S)


def test_every_approach_begins_from_a_stand():
    closure = running_up()
    told(closure, 1.5)
    assert closure.committed
    closure.begin()
    assert (closure.speed_m_s, closure.waiting_s, closure.committed) == (0.0, 0.0, False)
    told(closure, 4.0, ticks=100, miss=9.0)
    closure.begin()
    assert closure.waiting_s == 0.0
