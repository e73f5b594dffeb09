"""Dilution of precision: the exact Jacobian, published geometries, closed forms, and what noise really does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from dockair.errors import DockairError
from dockair.nav.dop import DopStatus, dilution_of_precision, dilution_of_precision_in_plane
from dockair.rotations import Array, exp

ZERO = np.zeros(3)
MOUNTING = Rotation.from_euler("ZYX", [0.5, -0.3, 0.8]).as_matrix()
ATTITUDES = [(0.0, 0.0, 0.0), (1e-7, -1e-7, 1e-7), (0.3, -0.2, 0.5), (2.0, 1.2, -2.5), (-3.0, -1.4, 3.1)]
F = 0.016


def image(landmarks: Array, state: Array, R_BC: Array) -> Array:
    """(2n,) u, v of [Kim & Hwang 2014, eqs 1-3], term by term."""
    sa, sb, sg = np.sin(state[3:]).tolist()
    ca, cb, cg = np.cos(state[3:]).tolist()
    R_NB = np.array(
        [
            [cb * cg, sa * sb * cg - ca * sg, ca * sb * cg + sa * sg],
            [cb * sg, sa * sb * sg + ca * cg, ca * sb * sg - sa * cg],
            [-sb, sa * cb, ca * cb],
        ]
    )
    s = (landmarks - state[:3]) @ (R_NB @ R_BC)
    return F * (s[:, 1:] / s[:, :1]).ravel()


def in_view(rpy, R_BC: Array, position: Array, count: int = 5, seed: int = 1) -> Array:
    """(n, 3) landmarks that a camera so mounted sees."""
    rng = np.random.default_rng(seed)
    s = np.column_stack([rng.uniform(4.0, 9.0, count), rng.uniform(-2.0, 2.0, (count, 2))])
    return position + Rotation.from_euler("ZYX", rpy[::-1]).apply(s @ R_BC.T)


def at(angles_deg, r: float) -> Array:
    psi, theta = np.deg2rad(np.array(angles_deg, dtype=float)).T
    return r * np.column_stack([np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), np.sin(theta)])


@pytest.mark.parametrize("R_BC", [np.eye(3), MOUNTING], ids=["in line", "mounted askew"])
@pytest.mark.parametrize("rpy", ATTITUDES)
def test_jacobian_matches_differences_of_the_sources_equations(rpy, R_BC):
    position, step = np.array([3.0, -2.0, 1.0]), 1e-6
    landmarks, state = in_view(rpy, R_BC, position), np.concatenate([position, rpy])
    H = dilution_of_precision(landmarks, position, rpy, F, R_BC).jacobian
    assert H.shape == (10, 6)
    for k, e in enumerate(step * np.eye(6)):
        difference = image(landmarks, state + e, R_BC) - image(landmarks, state - e, R_BC)
        np.testing.assert_allclose(H[:, k], difference / (2.0 * step), atol=1e-9)


@pytest.mark.parametrize("R_BC", [np.eye(3), MOUNTING], ids=["in line", "mounted askew"])
@pytest.mark.parametrize("rpy", ATTITUDES)
def test_jacobian_of_the_landmarks_in_the_camera_matches_differences(rpy, R_BC):
    """State (delta, phi): p_CN + delta, exp(phi) R_CN."""
    position, step = np.array([3.0, -2.0, 1.0]), 1e-6
    landmarks = in_view(rpy, R_BC, position)
    R_CN = R_BC.T @ Rotation.from_euler("ZYX", rpy[::-1]).as_matrix().T
    H = dilution_of_precision(landmarks, position, rpy, F, R_BC).landmarks_in_camera.jacobian

    def moved(e: Array) -> Array:
        s = landmarks @ (exp(e[3:]) @ R_CN).T - R_CN @ position + e[:3]
        return F * (s[:, 1:] / s[:, :1]).ravel()

    for k, e in enumerate(step * np.eye(6)):
        np.testing.assert_allclose(H[:, k], (moved(e) - moved(-e)) / (2.0 * step), atol=1e-9)


def test_jacobian_at_zero_attitude_is_the_closed_form():
    """X depth: du = [u/X, -f/X, 0, v, uv/f, -(f + u^2/f)], dv = [v/X, 0, -f/X, -u, f + v^2/f, -uv/f]."""
    X, Y, Z = 7.0, 2.0, -3.0
    u, v = F * Y / X, F * Z / X
    H = dilution_of_precision(np.array([[X, Y, Z]] * 3), ZERO, ZERO, F).jacobian
    np.testing.assert_allclose(H[0], [u / X, -F / X, 0.0, v, u * v / F, -(F + u * u / F)], atol=1e-15)
    np.testing.assert_allclose(H[1], [v / X, 0.0, -F / X, -u, F + v * v / F, -u * v / F], atol=1e-15)


@pytest.mark.parametrize("X", [1.0, 10.0, 30.0])
def test_frontal_ring_is_the_closed_form(X):
    """n landmarks evenly on a circle of radius a at depth X on the axis, seen from the camera.

    The sums of squares over the ring decouple but for sideways shift and tilt, of correlation 1/sqrt(2):
    var x = X^4/(n f^2 a^2), var y = var z = 2 X^2/(n f^2), var roll = X^2/(n f^2 a^2), var tilt = 4 X^4/(n f^2 a^4).
    """
    n, a = 8, 0.25
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = np.column_stack([np.zeros(n), a * np.cos(angle), a * np.sin(angle)])
    dop = dilution_of_precision(ring, np.array([-X, 0.0, 0.0]), ZERO, F)
    seen, unit = dop.landmarks_in_camera, X**2 / (n * F**2)
    tilt = 4.0 * X**2 / a**4
    expected = unit * np.array([X**2 / a**2, 2.0, 2.0, 1.0 / a**2, tilt, tilt])
    np.testing.assert_allclose(np.diag(seen.covariance), expected, rtol=1e-9)
    assert seen.pdop == pytest.approx(np.sqrt(unit * (X**2 / a**2 + 4.0)), rel=1e-9)
    assert seen.adop == pytest.approx(np.sqrt(unit * (1.0 / a**2 + 2.0 * tilt)), rel=1e-9)
    # the camera seen from the ring: a tilt swings it sideways, by X phi_z - delta_y, their covariance -2 X/a^2
    sideways = unit * (2.0 + 4.0 * X**2 / a**2 + X**2 * tilt)
    np.testing.assert_allclose(np.diag(dop.covariance)[1:3], sideways, rtol=1e-9)


@pytest.mark.parametrize(
    ("angles", "r", "pdop", "adop"),
    [
        ([(45, 45), (0, 0), (-45, 45)], 10.0, 3041.4, 302.08),
        ([(45, 45), (0, 0), (-45, 45)], 1000.0, 304138.0, 302.08),
        ([(1, 45), (0, 0), (-1, 45)], 100.0, 1265060.0, 12322.0),
        ([(89, 45), (0, 0), (-89, 45)], 100.0, 12402.0, 124.02),
        ([(45, 30), (0, 0), (45, -30)], 100.0, 40619.0, 405.03),
    ],
)
def test_the_sources_geometries_have_their_exact_dilution(angles, r, pdop, adop):
    """Values by a second derivation, to the five digits given."""
    dop = dilution_of_precision(at(angles, r), ZERO, ZERO, 0.010)
    assert dop.status is DopStatus.SOLVED
    assert dop.pdop == pytest.approx(pdop, rel=2e-5) and dop.adop == pytest.approx(adop, rel=2e-5)
    assert dop.dop == pytest.approx(np.hypot(dop.pdop, dop.adop))


@pytest.mark.slow
@pytest.mark.parametrize(("R_BC", "seed"), [(np.eye(3), 4), (MOUNTING, 5)], ids=["in line", "mounted askew"])
def test_noise_does_what_the_dilution_says(R_BC, seed):
    """Three landmarks, solved 3000 times: sample sigma is dilution x sigma_m; 5 % is left by chance once in 10^4."""
    rpy, position, sigma_m, trials = np.array([0.2, -0.3, 0.4]), np.array([3.0, -2.0, 1.0]), 1e-8, 3000
    landmarks, true = in_view(rpy, R_BC, position, 3, seed), np.concatenate([position, rpy])
    dop = dilution_of_precision(landmarks, position, rpy, F, R_BC)
    clean, rng, errors = image(landmarks, true, R_BC), np.random.default_rng(seed), []
    for _ in range(trials):
        measured = clean + sigma_m * rng.standard_normal(6)
        solved = least_squares(lambda x, m=measured: (image(landmarks, x, R_BC) - m) / sigma_m, true, method="lm")
        errors.append(solved.x - true)
    square = np.mean(np.square(errors), axis=0)
    assert np.sqrt(square.sum()) == pytest.approx(dop.dop * sigma_m, rel=0.05)
    assert np.sqrt(square[:3].sum()) == pytest.approx(dop.pdop * sigma_m, rel=0.05)
    assert np.sqrt(square[3:].sum()) == pytest.approx(dop.adop * sigma_m, rel=0.05)


def test_in_the_plane_the_rows_are_equation_32():
    """d psi = sin(gamma + psi)/R dx - cos(gamma + psi)/R dy - d gamma with d psi = cos^2(psi) du/f; and differences."""
    gamma, position, step = 0.7, np.array([2.0, -1.0]), 1e-6
    psi, R = np.array([-0.6, 0.1, 0.9, 1.3]), np.array([3.0, 5.0, 4.0, 20.0])
    landmarks = position + (R * np.array([np.cos(gamma + psi), np.sin(gamma + psi)])).T
    dop = dilution_of_precision_in_plane(landmarks, position, gamma, F)
    rows = np.column_stack([np.sin(gamma + psi) / R, -np.cos(gamma + psi) / R, -np.ones(4)])
    np.testing.assert_allclose(dop.jacobian * (np.cos(psi) ** 2 / F)[:, None], rows, atol=1e-14)

    def u(x: float, y: float, yaw: float) -> Array:
        d = landmarks - [x, y]
        return F * np.tan(np.arctan2(d[:, 1], d[:, 0]) - yaw)

    for k, e in enumerate(step * np.eye(3)):
        difference = u(*(np.append(position, gamma) + e)) - u(*(np.append(position, gamma) - e))
        np.testing.assert_allclose(dop.jacobian[:, k], difference / (2.0 * step), atol=1e-9)


def test_the_plane_is_space_without_height_roll_and_pitch():
    landmarks, yaw = np.array([[6.0, 1.0], [5.0, -2.0], [9.0, 2.0]]), 0.2
    flat = dilution_of_precision_in_plane(landmarks, [1.0, 0.5], yaw, F)
    space = dilution_of_precision(
        np.column_stack([landmarks, np.zeros(3)]), np.array([1.0, 0.5, 0.0]), np.array([0.0, 0.0, yaw]), F
    )
    np.testing.assert_allclose(flat.jacobian, space.jacobian[::2][:, [0, 1, 5]], atol=1e-15)
    D = np.linalg.inv(flat.jacobian.T @ flat.jacobian)
    assert flat.pdop == pytest.approx(np.sqrt(D[0, 0] + D[1, 1])) and flat.adop == pytest.approx(np.sqrt(D[2, 2]))
    assert flat.information.shape == (3, 3, 3) and (flat.position, flat.attitude) == (slice(0, 2), slice(2, 3))


def test_moving_and_turning_everything_changes_neither_view():
    """Position error turns with N; the Euler angles' does not, but the camera's view of the landmarks knows no N."""
    rpy, position = np.array([0.2, -0.3, 0.4]), np.array([3.0, -2.0, 1.0])
    landmarks = in_view(rpy, MOUNTING, position)
    before = dilution_of_precision(landmarks, position, rpy, F, MOUNTING)
    turn = Rotation.from_euler("ZYX", [1.0, 0.4, -0.7])
    turned = (turn * Rotation.from_euler("ZYX", rpy[::-1])).as_euler("ZYX")[::-1]
    after = dilution_of_precision(turn.apply(landmarks), turn.apply(position), turned, F, MOUNTING)
    assert after.pdop == pytest.approx(before.pdop, rel=1e-9)
    np.testing.assert_allclose(after.landmarks_in_camera.covariance, before.landmarks_in_camera.covariance, rtol=1e-7)
    assert abs(after.adop / before.adop - 1.0) > 0.01


def test_one_landmark_more_never_harms():
    landmarks = in_view(ZERO, np.eye(3), ZERO, 12)
    dops = [dilution_of_precision(landmarks[:n], ZERO, ZERO, F) for n in range(3, 13)]
    for what in ("pdop", "adop", "dop"):
        assert (np.diff([getattr(dop, what) for dop in dops]) < 0.0).all()


def singular(dop) -> bool:
    return dop.status is DopStatus.SINGULAR and np.isnan([dop.dop, dop.pdop, dop.adop]).all()


def test_landmarks_on_a_line_or_in_one_place_are_singular():
    line = np.array([[5.0, -1.0, 0.3], [6.0, 0.0, 0.1], [7.0, 1.0, -0.1], [9.0, 3.0, -0.5]])
    assert singular(dilution_of_precision(line, ZERO, ZERO, F))
    assert singular(dilution_of_precision(np.ones((4, 3)), ZERO, ZERO, F))
    assert singular(dilution_of_precision(at([(45, 0), (0, 0), (45, 0)], 100.0), ZERO, ZERO, F))


LINE, OFF_IT = np.arange(5)[:, None] * [1.0, 0.5, 0.2] + [5.0, 0.0, 0.0], np.eye(3)[[0, 1, 2, 1, 0]] - np.eye(3)[0]


@pytest.mark.parametrize("off_m", [1e-6, 1e-8, 1e-10])
def test_dilution_grows_as_landmarks_near_a_line_as_long_as_more_than_rounding_is_left(off_m):
    """The camera in the landmarks' axes turns about the line by errors that grow as one over their distance off it."""
    near, far = (dilution_of_precision(LINE + off * OFF_IT, ZERO, ZERO, F) for off in (off_m, 1e-5))
    assert near.pdop * off_m == pytest.approx(far.pdop * 1e-5, rel=1e-3)
    assert near.adop * off_m == pytest.approx(far.adop * 1e-5, rel=1e-3)


