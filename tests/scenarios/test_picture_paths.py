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
    path_end,
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


def test_the_way_of_a_miss_goes_on_to_the_rings_plane_where_it_is_judged():
    """A tip that goes aside as it comes is nearest before the plane; one that turns back never comes to it."""
    comes = np.array([-4.0, -1.0, -0.4, -0.1, 0.2, 0.5])
    assert path_end(comes, False, 2) == 4
    assert path_end(comes, True, 2) == 2
    assert path_end(comes, False, 5) == 5
    assert path_end(np.array([-4.0, -1.0, -0.4, -2.0, -3.5, 0.2]), False, 2) == 2
    assert path_end(np.array([-4.0, -1.0, -0.4, -2.0]), False, 2) == 2


def test_of_a_wide_miss_the_words_for_rim_and_limit_stay_apart(hand_made, tmp_path):
    ticks = [hand_made.tick(k) for k in (600, 630)]
    aside = [(replace(truth, p_WP=truth.p_WP + np.array([0.0, 4.0, 0.0])), *rest) for truth, *rest in ticks]
    figure = Figure(figsize=(3.0, 2.5))
    axes = figure.add_subplot()
    draw_along_axis(figure, axes, _flight(tmp_path, aside), RefereeLimits())
    figure.draw_without_rendering()
    above, below = (text.get_window_extent() for text in axes.texts)
    assert above.y0 > below.y1


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


def test_from_behind_left_is_on_the_left_and_the_way_to_go_ends_at_nothing(hand_made, tmp_path):
    """As the receiver sees it: the drogue's left to the left, up above; beyond the ring nothing is to go."""
    flight, figure = _flight(tmp_path, [hand_made.tick(k) for k in range(400, 700, 10)]), Figure()
    axes = figure.add_subplot()
    draw_along_axis(figure, axes, flight, RefereeLimits())
    path = tip_in_drogue_axes(flight)[: contact(flight)[1] + 1]
    path = path[approach_begin(path[:, 0]) :]
    (points,) = axes.collections
    np.testing.assert_allclose(points.get_offsets(), path[:, 1:], atol=1e-12)
    np.testing.assert_allclose(points.get_array(), np.maximum(-path[:, 0], 0.0), atol=1e-12)
    assert path[0, 0] < -2.0 and path[-1, 0] > 0.0
    assert axes.get_xlim()[0] > 0.0 > axes.get_xlim()[1]
    assert axes.get_ylim()[0] < 0.0 < axes.get_ylim()[1]


def test_from_the_left_the_probe_reaches_from_its_tip_aft_along_the_receiver(hand_made, tmp_path):
    ticks = [hand_made.tick(k) for k in (500, 600, 660)]
    flight, axes = _flight(tmp_path, ticks), Figure().add_subplot()
    draw_side_view(axes, flight, RefereeLimits())
    truth = ticks[-1][0]
    tip = truth.p_WP - truth.p_WT + np.array([4.0, 0.0, 1.5])  # p_WT at the start: the exit is the origin
    (probe,) = (line for line in axes.lines if line.get_label() == "probe")
    np.testing.assert_allclose(probe.get_xydata()[0], tip[[0, 2]], atol=1e-9)
    np.testing.assert_allclose(probe.get_xydata()[1], (tip - truth.R_WB[:, 0])[[0, 2]], atol=1e-9)


def test_hose_and_basket_are_drawn_of_a_tip_that_was_ahead_of_them_all_the_while(hand_made, tmp_path):
    ticks = []
    for truth, imu, frame, solution in hand_made.ticks(5):
        ticks.append((replace(truth, p_WP=truth.p_WP + [20.0, 0.0, 0.0]), imu, frame, solution))
        assert (ticks[-1][0].p_WP - truth.p_WD)[0] > 1.0
    flight, axes = _flight(tmp_path, ticks), Figure().add_subplot()
    draw_side_view(axes, flight, RefereeLimits())
    (hose,) = (line for line in axes.lines if line.get_label() == "hose and basket")
    assert len(hose.get_xdata()) >= 1


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
