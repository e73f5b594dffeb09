"""Hose and drogue at rest: against published and independent solutions, and closed forms."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import j0, j1, y0, y1

from dockair.calibration import Mounting
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.hose.rest import hinge_angles, rest_shape
from dockair.sim.outlines import TankerParameters
from dockair.sim.scene import SceneParameters, build_scene

GRAVITY = 9.80665

# Airspeed, altitude, hose, drogue's diameter and mass -> aft, below [m], root, drogue tension [N]: a solution by other
# hands (rigid links, C_n 1.2, C_f 0.0464 Re^-1/6, no wake)
ROWS = [
    (120.0, 3000.0, 15.0, 0.61, 29.5, 14.56, 3.59, 1778.0, 1557.0),
    (120.0, 3000.0, 15.0, 0.50, 20.0, 14.53, 3.73, 1274.0, 1047.0),
    (120.0, 3000.0, 20.0, 0.50, 20.0, 19.34, 5.07, 1353.0, 1047.0),
    (150.0, 6000.0, 15.0, 0.50, 20.0, 14.59, 3.44, 1409.0, 1182.0),
    (180.0, 6000.0, 15.0, 0.50, 20.0, 14.75, 2.71, 1920.0, 1690.0),
    (150.0, 6000.0, 22.9, 0.50, 20.0, 22.24, 5.45, 1536.0, 1182.0),
]


def _sheets(length_m, diameter_m, mass_kg):
    hose = load_parameters("hose", HoseParameters, {"length_m": length_m})
    drogue = load_parameters("drogue", DrogueParameters, {"drag_diameter_m": diameter_m, "mass_kg": mass_kg})
    return hose, drogue


def _continuous_cable(speed, density, viscosity, length, diameter_m, mass_kg):
    """The hose as a continuous cable, integrated from the drogue up: d(T t)/ds + load + weight = 0.

    t points down the hose, away from the tanker; s runs from the drogue up. Returns aft, below, both tensions.
    """
    d, per_metre = 2 * 0.0336, 4.1 * GRAVITY
    drag = 0.5 * density * np.pi / 4 * diameter_m**2 * 0.8 * speed**2
    end = np.array([drag, mass_kg * GRAVITY])  # x aft, z down

    def slope(_, state):
        tension = state[:2]
        t = tension / np.hypot(*tension)
        normal = np.array([-t[1], t[0]])
        across, along = speed * -t[1], speed * t[0]  # the stream's components on `normal` and t
        reynolds = np.pi * d * speed**2 / (2 * viscosity * abs(across))
        friction = 0.5 * density * np.pi * d * 0.0464 * reynolds ** (-1 / 6) * along**2
        cross = 0.5 * density * d * 1.2 * abs(across) * across
        load = cross * normal + friction * t + np.array([0.0, per_metre])
        return np.concatenate([load, t])

    solution = solve_ivp(slope, (0.0, length), np.concatenate([end, [0.0, 0.0]]), rtol=1e-9, atol=1e-9)
    root_tension, place = solution.y[:2, -1], solution.y[2:, -1]
    return place[0], place[1], np.hypot(*root_tension), np.hypot(*end)


@pytest.mark.parametrize("row", ROWS)
def test_rest_shape_agrees_with_two_other_solutions(row):
    """Within 2 % in tension and 0.1 m in place of both; 0.5 % and 0.03 m of the continuous cable."""
    speed, altitude, length, diameter, mass, *reference = row
    air = standard_atmosphere(altitude)
    hose, drogue = _sheets(length, diameter, mass)
    wind = np.array([-speed, 0.0, 0.0])
    rest = rest_shape(hose, drogue, wind, air.density_kg_m3, air.kinematic_viscosity_m2_s)
    ours = np.array([-rest.p_WH[-1, 0], -rest.p_WH[-1, 2], rest.root_tension_n, rest.drogue_tension_n])
    np.testing.assert_allclose(ours[:2], reference[:2], atol=0.1)
    np.testing.assert_allclose(ours[2:], reference[2:], rtol=0.02)
    cable = _continuous_cable(speed, air.density_kg_m3, air.kinematic_viscosity_m2_s, length, diameter, mass)
    np.testing.assert_allclose(ours[:2], cable[:2], atol=0.03)
    np.testing.assert_allclose(ours[2:], cable[2:], rtol=0.005)


@pytest.mark.parametrize("row", ROWS)
def test_rest_shape_balances_every_hinge_of_the_model_exactly(make_world, row):
    """Gravity and air loads, as the world applies them, leave no moment about any hinge of a hose without stiffness."""
    speed, altitude, length, diameter, mass, *_ = row
    world = make_world(
        airspeed_m_s=speed,
        altitude_m=altitude,
        hose={"length_m": length, "bending_stiffness_n_m2": 0.0},
        drogue={"drag_diameter_m": diameter, "mass_kg": mass},
        p_PD_B=(80.0, 0.0, 0.0),
    )
    world.step(ReceiverCommand())
    first, last = world.model.joint("hose_0_y").dofadr[0], world.model.joint("drogue_z").dofadr[0]
    np.testing.assert_allclose(world.data.qfrc_smooth[first : last + 1], 0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("row", [ROWS[0], ROWS[4], ROWS[5]])
def test_world_let_go_in_another_shape_comes_to_rest_there(make_world, row):
    """The hose starts straight, along the pod's axis; its swing dies out with a time constant of 4 to 6 s."""
    speed, altitude, length, diameter, mass, *reference = row
    world = make_world(
        airspeed_m_s=speed,
        altitude_m=altitude,
        hose={"length_m": length},
        drogue={"drag_diameter_m": diameter, "mass_kg": mass},
        p_PD_B=(80.0, 0.0, 0.0),
    )
    world.data.qpos[world.model.joint("hose_0_y").qposadr[0] : world.model.joint("drogue_z").qposadr[0] + 1] = 0.0
    mujoco.mj_step1(world.model, world.data)
    for _ in range(45000):
        truth = world.step(ReceiverCommand())
    assert np.linalg.norm(truth.v_WD) < 0.02
    np.testing.assert_allclose([-truth.p_WH[-1, 0], -truth.p_WH[-1, 2]], reference[:2], atol=0.1)
    np.testing.assert_allclose([truth.root_tension_n, truth.drogue_tension_n], reference[2:], rtol=0.02)