def test_any_line_is_singular_though_rounding_moves_landmarks_off_it():
    rng = np.random.default_rng(8)
    for _ in range(40):
        line = [6.0, 0.0, 0.0] + rng.uniform(-1.0, 1.0, 3) + rng.uniform(-1.0, 1.0, (6, 1)) * rng.uniform(-1.0, 1.0, 3)
        assert singular(dilution_of_precision(line, ZERO, ZERO, F))


def test_what_leaves_double_precision_is_singular():
    """Variances beyond the largest number; a landmark so near the camera's plane that its image moves by no number."""
    assert singular(dilution_of_precision(1e153 * (LINE + OFF_IT), ZERO, ZERO, F))
    grazing = np.vstack([LINE + OFF_IT, [1e-200, 1.0, 0.0]])
    assert singular(dilution_of_precision(grazing, ZERO, ZERO, F))


def test_on_the_danger_cylinder_three_landmarks_are_singular_and_a_fourth_mends_it():
    """The cylinder on the circle of three landmarks, across their plane: the classical singularity of resection."""
    angle = np.deg2rad([0.0, 120.0, 240.0])
    landmarks = np.column_stack([np.full(3, 5.0), 1.0 + np.cos(angle), np.sin(angle)])  # the camera is at angle 180
    assert singular(dilution_of_precision(landmarks, ZERO, ZERO, F))
    beside = dilution_of_precision(landmarks, np.array([0.0, 0.05, 0.0]), ZERO, F)
    nearer = dilution_of_precision(landmarks, np.array([0.0, 0.01, 0.0]), ZERO, F)
    assert nearer.pdop > 3.0 * beside.pdop > 0.0
    fourth = np.vstack([landmarks, [6.0, 1.0, 0.5]])
    assert dilution_of_precision(fourth, ZERO, ZERO, F).status is DopStatus.SOLVED


