"""What the tanker says beforehand."""

from dataclasses import replace

import numpy as np

from dockair.parameters import load_parameters
from dockair.sim.aircraft.announcer import Announcer, TankerSheet
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters

RACETRACK = TankerPathParameters(
    manoeuvre="racetrack", starts_s=15.0, bank_rad=np.radians(25.0), roll_rate_rad_s=0.1, leg_s=30.0
)
TOBOGGAN = TankerPathParameters(manoeuvre="toboggan", starts_s=15.0, descent_rad=np.radians(3.0))


def _announcer(parameters=RACETRACK, seed=1, **changed):
    path = TankerPath(parameters, 180.0)
    return Announcer(path, load_parameters("tanker_path", TankerSheet, changed), np.random.default_rng(seed)), path


def _heard(announcer, until_s):
    heard = [announcer.due(0.01 * k) for k in range(round(100 * until_s))]
    return [announcement for announcement in heard if announcement is not None]


def test_each_change_is_announced_once_and_as_long_ahead_as_agreed():
    announcer, path = _announcer(start_sigma_s=0.0, turn_rate_sigma_rad_s=0.0)
    heard = _heard(announcer, 400.0)
    times, after = [], -1.0
    while (change := path.change_after(after)) is not None and change.starts_s - 10.0 < 400.0:
        times.append((change.starts_s, change.turn_rate_rad_s, change.entry_s))
        after = change.starts_s
    assert [(a.starts_s, a.turn_rate_rad_s, a.entry_s) for a in heard] == times
    ahead_s = load_parameters("tanker_path", TankerSheet).announced_ahead_s
    for announcement in heard:  # asked every 0.01 s
        assert 0.0 <= announcement.time_stamp_s - (announcement.starts_s - ahead_s) < 0.01


def test_change_that_comes_sooner_than_is_agreed_is_announced_at_once():
    announcer, _ = _announcer(replace(RACETRACK, starts_s=4.0))
    assert _heard(announcer, 1.0)[0].time_stamp_s == 0.0


def test_change_with_which_the_flight_begins_is_announced_too():
    first, second = _heard(_announcer(replace(RACETRACK, starts_s=0.0), start_sigma_s=0.0)[0], 140.0)[:2]
    assert (first.time_stamp_s, first.starts_s) == (0.0, 0.0) and first.turn_rate_rad_s != 0.0
    assert second.starts_s > 0.0 and second.turn_rate_rad_s == 0.0


def test_errors_have_the_spread_of_the_sheet_and_none_where_the_tanker_goes_straight():
    """400 draws: each standard deviation within 15 per cent, wrong once in 1e5."""
    starts, turns = [], []
    for seed in range(400):
        first, second = _heard(_announcer(seed=seed)[0], 140.0)[:2]
        starts.append(first.starts_s - 15.0)
        turns.append(first.turn_rate_rad_s)
        assert second.turn_rate_rad_s == 0.0
    sheet = load_parameters("tanker_path", TankerSheet)
    assert abs(np.std(starts) / sheet.start_sigma_s - 1.0) < 0.15
    assert abs(np.std(turns) / sheet.turn_rate_sigma_rad_s - 1.0) < 0.15


def test_descent_is_announced_with_the_error_of_its_climb_alone_and_a_turn_without_one():
    """400 draws: mean within four standard errors, standard deviation within 15 per cent, wrong once in 1e4."""
    said = [_heard(_announcer(TOBOGGAN, seed=seed)[0], 30.0) for seed in range(400)]
    sheet = load_parameters("tanker_path", TankerSheet)
    errors = np.array([climb.climb_rad for (climb,) in said]) + TOBOGGAN.descent_rad
    assert abs(errors.mean()) < 4.0 * sheet.climb_sigma_rad / np.sqrt(400.0)
    assert abs(np.std(errors) / sheet.climb_sigma_rad - 1.0) < 0.15
    assert all(descent.turn_rate_rad_s == 0.0 for (descent,) in said)
    assert all(turn.climb_rad == 0.0 for turn in _heard(_announcer()[0], 400.0))


def test_straight_tanker_says_nothing():
    announcer, _ = _announcer(TankerPathParameters())
    assert _heard(announcer, 30.0) == []
