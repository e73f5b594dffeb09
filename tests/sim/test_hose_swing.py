"""Linearised swings of the hose: closed forms, and MuJoCo's chain let ring."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0, j1, y0, y1

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rest import hinge_angles
from dockair.sim.hose.rig import HoseRig
from dockair.sim.hose.swing import LinearSwing, Mode

GRAVITY = 9.80665
HOSE, DROGUE = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
AIR, WIND_W = standard_atmosphere(6000.0), np.array([-180.0, 0.0, 0.0])


def test_hanging_hose_without_wind_swings_as_a_heavy_chain_with_a_tip_mass():
    """y = A J0(2 w sqrt(z/g)) + B Y0(...), z = M/rho + height over the tip; g y' = -w^2 y there, y = 0 at the top."""
    hose = load_parameters(
        "hose", HoseParameters, {"links": 40, "bending_stiffness_n_m2": 0.0, "bending_damping_n_m2_s": 0.0}
    )
    drogue = replace(
        DROGUE, centre_of_mass_x_m=DROGUE.hose_joint_x_m - 1e-3, inertia_kg_m2=np.full(3, 1e-3), hinge_damping_n_m_s=0.0
    )
    modes = LinearSwing(hose, drogue, np.array([-1e-9, 0.0, 0.0]), AIR, "lateral").modes()
    z_tip = drogue.mass_kg / hose.line_density_kg_m
    z_top = z_tip + hose.length_m

    def determinant(omega):
        tip, top = 2.0 * omega * np.sqrt(z_tip / GRAVITY), 2.0 * omega * np.sqrt(z_top / GRAVITY)
        slope = omega / np.sqrt(GRAVITY * z_tip)
        first = omega**2 * j0(tip) - GRAVITY * slope * j1(tip)
        return first * y0(top) - (omega**2 * y0(tip) - GRAVITY * slope * y1(tip)) * j0(top)

    grid = np.linspace(0.3, 4.0, 400)
    signs = np.sign([determinant(omega) for omega in grid])
    exact = [brentq(determinant, grid[k], grid[k + 1]) for k in np.flatnonzero(np.diff(signs))]
    assert len(exact) >= 2
    # 40 links for a continuous chain: error of order 1/40^2
    np.testing.assert_allclose([abs(mode.eigenvalue_1_s) for mode in modes[:2]], exact[:2], rtol=3e-3)
    assert abs(modes[0].damping_ratio) < 1e-6


def test_first_swing_of_a_taut_light_hose_is_a_pendulum_in_the_pull_of_its_drag():
    """A point mass on a string in a stream, sideways: w^2 = F/(m l) in the pull F; the air damps it with D/(m V)."""
    hose = load_parameters("hose", HoseParameters, {"links": 4, "bending_stiffness_n_m2": 0.0})
    hose = replace(hose, line_density_kg_m=1e-4, radius_m=1e-6, bending_damping_n_m2_s=0.0)
    drogue = replace(
        DROGUE, centre_of_mass_x_m=DROGUE.hose_joint_x_m, drag_centre_x_m=DROGUE.hose_joint_x_m - 1e-3,
        inertia_kg_m2=np.full(3, 1e-6), rate_damping_coefficient=0.0, hinge_damping_n_m_s=0.0,
    )  # fmt: skip
    mode = LinearSwing(hose, drogue, WIND_W, AIR, "lateral").modes()[0]
    drag = 0.5 * AIR.density_kg_m3 * 180.0**2 * DROGUE.drag_area_m2 * DROGUE.drag_coefficient
    pull = np.hypot(drag, drogue.mass_kg * GRAVITY)
    stiffness, damping = pull / (drogue.mass_kg * hose.length_m), drag / 180.0 / drogue.mass_kg
    assert abs(mode.eigenvalue_1_s) == pytest.approx(np.sqrt(stiffness), rel=2e-3)
    assert -2.0 * mode.eigenvalue_1_s.real == pytest.approx(damping, rel=0.02)
    assert mode.damping_ratio == pytest.approx(0.5 * damping / np.sqrt(stiffness), rel=0.02)
    assert mode.period_s == pytest.approx(2.0 * np.pi / np.sqrt(stiffness - 0.25 * damping**2), rel=3e-3)


@pytest.mark.parametrize("ratio", [-0.1, 0.05, 0.6])
def test_a_modes_period_and_damping_are_an_oscillators(ratio):
    """q'' + 2 z w q' + w^2 q = 0 has lambda = w (-z + i sqrt(1 - z^2))."""
    omega = 2.7
    root = np.roots([1.0, 2.0 * ratio * omega, omega**2])[0]
    mode = Mode(eigenvalue_1_s=complex(root.real, abs(root.imag)), shape=np.zeros(1, dtype=complex))
    assert mode.damping_ratio == pytest.approx(ratio)
    assert mode.period_s == pytest.approx(2.0 * np.pi / (omega * np.sqrt(1.0 - ratio**2)))


