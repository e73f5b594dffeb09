import cv2
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from dockair.nav.identify.ellipse import ellipse_from_conic, fit_ellipse, places_on_circle


def on_ellipse(centre, axes, angle, phase):
    c, s = np.cos(angle), np.sin(angle)
    local = np.column_stack([axes[0] * np.cos(phase), axes[1] * np.sin(phase)])
    return local @ np.array([[c, s], [-s, c]]) + centre


def angle_between(a, b):
    """Of two axes: modulo pi."""
    return abs((a - b + np.pi / 2) % np.pi - np.pi / 2)


@given(
    u=st.floats(-3000, 3000),
    v=st.floats(-3000, 3000),
    a=st.floats(5, 700),
    ratio=st.floats(0.2, 0.999),
    angle=st.floats(-np.pi / 2, np.pi / 2),
    count=st.integers(5, 12),
)
@settings(max_examples=300, deadline=None)
def test_exact_points_give_back_their_ellipse(u, v, a, ratio, angle, count):
    phase = np.linspace(0, 2 * np.pi, count, endpoint=False)
    ellipse = fit_ellipse(on_ellipse((u, v), (a, a * ratio), angle, phase))
    assert ellipse is not None
    np.testing.assert_allclose(ellipse.centre_px, [u, v], atol=1e-5 * a + 1e-8 * np.hypot(u, v))
    np.testing.assert_allclose(ellipse.semi_axes_px, [a, a * ratio], rtol=1e-6)
    assert angle_between(ellipse.angle_rad, angle) < 1e-5 / (1.0 - ratio)
    assert 4 * ellipse.conic[0] * ellipse.conic[2] - ellipse.conic[1] ** 2 == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", [-1.5, -np.pi / 4, 0.0, 0.3, np.pi / 4, 1.5, np.pi / 2])
def test_either_sign_of_the_conic_gives_the_major_axis(sign, angle):
    """x = R diag(3, 2) (cos, sin) + (7, -4): the conic written out, then negated; eq (25) alone fails for one."""
    c, s = np.cos(angle), np.sin(angle)
    Q = np.array([[c, -s], [s, c]]) @ np.diag([1 / 9, 1 / 4]) @ np.array([[c, s], [-s, c]])
    m = np.array([7.0, -4.0])
    conic = np.array([Q[0, 0], 2 * Q[0, 1], Q[1, 1], *(-2 * Q @ m), m @ Q @ m - 1.0])
    ellipse = ellipse_from_conic(sign * 5.0 * conic)
    np.testing.assert_allclose(ellipse.centre_px, m, rtol=1e-12)
    np.testing.assert_allclose(ellipse.semi_axes_px, [3.0, 2.0], rtol=1e-12)
    assert angle_between(ellipse.angle_rad, angle) < 1e-12


@pytest.mark.parametrize(
    "conic", [[1, 0, -1, 0, 0, -1], [1, 0, 1, 0, 0, 1], [1, 2, 1, 0, 0, -1], [0, 0, 0, 1, 1, 0], [np.nan] * 6]
)
def test_hyperbola_imaginary_parabola_and_line_are_no_ellipse(conic):
    assert ellipse_from_conic(np.array(conic, float)) is None


@pytest.mark.parametrize("arc_deg", [360, 200, 120])
def test_noisy_points_give_opencv_s_direct_fit(arc_deg):
    rng = np.random.default_rng(16)
    for _ in range(40):
        axes = rng.uniform(40, 300) * np.array([1.0, rng.uniform(0.5, 0.95)])
        phase = rng.uniform(0, 6) + np.deg2rad(arc_deg) * np.linspace(0, 1, 20, endpoint=False)
        centre = rng.uniform(200, 900, 2)
        points = on_ellipse(centre, axes, rng.uniform(-1.5, 1.5), phase)
        points += 0.2 * rng.standard_normal(points.shape)
        ours = fit_ellipse(points)
        (u, v), diameters, _ = cv2.fitEllipseDirect(points.astype(np.float32))
        # OpenCV scales and centres its points otherwise (and works in single precision): on a noisy arc the
        # algebraic distance, hence the optimum, depends a little on that
        scale = 1e-3 * axes[0] if arc_deg == 360 else 2e-2 * axes[0]
        np.testing.assert_allclose(ours.centre_px, [u, v], atol=scale)
        np.testing.assert_allclose(ours.semi_axes_px, np.sort(diameters)[::-1] / 2, atol=scale)


