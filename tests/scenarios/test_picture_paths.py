"""The paths of the picture are the truth's: in the drogue's axes, of the last approach, to the ring's plane."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure

from dockair.rotations import matrix_from_yaw_pitch_roll
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.picture.columns import contact, level_axes, vectors
from dockair.scenarios.picture.paths import (
    approach_begin,
    draw_along_axis,
    draw_side_view,
    ring_crossing,
    tip_in_drogue_axes,
)


def _flight(folder, ticks):
    log = FlightLog()
    for truth, imu, frame, solution in ticks:
        log.append(truth, imu, frame, solution)
    return pq.read_table(log.write_parquet(folder))


def test_the_tip_is_drawn_in_the_axes_in_which_the_miss_is_judged(hand_made, tmp_path):
    ticks = hand_made.ticks(40)
    expected = [truth.R_WD.T @ (truth.p_WP - truth.p_WD) for truth, *_ in ticks]
    np.testing.assert_allclose(tip_in_drogue_axes(_flight(tmp_path, ticks)), expected, atol=1e-12)


def test_of_several_approaches_the_last_is_drawn():
    forward_m = np.array([-4.0, -2.0, -1.0, -3.5, -2.9, -1.0, 0.1])
    assert approach_begin(forward_m) == 4
    assert approach_begin(forward_m[4:]) == 0
    assert approach_begin(np.array([-5.0, -4.0])) == 0


def test_the_cross_stands_where_the_tip_last_comes_into_the_rings_plane_from_behind():
    """There the referee takes the offset of a contact: a tip that was thrown back comes to it a second time."""
    assert ring_crossing(np.array([-2.0, -0.1, 0.02, 0.2])) == 2
    assert ring_crossing(np.array([-2.0, -0.1, 0.02, -0.05, -0.01, 0.0, 0.2])) == 5
    assert ring_crossing(np.array([-2.0, -0.1])) is None


def test_the_rim_is_that_of_the_ring_that_was_flown(hand_made, tmp_path):
    flight = _flight(tmp_path, hand_made.ticks(40))
    figure = Figure()
    for rim_m in (0.25, 0.3):
        along, side = figure.add_subplot(), figure.add_subplot()
        limits = RefereeLimits(rim_radius_m=rim_m)
        draw_along_axis(figure, along, flight, limits)
        draw_side_view(side, flight, limits)
        assert np.hypot(*along.lines[0].get_data()).max() == pytest.approx(rim_m)
        assert np.ptp(side.lines[4].get_ydata()) == pytest.approx(2.0 * rim_m, rel=0.02)  # the basket, nearly upright


@pytest.mark.parametrize("heading_deg", [0.0, 70.0])
def test_level_axes_begin_in_the_hoses_exit_and_look_along_the_tankers_heading(hand_made, tmp_path, heading_deg):
    """From the second tick on everything is 9 km off and turned: paths lie where they would here."""
    turn, far = matrix_from_yaw_pitch_roll(np.radians(heading_deg), 0.0, 0.0), np.array([7000.0, -6000.0, 50.0])
    ticks, here = [], []
    for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(5)):
        here.append(truth.p_WP)
        moved = {"p_WT": far + turn @ truth.p_WT, "p_WP": far + turn @ truth.p_WP, "R_WT": turn @ truth.R_WT}
        ticks.append((replace(truth, **moved) if k else truth, imu, frame, solution))
    flight = _flight(tmp_path, ticks)
    R_EW, p_WE = level_axes(flight)
    np.testing.assert_allclose(R_EW.apply(vectors(flight, "truth_p_WP") - p_WE), here, atol=1e-9)


def test_the_moment_is_that_of_the_hold_or_else_the_nearest(hand_made, tmp_path):
    assert contact(_flight(tmp_path, [hand_made.tick(k) for k in (100, 650, 656, 700)])) == (True, 2)
    assert contact(_flight(tmp_path, [hand_made.tick(k) for k in (100, 640, 600, 500)])) == (False, 1)
