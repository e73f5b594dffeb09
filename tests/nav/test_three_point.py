import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dockair.nav.identify.three_point import all_triples, circles_through, most_trusted_circle, trust


def ring(centre, radius, phase=0.1):
    angle = phase + np.arange(8) * np.pi / 4
    return np.asarray(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


@given(
    u=st.floats(-1e4, 1e4),
    v=st.floats(-1e4, 1e4),
    r=st.floats(1, 1e4),
    phases=st.tuples(*[st.floats(0, 2 * np.pi)] * 3),
)
@settings(max_examples=200, deadline=None)
def test_three_points_on_a_circle_give_it_back(u, v, r, phases):
    gaps = np.abs(np.subtract.outer(phases, phases)[np.triu_indices(3, 1)])
    assume(np.minimum(gaps, 2 * np.pi - gaps).min() > 0.05)
    points = np.array([u, v]) + r * np.column_stack([np.cos(phases), np.sin(phases)])
    centres, radii = circles_through(points, np.array([[0, 1, 2]]))
    np.testing.assert_allclose(centres[0], [u, v], atol=1e-6 * r + 1e-9 * np.hypot(u, v))
    assert radii[0] == pytest.approx(r, rel=1e-6)


def test_the_circle_is_that_of_equations_4_to_8():
    points = np.random.default_rng(19).uniform(-50, 50, (6, 2))
    triples = all_triples(6)
    centres, radii = circles_through(points, triples)
    for triple, centre, radius in zip(triples, centres, radii, strict=True):
        p = points[triple]
        A, B, C = np.linalg.solve(np.column_stack([p, np.ones(3)]), -(p**2).sum(axis=1))
        np.testing.assert_allclose(centre, [-A / 2, -B / 2], rtol=1e-9)
        assert radius == pytest.approx(np.sqrt(A * A + B * B - 4 * C) / 2, rel=1e-9)


def test_points_on_a_line_have_no_circle():
    _, radii = circles_through(np.array([[0.0, 0.0], [1.0, 2.0], [3.0, 6.0]]), np.array([[0, 1, 2]]))
    assert radii[0] == np.inf


@pytest.mark.parametrize("cap", [np.inf, 5.0])
def test_trust_is_the_sum_over_all_other_circles(cap):
    rng = np.random.default_rng(20)
    X, r = rng.uniform(0, 30, (12, 2)), rng.uniform(5, 20, 12)
    D = np.minimum(np.linalg.norm(X[:, None] - X, axis=2), cap).sum(axis=1)
    E = np.minimum(np.abs(r[:, None] - r), cap).sum(axis=1)
    np.testing.assert_allclose(trust(X, r, alpha=2.0, beta=0.5, cap_px=cap), 1.0 / (2.0 * D + 0.5 * E), rtol=1e-12)


def test_one_circle_alone_has_no_end_of_trust():
    assert trust(np.array([[3.0, 4.0]]), np.array([5.0])).tolist() == [np.inf]


@pytest.mark.parametrize(("alpha", "beta"), [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.2, 3.0)])
def test_the_most_trusted_circle_is_that_of_the_weights_given(alpha, beta):
    """Of six points whose most trusted circle is another for each of the weights; without weights both are 1."""
    points = np.random.default_rng(27).uniform(0.0, 100.0, (6, 2))
    centres, radii = circles_through(points, all_triples(6))
    T = trust(centres, radii, alpha=alpha, beta=beta)
    best = most_trusted_circle(points, alpha=alpha, beta=beta)
    assert best.trust == T.max()
    np.testing.assert_array_equal(best.centre_px, centres[T.argmax()])
    if alpha == beta == 1.0:
        assert most_trusted_circle(points).trust == T.max()
        np.testing.assert_array_equal(trust(centres, radii), T)


def test_triples_are_all_there_are():
    assert len(all_triples(10)) == 120
    assert len({tuple(t) for t in all_triples(10)}) == 120
    assert all_triples(2).shape == (0, 3)
    with pytest.raises(ValueError, match="read-only"):
        all_triples(10)[0, 0] = 1  # they are kept for the next who asks


@pytest.mark.parametrize("clutter", [0, 1])
def test_the_source_s_method_finds_the_ring_while_its_circles_are_the_majority(clutter):
    rng = np.random.default_rng(21)
    for _ in range(20):
        points = np.vstack([ring((500, 400), 100), rng.uniform([0, 0], [1000, 800], (clutter, 2))])
        circle = most_trusted_circle(points)
        np.testing.assert_allclose(circle.centre_px, [500, 400], atol=1e-6)
        assert set(range(8)) <= set(circle.members.tolist())


def test_bounded_distances_find_the_ring_where_the_printed_ones_find_the_median():
    """With 12 blobs of noise the ring has 56 of 1140 circles: no majority, so no geometric median."""
    rng = np.random.default_rng(22)
    printed = bounded = 0
    for _ in range(20):
        points = np.vstack([ring((300, 600), 80), rng.uniform([0, 0], [2000, 1000], (12, 2))])
        kwargs = {"radius_range_px": (20.0, 400.0)}
        printed += np.allclose(most_trusted_circle(points, **kwargs).centre_px, [300, 600], atol=2.0)
        bounded += np.allclose(most_trusted_circle(points, cap_px=10.0, **kwargs).centre_px, [300, 600], atol=2.0)
    assert bounded == 20
    assert printed < bounded


def test_two_candidates_make_no_circle():
    assert most_trusted_circle(np.zeros((2, 2))) is None


def test_circles_beyond_the_range_of_radii_and_points_on_a_line_or_in_one_place_are_left_out():
    """A ring of 100 px and one of 40; five points on a line have no circle, three in one place none either."""
    large, small = ring((500.0, 400.0), 100.0), ring((900.0, 400.0), 40.0)
    both = np.vstack([large, small])
    for radius_range_px, radius_px in (((60.0, 150.0), 100.0), ((10.0, 60.0), 40.0)):
        circle = most_trusted_circle(both, cap_px=5.0, radius_range_px=radius_range_px)
        assert circle.radius_px == pytest.approx(radius_px)
    for radius_range_px in ((101.0, 150.0), (10.0, 99.0)):
        assert most_trusted_circle(large, radius_range_px=radius_range_px) is None
    assert most_trusted_circle(np.column_stack([np.arange(5.0), 2.0 * np.arange(5.0)])) is None
    assert circles_through(np.ones((3, 2)), np.array([[0, 1, 2]]))[1][0] == np.inf


def test_members_are_the_candidates_within_a_tenth_of_the_radius():
    points = np.vstack([ring((500.0, 400.0), 100.0), [609.5, 400.0], [500.0, 289.5], [390.5, 400.0], [589.5, 400.0]])
    best = most_trusted_circle(points, cap_px=5.0)
    np.testing.assert_allclose([*best.centre_px, best.radius_px], [500.0, 400.0, 100.0], atol=1e-6)
    np.testing.assert_array_equal(best.members, [*range(9), 10])
