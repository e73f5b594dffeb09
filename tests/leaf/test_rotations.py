import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from dockair.rotations import (
    FLU_FROM_FRD,
    Array,
    exp,
    log,
    matrix_from_mrp,
    matrix_from_quaternion,
    matrix_from_yaw_pitch_roll,
    mrp_from_matrix,
    quaternion_from_matrix,
    skew,
    yaw_pitch_roll_from_matrix,
)

#: Rotation angles: nothing, where the series of `exp` takes over, ordinary, just short of half a turn.
ANGLES = (0.0, 1e-12, 1e-6, 0.99e-4, 1.01e-4, 0.1, 2.0, np.pi - 1e-3, np.pi - 1e-6)


def axes() -> Array:
    """Twenty directions, the coordinate axes among them."""
    directions = np.vstack([np.eye(3), -np.eye(3), np.random.default_rng(1).normal(size=(14, 3))])
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


vectors = st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3).map(np.array)


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-13)


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_is_the_matrix_exponential(angle):
    for axis in axes():
        np.testing.assert_allclose(exp(angle * axis), expm(skew(angle * axis)), atol=1e-14)


@given(vectors)
def test_exp_is_a_rotation(phi):
    R = exp(phi)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-13)
    assert np.linalg.det(R) == pytest.approx(1.0)


@given(vectors, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_turns_about_one_axis_add_and_commute(phi, a, b):
    np.testing.assert_allclose(exp(a * phi) @ exp(b * phi), exp((a + b) * phi), atol=1e-12)
    np.testing.assert_allclose(exp(-phi), exp(phi).T, atol=1e-13)


@pytest.mark.parametrize("angle", ANGLES)
def test_log_undoes_exp_up_to_half_a_turn(angle):
    for axis in axes():
        np.testing.assert_allclose(log(exp(angle * axis)), angle * axis, rtol=1e-8, atol=1e-15)


def test_positive_exp_turns_by_the_right_hand():
    np.testing.assert_allclose(exp(np.array([0.0, 0.0, np.pi / 2.0])) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("angle", ANGLES)
def test_mrp_is_the_axis_times_the_tangent_of_a_quarter_of_the_angle(angle):
    """[Yoon 2018, eqs 38-39]; passive: C turns a vector by -angle about the axis."""
    for axis in axes():
        p = axis * np.tan(angle / 4.0)
        np.testing.assert_allclose(matrix_from_mrp(p), exp(-angle * axis), atol=1e-14)
        np.testing.assert_allclose(mrp_from_matrix(matrix_from_mrp(p)), p, atol=1e-9)


@given(vectors)
def test_mrp_agrees_with_scipy_of_opposite_sense(p):
    np.testing.assert_allclose(matrix_from_mrp(p), Rotation.from_mrp(-p).as_matrix(), atol=1e-12)


@given(vectors.filter(lambda p: np.linalg.norm(p) > 1e-3))
def test_shadow_mrp_is_the_same_attitude_and_the_short_one_is_returned(p):
    np.testing.assert_allclose(matrix_from_mrp(-p / (p @ p)), matrix_from_mrp(p), atol=1e-11)
    assert np.linalg.norm(mrp_from_matrix(matrix_from_mrp(p))) <= 1.0 + 1e-12


@given(vectors)
def test_quaternion_is_w_first_and_comes_back(phi):
    q = quaternion_from_matrix(exp(phi))
    assert q[0] >= 0.0
    assert np.linalg.norm(q) == pytest.approx(1.0)
    np.testing.assert_allclose(matrix_from_quaternion(q), exp(phi), atol=1e-12)


def test_quaternion_of_a_quarter_turn_about_z():
    h = np.sqrt(0.5)
    np.testing.assert_allclose(matrix_from_quaternion(np.array([h, 0.0, 0.0, h])) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("angles", "nose"),
    [((0.1, 0.0, 0.0), (1, 1)), ((0.0, 0.1, 0.0), (2, -1)), ((0.0, -0.1, 0.0), (2, 1))],
    ids=["positive yaw is to the left", "positive pitch is nose down", "negative pitch is nose up"],
)
def test_sign_of_the_nose(angles, nose):
    axis, sign = nose
    assert sign * matrix_from_yaw_pitch_roll(*angles)[axis, 0] == pytest.approx(np.sin(0.1))


def test_positive_roll_lowers_the_right_wing():
    right = np.array([0.0, -1.0, 0.0])
    assert (matrix_from_yaw_pitch_roll(0.0, 0.0, 0.1) @ right)[2] == pytest.approx(-np.sin(0.1))


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_euler_angles_are_yaw_then_pitch_then_roll_and_come_back(yaw, pitch, roll):
    R = matrix_from_yaw_pitch_roll(yaw, pitch, roll)
    x, y, z = np.eye(3)
    np.testing.assert_allclose(R, exp(yaw * z) @ exp(pitch * y) @ exp(roll * x), atol=1e-13)
    np.testing.assert_allclose(yaw_pitch_roll_from_matrix(R), [yaw, pitch, roll], atol=1e-9)


def test_frd_conversion_is_its_own_inverse_and_a_rotation():
    np.testing.assert_array_equal(FLU_FROM_FRD @ FLU_FROM_FRD, np.eye(3))
    assert np.linalg.det(FLU_FROM_FRD) == 1.0
    np.testing.assert_array_equal(FLU_FROM_FRD @ [1.0, 2.0, 3.0], [1.0, -2.0, -3.0])
