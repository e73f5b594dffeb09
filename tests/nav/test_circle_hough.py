import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dockair.nav.identify.circle_hough import accumulate, find_circles, radius_row

ANYWHERE = (0.0, 0.0, 1e6)


@given(
    seed=st.integers(0, 10**6),
    radius=st.floats(3.0, 60.0),
    cell=st.floats(0.5, 4.0),
    gate=st.floats(0.02, 0.4),
)
@settings(max_examples=100, deadline=None)
def test_votes_are_those_of_a_brute_force(seed, radius, cell, gate):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-20, 80, (7, 2))
    origin = np.array([-10.0, 5.0])
    votes = accumulate(points, radius, origin, (23, 31), cell, gate)
    v, u = np.indices((23, 31)) * cell
    distance = np.hypot(points[:, 0, None, None] - origin[0] - u, points[:, 1, None, None] - origin[1] - v)
    sure = np.abs(np.abs(distance - radius) - gate * radius).min(axis=0) > 1e-9  # off the band's edge by rounding
    expected = (np.abs(distance - radius) <= gate * radius).sum(axis=0)
    np.testing.assert_array_equal(votes[sure], expected[sure])


def test_radii_cover_their_range():
    row = radius_row(20.0, 300.0, 1.1)
    assert row[0] == 20.0
    assert row[-1] >= 300.0
    np.testing.assert_allclose(row[1:] / row[:-1], 1.1)


@pytest.mark.parametrize("radius", [24.0, 75.0, 330.0])
@pytest.mark.parametrize("hidden", [0, 3])
def test_the_ring_is_among_the_peaks_with_all_its_votes(radius, hidden):
    """[Yoon 2018, Fig 16]: robust to some noise and missing LEDs; with three hidden, noise may peak higher."""
    rng = np.random.default_rng(int(radius))
    for _ in range(5):
        angle = rng.uniform(0, 1) + np.arange(8 - hidden) * np.pi / 4
        centre = rng.uniform([500, 400], [1500, 700])
        points = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
        points = np.vstack([points, rng.uniform([0, 0], [2048, 1088], (6, 2))])
        radii = radius_row(0.75 * radius, 1.25 * radius)
        peaks = find_circles(points, radii, centre_gate=ANYWHERE)
        near = np.hypot(*(peaks.centre_px - centre).T) < 0.3 * radius
        assert peaks.votes[near].max() >= 8 - hidden
        assert hidden or near[0]
        assert (np.diff(peaks.votes) <= 0).all()


def test_a_second_ring_makes_a_second_peak():
    angle = np.arange(8) * np.pi / 4
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([[300, 300] + 60 * circle, [700, 300] + 90 * circle])
    peaks = find_circles(points, radius_row(40.0, 130.0), centre_gate=ANYWHERE)
    for centre, radius in (((300, 300), 60), ((700, 300), 90)):
        near = np.hypot(*(peaks.centre_px - centre).T) < 0.2 * radius
        assert peaks.votes[near].max() == 8


def test_the_gate_keeps_circles_elsewhere_out():
    angle = np.arange(8) * np.pi / 4
    points = [300, 300] + 60 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert len(find_circles(points, radius_row(50.0, 70.0), centre_gate=(900.0, 300.0, 100.0)).votes) == 0
    assert len(find_circles(np.zeros((0, 2)), radius_row(50.0, 70.0), centre_gate=ANYWHERE).votes) == 0