def test_at_a_pitch_of_a_quarter_turn_only_the_euler_angles_are_singular():
    rpy = np.array([0.3, np.pi / 2.0, 0.0])
    dop = dilution_of_precision(in_view(rpy, np.eye(3), ZERO), ZERO, rpy, F)
    assert singular(dop) and dop.landmarks_in_camera.status is DopStatus.SOLVED


def test_two_landmarks_are_too_few_and_one_behind_the_camera_cannot_be_measured():
    landmarks = in_view(ZERO, np.eye(3), ZERO, 4)
    two = dilution_of_precision(landmarks[:2], ZERO, ZERO, F)
    assert two.status is DopStatus.TOO_FEW_LANDMARKS and np.isnan(two.covariance).all()
    assert np.isfinite(two.jacobian).all() and dilution_of_precision(landmarks[:0], ZERO, ZERO, F).jacobian.shape == (
        0,
        6,
    )
    landmarks[1, 0] *= -1.0
    behind = dilution_of_precision(landmarks, ZERO, ZERO, F)
    assert behind.status is DopStatus.BEHIND_CAMERA and np.isnan([behind.dop, behind.pdop, behind.adop]).all()
    assert np.isnan(behind.jacobian[2:4]).all() and np.isfinite(np.delete(behind.jacobian, [2, 3], axis=0)).all()
    in_plane = dilution_of_precision_in_plane(np.array([[1.0, 0.0], [-1.0, 0.0], [2.0, 1.0]]), [0.0, 0.0], 0.0, F)
    assert in_plane.status is DopStatus.BEHIND_CAMERA
    landmarks[1] = [0.0, 1.0, 1.0]  # in the camera's own plane
    aside = dilution_of_precision(landmarks, ZERO, ZERO, F)
    assert aside.status is DopStatus.BEHIND_CAMERA and np.isnan(aside.jacobian[2:4]).all()
    at_the_body = dilution_of_precision_in_plane(np.array([[6.0, 4.5], [3.0, 4.0], [9.0, 1.0]]), [3.0, 4.0], 0.0, F)
    assert at_the_body.status is DopStatus.BEHIND_CAMERA
    assert dilution_of_precision_in_plane(np.ones((2, 2)), [0.0, 0.0], 0.0, F).status is DopStatus.TOO_FEW_LANDMARKS