def test_mass_matrix_springs_and_dampers_are_mujocos_in_absolute_angles():
    """The rate of hinge i about y is -(q_i' - q_(i-1)'): M_hinges = T' M T with T the sum over the links before."""
    rig, swing = HoseRig(HOSE, DROGUE, WIND_W, AIR), LinearSwing(HOSE, DROGUE, WIND_W, AIR, "vertical")
    model, n = rig.model, HOSE.links + 1
    joints = [model.joint(f"{name}_y").id for name in [*(f"hose_{i}" for i in range(HOSE.links)), "drogue"]]
    dofs = model.jnt_dofadr[joints]
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, rig.data, mass)
    total = np.tril(np.ones((n, n)))
    np.testing.assert_allclose(total.T @ swing.M @ total, mass[np.ix_(dofs, dofs)], rtol=1e-9)
    limp = replace(HOSE, bending_stiffness_n_m2=0.0, bending_damping_n_m2_s=0.0)
    bare = LinearSwing(limp, replace(DROGUE, hinge_damping_n_m_s=0.0), WIND_W, AIR, "vertical")
    for ours, mujocos in ((swing.C - bare.C, model.dof_damping[dofs]), (swing.K - bare.K, model.jnt_stiffness[joints])):
        np.testing.assert_allclose(total.T @ ours @ total, np.diag(mujocos), atol=1e-4)


def test_every_swing_of_the_default_hose_is_damped_and_its_matrices_are_those_of_a_chain():
    for plane in ("vertical", "lateral"):
        swing = LinearSwing(HOSE, DROGUE, WIND_W, AIR, plane)
        np.testing.assert_allclose(swing.M, swing.M.T, rtol=1e-12)
        assert np.linalg.eigvalsh(swing.M).min() > 0.0
        modes = swing.modes()
        assert len(modes) > HOSE.links // 2 and all(mode.eigenvalue_1_s.real < 0.0 for mode in modes)
        periods = [mode.period_s for mode in modes[:6]]
        assert periods == sorted(periods, reverse=True)


@pytest.mark.parametrize("plane", ["vertical", "lateral"])
def test_mujocos_chain_in_one_mode_stays_in_it_and_swings_and_decays_as_its_eigenvalue_says(plane):
    """Half the difference of a swing to either side, after one period: exp(lambda T), to the step's first order."""
    hose = replace(HOSE, bending_stiffness_n_m2=0.0)  # whose shape at rest is exact
    swing = LinearSwing(hose, DROGUE, WIND_W, AIR, plane)
    mode, rig = swing.modes()[0], HoseRig(hose, DROGUE, WIND_W, AIR)
    axis, instant_s, ticks = {"vertical": 2, "lateral": 1}[plane], 1e-4, 2314
    before, now, after = (swing.directions(mode, 0.02, t) for t in (-instant_s, 0.0, instant_s))
    rig.put(now, (hinge_angles(after) - hinge_angles(before)) / (2.0 * instant_s))
    rest = rig.rest.p_WH[-1, axis]
    assert rig.hose_end()[axis] - rest == pytest.approx(0.02, rel=0.01)
    path = np.empty(ticks)
    for k in range(ticks):
        rig.step()
        path[k] = rig.hose_end()[axis] - rest
    expected = 0.02 * np.real(np.exp(mode.eigenvalue_1_s * 1e-3 * np.arange(1, ticks + 1)))
    np.testing.assert_allclose(path, expected, atol=1e-4)  # half a per cent of the amplitude


def test_more_drag_on_the_drogue_shortens_the_swing_and_more_damping_of_the_hose_damps_it():
    def first(hose=HOSE, drogue=DROGUE):
        return LinearSwing(hose, drogue, WIND_W, AIR, "lateral").modes()[0]

    assert first(drogue=replace(DROGUE, drag_coefficient=1.0)).period_s < 0.99 * first().period_s
    damped = replace(HOSE, bending_damping_n_m2_s=50.0)
    assert first(hose=damped).damping_ratio > first().damping_ratio


def _heights(make_world, locked):
    """Hose's end over its rest through two swings, let go 2.6 m up in the first vertical mode."""
    linear = LinearSwing(HOSE, DROGUE, np.array([-150.0, 0.0, 0.0]), standard_atmosphere(6096.0), "vertical")
    world = make_world(
        airspeed_m_s=150.0, altitude_m=6096.0, p_PD_B=(60.0, 0.0, 0.0), reel_locked=lambda time_s: locked
    )
    world.data.qpos[world._at.hinges] = hinge_angles(linear.directions(linear.modes()[0], 2.6, 0.0)).ravel()
    truths = [world.step(ReceiverCommand()) for _ in range(4000)]
    height = np.array([truth.p_WH[-1, 2] for truth in truths]) - world.rest.p_WH[-1, 2]
    return height, np.array([truth.reel_position_m for truth in truths])


def test_a_large_vertical_swing_decays_alike_on_a_working_reel_and_on_a_locked_one(make_world):
    """The reel rests on its stop, which the swing's tension hardly moves: it neither damps nor feeds the swing."""
    (working, moved), (held, _) = (_heights(make_world, locked) for locked in (False, True))
    assert np.ptp(held) > 2.5
    assert 0.0 < np.ptp(moved) < 0.02
    np.testing.assert_allclose(working, held, atol=0.01 * np.ptp(held))
