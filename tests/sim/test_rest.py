"""Angles of the chain from its directions; the shape itself is checked in check_cases/test_hose_statics.py."""

import numpy as np

from dockair.rotations import exp
from dockair.sim.hose.rest import hinge_angles


def test_hinge_angles_turn_each_link_into_its_direction():
    """First about y, then about z in the turned axes, link after link; also for a link across or against the first."""
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(12, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[3] = [-1.0, 0.0, 0.0]
    R = np.eye(3)
    for (about_y, about_z), direction in zip(hinge_angles(directions), directions, strict=True):
        R = R @ exp(np.array([0.0, about_y, 0.0])) @ exp(np.array([0.0, 0.0, about_z]))
        np.testing.assert_allclose(R[:, 0], direction, atol=1e-9)


def test_straight_hose_has_no_angle_but_the_first_and_a_drooping_one_turns_nose_up():
    t = np.array([np.cos(0.2), 0.0, np.sin(0.2)])  # toward the tanker, up: it hangs down aft
    angles = hinge_angles(np.array([t, t, t]))
    np.testing.assert_allclose(angles, [[-0.2, 0.0], [0.0, 0.0], [0.0, 0.0]], atol=1e-12)