NUMBERS = st.one_of(st.floats(-1e3, 1e3), st.sampled_from([0.0, 1.0, -1.0, 1e-300, 1e300, 5e-324]))


@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 6).flatmap(lambda n: arrays(float, (n, 3), elements=NUMBERS)),
    arrays(float, 3, elements=NUMBERS),
    arrays(float, 3, elements=st.floats(-10.0, 10.0)),
)
def test_any_geometry_gives_a_status_and_nan_unless_solved(landmarks, position, rpy):
    for dop in (
        dilution_of_precision(landmarks, position, rpy, F, MOUNTING),
        dilution_of_precision(landmarks, position, rpy, F, MOUNTING).landmarks_in_camera,
        dilution_of_precision_in_plane(landmarks[:, :2], position[:2], rpy[0], F),
    ):
        numbers = np.array([dop.dop, dop.pdop, dop.adop])
        if dop.status is DopStatus.SOLVED:
            assert (numbers > 0.0).all() and dop.dop**2 == pytest.approx(dop.pdop**2 + dop.adop**2)
            assert np.isfinite(dop.covariance).all()
        else:
            assert np.isnan(numbers).all() and np.isnan(dop.covariance).all()


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"landmarks_N": np.ones((3, 2))}, "landmarks_N"),
        ({"landmarks_N": np.array([[1.0, 2.0, np.nan]] * 3)}, "landmarks_N"),
        ({"landmarks_N": [["a"] * 3] * 3}, "landmarks_N"),
        ({"position_N": np.zeros(2)}, "position_N"),
        ({"roll_pitch_yaw_rad": [0.0, np.inf, 0.0]}, "roll_pitch_yaw_rad"),
        ({"focal_length_m": 0.0}, "focal_length_m"),
        ({"focal_length_m": "long"}, "focal_length_m"),
        ({"R_BC": 2.0 * np.eye(3)}, "R_BC"),
        ({"R_BC": np.diag([1.0, 1.0, -1.0])}, "R_BC"),
        ({"R_BC": np.eye(2)}, "R_BC"),
    ],
)
def test_wrong_arguments_are_refused_by_name(change, where):
    right = {"landmarks_N": np.ones((3, 3)), "position_N": ZERO, "roll_pitch_yaw_rad": ZERO, "focal_length_m": F}
    with pytest.raises(DockairError, match=f"^{where}: expected"):
        dilution_of_precision(**(right | change))