def conic_by_generalised_eigenvectors(points):
    """Fitzgibbon, Pilu & Fisher 1999 as printed: D'D A = lambda C A, six by six; no partition, no inverse of a part."""
    mean = points.mean(axis=0)
    scale = np.sqrt(((points - mean) ** 2).sum(axis=1).mean())
    x, y = ((points - mean) / scale).T
    D = np.column_stack([x * x, x * y, y * y, x, y, np.ones_like(x)])
    C = np.zeros((6, 6))
    C[0, 2] = C[2, 0] = 2.0
    C[1, 1] = -1.0
    # mu = 1 / lambda: the inverse problem C A = mu D'D A is definite on the right
    mu, A = scipy.linalg.eigh(C, D.T @ D)
    conic = A[:, np.argmax(mu)]
    conic = conic / np.sqrt(conic @ C @ conic) * np.sign(conic[0] + conic[2])
    T = np.array([[1, 0, -mean[0]], [0, 1, -mean[1]], [0, 0, scale]]) / scale  # pixels to normalised
    a, b, c, d, e, f = conic
    Q = T.T @ np.array([[a, b / 2, d / 2], [b / 2, c, e / 2], [d / 2, e / 2, f]]) @ T
    conic = np.array([Q[0, 0], 2 * Q[0, 1], Q[1, 1], 2 * Q[0, 2], 2 * Q[1, 2], Q[2, 2]])
    return conic / np.sqrt(4.0 * conic[0] * conic[2] - conic[1] ** 2)


@pytest.mark.parametrize(
    ("kind", "ratio", "arc_deg", "offset_px"),
    [
        ("random", (0.3, 0.95), 360.0, 1e3),
        ("near-circular", (0.999, 1.0), 360.0, 1e3),
        ("tiny arc", (0.5, 0.95), 25.0, 1e3),
        ("far off centre", (0.3, 0.95), 360.0, 1e5),
    ],
)
def test_the_conic_is_that_of_an_independent_solver(kind, ratio, arc_deg, offset_px):
    """Noisy points, so that the problem is not singular; compared as points of the plane, where F is in pixels."""
    rng = np.random.default_rng(17)
    for _ in range(100):
        a = rng.uniform(20.0, 400.0)
        phase = rng.uniform(0, 6) + np.deg2rad(arc_deg) * np.linspace(0, 1, 24, endpoint=False)
        centre = offset_px * rng.uniform(-1, 1, 2)
        points = on_ellipse(centre, a * np.array([1.0, rng.uniform(*ratio)]), rng.uniform(-1.5, 1.5), phase)
        points += (0.02 if arc_deg < 90.0 else 0.5) * rng.standard_normal(points.shape)
        ours, theirs = fit_ellipse(points), ellipse_from_conic(conic_by_generalised_eigenvectors(points))
        assert (ours is None) == (theirs is None)
        tolerance = 1e-5 * theirs.semi_axes_px[0] * (20.0 if arc_deg < 90.0 else 1.0)
        np.testing.assert_allclose(ours.centre_px, theirs.centre_px, rtol=1e-9, atol=tolerance)
        np.testing.assert_allclose(ours.semi_axes_px, theirs.semi_axes_px, rtol=1e-9, atol=tolerance)
        aspect = 1.0 - theirs.semi_axes_px[1] / theirs.semi_axes_px[0]
        assert angle_between(ours.angle_rad, theirs.angle_rad) < 1e-5 / aspect


def test_the_printed_constraint_gives_a_hyperbola():
    """[Yoon 2018, eq 16] b^2 - 4ac = 1 on the points of an ellipse: its least-squares conic is no ellipse at all."""
    rng = np.random.default_rng(18)
    points = on_ellipse((0.0, 0.0), (1.5, 0.8), 0.4, rng.uniform(0, 6, 20)) + 0.02 * rng.standard_normal((20, 2))
    x, y = points.T
    D = np.column_stack([x * x, x * y, y * y, x, y, np.ones_like(x)])
    C = np.zeros((6, 6))
    C[0, 2] = C[2, 0] = -2.0
    C[1, 1] = 1.0
    mu, A = scipy.linalg.eigh(C, D.T @ D)
    assert ellipse_from_conic(A[:, np.argmax(mu)]) is None
    assert fit_ellipse(points) is not None