def test_drogue_on_a_nearly_massless_hose_hangs_at_the_angle_of_its_weight_to_its_drag():
    hose, drogue = _sheets(15.0, 0.5, 20.0)
    rest = rest_shape(hose, drogue, np.array([-150.0, 0.0, 0.0]), 0.66, 2.4e-5)
    drag = 0.5 * 0.66 * np.pi / 4 * 0.25 * 0.8 * 150.0**2
    last = rest.t_W[-1]
    slope_of_pull = 20.0 * GRAVITY / drag
    # the last link turns from the pull's direction only by half its own load, 2 % of the pull
    assert last[2] / last[0] == pytest.approx(slope_of_pull, rel=0.1)
    assert rest.drogue_tension_n == pytest.approx(np.hypot(drag, 20.0 * GRAVITY), rel=1e-12)


def _scene(hose, drogue):
    return build_scene(
        SceneParameters(
            hose=hose,
            drogue=drogue,
            reel=load_parameters("reel", ReelParameters),
            coupling=load_parameters("coupling", CouplingParameters),
            tanker=load_parameters("tanker", TankerParameters),
            mounting=Mounting(R_BC=np.eye(3), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6])),
            receiver_mass_kg=9300.0,
            receiver_inertia_B=np.diag([12874.0, 75674.0, 85552.0]),
            sun_direction_W=np.array([0.0, 0.0, 1.0]),
            step_s=1e-3,
        )
    )


def _without_air():
    """Scene without bending stiffness; the drogue all but a point mass at the hose's end."""
    hose = load_parameters("hose", HoseParameters, {"bending_stiffness_n_m2": 0.0, "links": 40})
    drogue = load_parameters(
        "drogue",
        DrogueParameters,
        {"centre_of_mass_x_m": 0.449, "hose_joint_x_m": 0.45, "inertia_kg_m2": [0.05, 0.05, 0.05]},
    )
    return hose, drogue, _scene(hose, drogue)


