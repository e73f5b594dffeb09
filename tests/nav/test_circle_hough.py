from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dockair.nav.identify.circle_hough import (
    Peaks,
    accumulate,
    find_circles,
    radius_row,
    triples_near,
)

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


@pytest.mark.parametrize("reach", [1.0, 10.0, 80.0])
@pytest.mark.parametrize("toward", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_a_gate_about_the_centre_holds_the_peak_of_a_ring_that_is_seen_on_one_side_alone(reach, toward):
    """Four LEDs in a row, the nearest 38 px beside the centre: no gate narrower than that meets their box."""
    angle = np.deg2rad([-67.5, -22.5, 22.5, 67.5]) + np.arctan2(toward[1], toward[0])
    points = [900.0, 500.0] + 100.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    peaks = find_circles(points, np.array([100.0]), centre_gate=(900.0, 500.0, reach))
    assert len(peaks.votes) > 0 and peaks.votes[0] == 4


def test_no_peak_is_farther_outside_the_gate_than_a_cell():
    """A ring of which the gate leaves the centre out by 80 px has all its votes there, and few within."""
    angle = np.arange(8) * np.pi / 4
    points = [900.0, 500.0] + 100.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    for toward in ([1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]):
        u, v = np.array([900.0, 500.0]) + 100.0 * np.array(toward)
        peaks = find_circles(points, np.array([100.0]), centre_gate=(u, v, 20.0), min_votes=1)
        assert len(peaks.votes) > 0
        assert np.abs(peaks.centre_px - [u, v]).max() <= 20.0 + 15.0


def test_among_clutter_the_peak_least_likely_an_accident_is_the_ring():
    """Five LEDs of a small ring among thirty others: by votes large circles come first, by Eq. (2) the ring."""
    rng = np.random.default_rng(74)
    first = {None: 0, "chance": 0}
    for _ in range(40):
        radius, angle = rng.uniform(25.0, 60.0), rng.uniform(0, 1) + rng.permutation(8)[:5] * np.pi / 4
        centre = rng.uniform([200, 200], [1800, 900])
        ring = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
        points = np.vstack([ring, rng.uniform([0, 0], [2047, 1087], (30, 2))])
        for how in first:
            density = None if how is None else len(points) / (2047.0 * 1087.0)
            peaks = find_circles(points, radius_row(12.0, 560.0), centre_gate=ANYWHERE, peaks=3, clutter_px2=density)
            near = np.hypot(*(peaks.centre_px - centre).T) < 0.4 * radius
            first[how] += bool((near & (np.abs(peaks.radius_px - radius) < 0.3 * radius)).any())
    assert first["chance"] >= 38
    assert first[None] <= 10


def test_peaks_worth_falls_in_the_order_of_the_formula():
    """Eq. (2) by hand for the cells that are returned."""
    rng = np.random.default_rng(75)
    points = rng.uniform([0, 0], [900, 900], (40, 2))
    n_A = 40 / 900.0**2
    peaks = find_circles(points, radius_row(12.0, 400.0), centre_gate=ANYWHERE, peaks=20, clutter_px2=n_A)
    m, r = peaks.votes, peaks.radius_px
    mu = 4.0 * np.pi * 0.15 * r**2 * n_A
    worth = np.where(m > mu, m * np.log(m / mu) - m + mu, 0.0) - np.log(900.0**2 / (0.15 * r) ** 2)
    assert len(m) == 20 and (np.diff(worth) <= 1e-9).all()


@given(seed=st.integers(0, 10**6), peaks=st.integers(0, 40))
@settings(max_examples=60, deadline=None)
def test_triples_are_those_with_three_in_one_band(seed, peaks):
    rng = np.random.default_rng(seed)
    points, centre = rng.uniform(0, 100, (9, 2)), rng.uniform(0, 100, (peaks, 2))
    circles = Peaks(centre_px=centre, radius_px=rng.uniform(5, 60, peaks), votes=np.zeros(peaks, np.int64))
    member = np.abs(np.linalg.norm(points[:, None] - centre, axis=2) - circles.radius_px) <= 0.25 * circles.radius_px
    expected = [t for t in combinations(range(9), 3) if member[list(t)].all(axis=0).any()]
    assert [tuple(t) for t in triples_near(points, circles, 0.25).tolist()] == expected


@pytest.mark.parametrize("place", [0, 63, 64, 128])
def test_three_in_one_band_are_a_triple_however_many_peaks_there_are(place):
    """Of 129 peaks one has candidates on its circle."""
    peaks = Peaks(centre_px=np.full((129, 2), 1e4), radius_px=np.full(129, 10.0), votes=np.zeros(129, np.int64))
    peaks.centre_px[place] = 0.0
    points = np.array([[10.0, 0.0], [500.0, 500.0], [0.0, 10.0], [-10.0, 0.0]])
    assert triples_near(points, peaks, 0.25).tolist() == [[0, 2, 3]]


def test_a_wide_frame_costs_no_more_cells_than_its_groups():
    """Two rings in corners of a frame of 100 000 px: a grid over both would have 10^9 cells."""
    angle = np.arange(8) * np.pi / 4
    circle = 15.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([circle, [1e5, 1e5] + circle])
    peaks = find_circles(points, radius_row(12.0, 20.0), centre_gate=ANYWHERE)
    for centre in ([0.0, 0.0], [1e5, 1e5]):
        assert peaks.votes[np.hypot(*(peaks.centre_px - centre).T) < 4.0].max() == 8