def test_the_fit_minimises_the_algebraic_distance_under_its_constraint():
    rng = np.random.default_rng(17)
    points = on_ellipse((3.0, -2.0), (2.0, 1.2), 0.4, rng.uniform(0, 6, 15)) + 0.05 * rng.standard_normal((15, 2))
    mean = points.mean(axis=0)
    x, y = ((points - mean) / np.sqrt(((points - mean) ** 2).sum(axis=1).mean())).T
    D = np.column_stack([x * x, x * y, y * y, x, y, np.ones_like(x)])
    ours = fit_ellipse(np.column_stack([x, y])).conic

    def cost(A):
        return ((D @ A) ** 2).sum() / (4 * A[0] * A[2] - A[1] ** 2)

    for _ in range(300):
        other = ours + 10 ** rng.uniform(-6, -1) * rng.standard_normal(6)
        if 4 * other[0] * other[2] > other[1] ** 2:
            assert cost(other) >= cost(ours) * (1 - 1e-9)


def test_a_tilted_octagon_becomes_a_regular_one_and_comes_back():
    """Parallel projection of a ring: after Eq. (3) the LEDs stand exactly 45 degrees apart, at the larger semi-axis."""
    phase = np.deg2rad(10.0) + np.arange(8) * np.pi / 4
    circle = np.column_stack([np.cos(phase), np.sin(phase)])
    c, s = np.cos(0.7), np.sin(0.7)
    shrink = np.array([[c, -s], [s, c]]) @ np.diag([1.0, 0.6]) @ np.array([[c, s], [-s, c]])
    points = 80.0 * circle @ shrink.T + [300.0, 200.0]
    ellipse = fit_ellipse(points)
    places = ellipse.to_circle(points)
    np.testing.assert_allclose(np.hypot(*places.T), 80.0, rtol=1e-9)
    np.testing.assert_allclose(places, 80.0 * circle, atol=1e-7)
    np.testing.assert_allclose(ellipse.from_circle(places), points, atol=1e-9)


@pytest.mark.parametrize("hidden", [[], [0], [2, 3], [0, 1, 5, 6]])
def test_places_are_numbered_in_order_whatever_is_hidden(hidden):
    numbers = np.setdiff1d(np.arange(8), hidden)
    angle = 0.2 + numbers * np.pi / 4
    places = places_on_circle(np.column_stack([np.cos(angle), np.sin(angle)]) * 30.0)
    np.testing.assert_array_equal(places.slot, numbers)
    assert places.phase_rad == pytest.approx(0.2)
    np.testing.assert_allclose(places.residual_rad, 0.0, atol=1e-12)


def test_perspective_moves_the_places_as_far_as_the_digest_says(ring_scene):
    """43.6 to 46.4 degrees apart at 2.5 m and 20 degrees: residuals below 3 degrees, far from the 22.5 of a slip."""
    rng = np.random.default_rng(18)
    for _ in range(30):
        scene = ring_scene(rng, range_m=(2.5, 2.6), sigma_px=0.0)
        places = places_on_circle(fit_ellipse(scene.led_px).to_circle(scene.led_px))
        assert np.abs(places.residual_rad).max() < np.deg2rad(3.0)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 2)),
        np.random.default_rng(0).random((4, 2)),
        np.ones((8, 2)),
        np.column_stack([np.arange(8.0), 2.0 * np.arange(8.0)]),
        np.full((8, 2), np.nan),
    ],
)
def test_points_that_fix_no_ellipse_give_none(points):
    assert fit_ellipse(points) is None


def test_an_upright_ellipse_has_its_major_axis_at_plus_a_quarter_turn():
    """Of the two angles only pi/2 is in (-pi/2, pi/2]; 4 x^2 + y^2 = 4 either way round."""
    for sign in (1.0, -1.0):
        upright = ellipse_from_conic(sign * np.array([4.0, 0.0, 1.0, 0.0, 0.0, -4.0]))
        assert upright.angle_rad == 0.5 * np.pi
        np.testing.assert_allclose(upright.semi_axes_px, [2.0, 1.0])
