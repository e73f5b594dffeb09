"""Angles of the chain, a drogue with lift; the shape itself is checked in check_cases/test_hose_statics.py."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import drogue_force, hose_load_per_length, load_coefficients
from dockair.sim.hose.rest import hinge_angles, rest_shape


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


@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.4])
def test_drogue_with_lift_balances_about_the_hoses_end_and_pulls_with_its_whole_force(ratio):
    """Force written anew: axial S C_D, across `ratio` times that; the lift lowers or raises the hose's end."""
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    drogue = replace(drogue, canopy_side_coefficient=ratio * drogue.drag_coefficient / drogue.canopy_area_ratio)
    wind, rho = np.array([-120.0, 0.0, 0.0]), 0.909
    rest = rest_shape(hose, drogue, wind, rho, 1.863e-5)
    t = rest.t_D_W
    axial = (wind @ t) * t
    area = np.pi / 4.0 * drogue.drag_diameter_m**2 * drogue.drag_coefficient
    force = 0.5 * rho * 120.0 * area * (axial + ratio * (wind - axial))
    weight = np.array([0.0, 0.0, -9.80665 * drogue.mass_kg])
    to_mass, to_drag = drogue.hose_joint_x_m - drogue.centre_of_mass_x_m, drogue.hose_joint_x_m - drogue.drag_centre_x_m
    moment = np.cross(-to_mass * t, weight) + np.cross(-to_drag * t, force)
    np.testing.assert_allclose(moment, 0.0, atol=1e-9)
    assert rest.drogue_tension_n == pytest.approx(np.linalg.norm(force + weight), rel=1e-12)
    neutral = rest_shape(hose, replace(drogue, canopy_side_coefficient=0.5), wind, rho, 1.863e-5)
    assert np.sign(rest.p_WH[-1, 2] - neutral.p_WH[-1, 2]) == np.sign(ratio - 1.0)


LIFT = {"canopy_area_ratio": 3.0, "canopy_side_coefficient": 0.9, "drag_coefficient": 0.6}
NO_LIFT = {"canopy_area_ratio": 0.5, "canopy_side_coefficient": 0.3, "drag_coefficient": 1.0}
LITTLE_DRAG = {"drag_diameter_m": 0.4, "drag_coefficient": 0.6}


@pytest.mark.parametrize(
    ("of_hose", "of_drogue"), [({}, LIFT), ({}, NO_LIFT), ({"links": 4, "length_m": 23.0}, LITTLE_DRAG)]
)
@pytest.mark.parametrize("airspeed_m_s", [100.0, 180.0])
def test_at_the_ends_of_the_sheets_drogue_and_every_link_are_in_balance_too(of_hose, of_drogue, airspeed_m_s):
    """Plain iteration at 180 and 100 m/s ended 73 degrees off the first drogue's balance, 71 off a long link's."""
    hose, drogue = (
        load_parameters("hose", HoseParameters, of_hose),
        load_parameters("drogue", DrogueParameters, of_drogue),
    )
    wind, rho, nu = np.array([-airspeed_m_s, 0.0, 0.0]), 0.66, 2.4e-5
    rest, k = rest_shape(hose, drogue, wind, rho, nu), load_coefficients(hose, drogue, rho, nu)
    force, weight = drogue_force(rest.t_D_W, wind, k), np.array([0.0, 0.0, -9.80665 * drogue.mass_kg])
    to_mass, to_drag = drogue.hose_joint_x_m - drogue.centre_of_mass_x_m, drogue.hose_joint_x_m - drogue.drag_centre_x_m
    pull = force + weight
    np.testing.assert_allclose(
        np.cross(rest.t_D_W, to_mass * weight + to_drag * force) / np.linalg.norm(pull), 0.0, atol=1e-9
    )
    for t in rest.t_W[::-1]:
        load = hose.link_length_m * hose_load_per_length(t, wind, k)
        load[2] -= 9.80665 * hose.link_mass_kg
        np.testing.assert_allclose(np.cross(t, pull + 0.5 * load) / np.linalg.norm(pull), 0.0, atol=1e-9)
        pull = pull + load
    assert rest.root_tension_n == pytest.approx(np.linalg.norm(pull), rel=1e-9)


def test_in_air_that_differs_along_the_hose_every_link_is_in_balance_in_its_own():
    """Side wind that grows toward the drogue: no moment about any front joint, and the root carries all loads."""
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    rho, nu = 0.66, 2.4e-5
    winds = np.tile([-150.0, 0.0, -3.0], (hose.links + 1, 1))
    winds[:, 1] = np.linspace(0.0, 8.0, hose.links + 1)
    rest, k = rest_shape(hose, drogue, winds, rho, nu), load_coefficients(hose, drogue, rho, nu)
    pull = drogue_force(rest.t_D_W, winds[-1], k) + [0.0, 0.0, -9.80665 * drogue.mass_kg]
    assert np.linalg.norm(pull) == pytest.approx(rest.drogue_tension_n, rel=1e-12)
    for i in reversed(range(hose.links)):
        load = hose.link_length_m * hose_load_per_length(rest.t_W[i], winds[i], k)
        load[2] -= 9.80665 * hose.link_mass_kg
        np.testing.assert_allclose(np.cross(rest.t_W[i], pull + 0.5 * load), 0.0, atol=1e-6)
        pull = pull + load
    assert rest.root_tension_n == pytest.approx(np.linalg.norm(pull), rel=1e-12)
    assert rest.p_WH[-1, 1] > 0.1
    uniform = [
        rest_shape(hose, drogue, wind, rho, nu).p_WH for wind in (winds[0], np.tile(winds[0], (hose.links + 1, 1)))
    ]
    assert np.array_equal(*uniform)


def test_air_acts_at_the_links_middles_and_where_the_drogues_drag_balances_its_weight_about_the_hoses_end():
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    wind, rho, nu = np.array([-120.0, 0.0, 0.0]), 0.909, 1.863e-5
    rest = rest_shape(hose, drogue, wind, rho, nu)
    places, end = rest.air_places_W(drogue), rest.p_WH[-1]
    force = drogue_force(rest.t_D_W, wind, load_coefficients(hose, drogue, rho, nu))
    weight = np.array([0.0, 0.0, -9.80665 * drogue.mass_kg])
    mass = (drogue.centre_of_mass_x_m - drogue.hose_joint_x_m) * rest.t_D_W
    np.testing.assert_allclose(np.cross(places[-1] - end, force) + np.cross(mass, weight), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.cross(places[-1] - end, rest.t_D_W), 0.0, atol=1e-12)
    np.testing.assert_allclose(2.0 * places[:-1] - rest.p_WH[:-1], rest.p_WH[1:], atol=1e-12)