def test_chain_pulled_aft_without_air_balances_in_the_discrete_catenary():
    """tan(theta_i) = (W + (n - i - 1/2) w) / H: every hinge is in balance, and the reel feels H."""
    hose, drogue, model = _without_air()
    pull, link_weight = 900.0, hose.link_mass_kg * GRAVITY
    below = drogue.mass_kg * GRAVITY + (hose.links - np.arange(hose.links) - 0.5) * link_weight
    theta = np.append(np.arctan2(below, pull), np.arctan2(drogue.mass_kg * GRAVITY, pull))
    directions = np.column_stack([np.cos(theta), np.zeros(len(theta)), np.sin(theta)])
    data = mujoco.MjData(model)
    first, last = model.joint("hose_0_y").qposadr[0], model.joint("drogue_z").qposadr[0]
    data.qpos[first : last + 1] = hinge_angles(directions).ravel()
    data.xfrc_applied[model.body("drogue").id, 0] = -pull
    mujoco.mj_forward(model, data)
    first_dof, last_dof = model.joint("hose_0_y").dofadr[0], model.joint("drogue_z").dofadr[0]
    np.testing.assert_allclose(data.qfrc_smooth[first_dof : last_dof + 1], 0.0, atol=1e-8 * pull)
    assert data.qfrc_smooth[model.joint("reel").dofadr[0]] == pytest.approx(-pull, rel=1e-12)


def _hanging_frequency(hose, tip_mass):
    """Lowest frequency of a heavy chain with a tip mass, closed form: y = A J0(2 w sqrt(z/g)) + B Y0(...).

    z = M / rho + s, s from the tip up; clamped at the top, g y' = -w^2 y at the tip.
    """
    z_tip = tip_mass / hose.line_density_kg_m
    z_top = z_tip + hose.length_m

    def determinant(omega):
        tip, top = 2 * omega * np.sqrt(z_tip / GRAVITY), 2 * omega * np.sqrt(z_top / GRAVITY)
        slope = omega / np.sqrt(GRAVITY * z_tip)  # d(argument)/dz at the tip
        rows = [
            [omega**2 * j0(tip) - GRAVITY * slope * j1(tip), omega**2 * y0(tip) - GRAVITY * slope * y1(tip)],
            [j0(top), y0(top)],
        ]
        return np.linalg.det(rows)

    return brentq(determinant, 0.5 * np.sqrt(GRAVITY / hose.length_m), 1.4 * np.sqrt(GRAVITY / hose.length_m))


@pytest.mark.parametrize("letter", ["y", "z"])
def test_small_swing_of_the_hanging_hose_has_the_period_of_a_heavy_chain_with_a_tip_mass(letter):
    """Frequencies from the model's mass matrix and the differences of its gravity load, in both planes of swing."""
    hose, drogue, model = _without_air()
    data = mujoco.MjData(model)
    first, last = model.joint("hose_0_y").qposadr[0], model.joint("drogue_z").qposadr[0]
    hanging = np.tile([0.0, 0.0, 1.0], (hose.links + 1, 1))
    data.qpos[first : last + 1] = hinge_angles(hanging).ravel()
    dofs = [model.joint(f"hose_{i}_{letter}").dofadr[0] for i in range(hose.links)] + [
        model.joint(f"drogue_{letter}").dofadr[0]
    ]
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    stiffness, step = np.zeros((len(dofs), len(dofs))), 1e-5
    rest = data.qpos.copy()
    for column, dof in enumerate(dofs):
        for sign in (1.0, -1.0):
            data.qpos[:] = rest
            data.qpos[model.jnt_qposadr[model.dof_jntid[dof]]] += sign * step
            mujoco.mj_forward(model, data)
            stiffness[:, column] += sign * data.qfrc_bias[dofs] / (2 * step)
    frequencies = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass[np.ix_(dofs, dofs)], stiffness)).real))
    # 40 links for a continuous chain: error of order 1/40^2, and the drogue hangs 1 mm below the hose's end
    assert frequencies[0] == pytest.approx(_hanging_frequency(hose, drogue.mass_kg), rel=2e-3)