def test_a_rotation_of_nine_printed_digits_is_one_and_one_of_four_is_none():
    landmarks = in_view(ZERO, MOUNTING, ZERO)
    printed = dilution_of_precision(landmarks, ZERO, ZERO, F, np.round(MOUNTING, 9))
    assert printed.pdop == pytest.approx(dilution_of_precision(landmarks, ZERO, ZERO, F, MOUNTING).pdop, rel=1e-6)
    with pytest.raises(DockairError, match="^R_BC: expected a rotation"):
        dilution_of_precision(landmarks, ZERO, ZERO, F, np.round(MOUNTING, 4))


def test_wrong_arguments_in_the_plane_are_refused_by_name():
    with pytest.raises(DockairError, match=r"^landmarks_N: expected an array \(n, 2\)"):
        dilution_of_precision_in_plane(np.ones((3, 3)), [0.0, 0.0], 0.0, F)
    with pytest.raises(DockairError, match="^yaw_rad: expected a number"):
        dilution_of_precision_in_plane(np.ones((3, 2)), [0.0, 0.0], [0.0], F)
    with pytest.raises(DockairError, match="^focal_length_m: expected a number > 0"):
        dilution_of_precision_in_plane(np.ones((3, 2)), [0.0, 0.0], 0.0, -F)
