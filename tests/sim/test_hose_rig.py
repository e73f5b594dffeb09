"""MuJoCo's hose and drogue alone: closed forms, energy, symmetries."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rig import HoseRig

GRAVITY = 9.80665
DROGUE = load_parameters("drogue", DrogueParameters)
LIMP = {"bending_stiffness_n_m2": 0.0, "bending_damping_n_m2_s": 0.0}
FAST_W = np.array([-180.0, 0.0, 0.0])


def _hose(**values):
    return load_parameters("hose", HoseParameters, values)


def _straight(hose, direction=(1.0, 0.0, 0.0)):
    return np.tile(np.divide(direction, np.linalg.norm(direction)), (hose.links + 1, 1))


def _leaning(rig, sideways=0.08, upward=0.06):
    """Directions of the chain at rest, leaning the more the farther aft."""
    t = np.vstack([rig.rest.t_W, rig.rest.t_D_W])
    t += np.linspace(0.0, 1.0, len(t))[:, None] * np.array([0.0, sideways, upward])
    return t / np.linalg.norm(t, axis=1, keepdims=True)


def test_hose_let_go_straight_settles_where_it_rests_and_its_drogue_as_well():
    hose = _hose(bending_stiffness_n_m2=0.0)
    rig = HoseRig(hose, DROGUE, np.array([-120.0, 0.0, 0.0]), standard_atmosphere(3000.0), step_s=2e-3)
    rig.put(_straight(hose))
    rig.relax(16.0, 1.0)
    rest = rig.rest
    np.testing.assert_allclose(rig.joints(), rest.p_WH, atol=1e-4)
    np.testing.assert_allclose(rig.drogue_axis(), rest.t_D_W, atol=1e-4)
    np.testing.assert_allclose(rig.tensions(), [rest.root_tension_n, rest.drogue_tension_n], rtol=1e-5)


def test_relaxing_brakes_a_motion_that_nothing_else_slows_by_its_own_rate_alone():
    """A straight hose that moves along with its exit, without air and weight: exp(-0.7 x 2) of it is left."""
    hose = _hose(**LIMP)
    rig = HoseRig(hose, DROGUE, np.zeros(3), None, step_s=2e-3, gravity_W=np.zeros(3))
    rig.put(_straight(hose), exit_m_s=5.0)
    before = np.abs(rig.data.qvel).max()
    rig.relax(2.0, 0.7)
    assert before == pytest.approx(5.0)
    assert np.abs(rig.data.qvel).max() == pytest.approx(5.0 * np.exp(-1.4), rel=1e-6)


def test_hose_pulled_aft_without_air_hangs_in_a_catenary():
    """aft = H/w (asinh((W + w L)/H) - asinh(W/H)) and so on; 40 links for a continuous cable: of order 1/40^2."""
    hose, pull = _hose(links=40, bending_stiffness_n_m2=0.0), 900.0
    rig = HoseRig(hose, DROGUE, np.zeros(3), None, step_s=2e-3)
    rig.pull(np.array([-pull, 0.0, 0.0]))
    rig.relax(25.0, 1.0)
    w, W, length = hose.line_density_kg_m * GRAVITY, DROGUE.mass_kg * GRAVITY, hose.length_m
    top = (W + w * length) / pull
    aft = pull / w * (np.arcsinh(top) - np.arcsinh(W / pull))
    below = pull / w * (np.hypot(1.0, top) - np.hypot(1.0, W / pull))
    np.testing.assert_allclose(rig.hose_end(), [-aft, 0.0, -below], atol=3e-4)
    np.testing.assert_allclose(rig.tensions(), [pull * np.hypot(1.0, top), np.hypot(pull, W)], rtol=1e-5)


def test_every_link_lies_at_the_critical_angle_if_the_drogue_pulls_along_it():
    """w cos(theta) = 1/2 rho d C_n V^2 sin^2(theta), at 60 m/s and 3000 m 31 degrees."""
    hose, air, speed = _hose(bending_stiffness_n_m2=0.0), standard_atmosphere(3000.0), 60.0
    across = air.density_kg_m3 * 2.0 * hose.radius_m * hose.normal_drag_coefficient * speed**2
    k = hose.line_density_kg_m * GRAVITY / across
    theta = np.arccos(np.sqrt(k**2 + 1.0) - k)
    drag = 0.5 * air.density_kg_m3 * speed**2 * DROGUE.drag_area_m2 * DROGUE.drag_coefficient
    drogue = replace(DROGUE, mass_kg=float(drag * np.tan(theta) / GRAVITY))
    rig = HoseRig(hose, drogue, np.array([-speed, 0.0, 0.0]), air, step_s=2e-3)
    rig.put(_straight(hose))
    rig.relax(20.0, 1.0)
    np.testing.assert_allclose(rig.joints()[1:], -hose.link_length_m * np.outer(
        np.arange(1, hose.links + 1), [np.cos(theta), 0.0, np.sin(theta)]
    ), atol=1e-5)  # fmt: skip


def test_hose_of_almost_no_mass_and_no_drag_runs_along_its_drogues_pull():
    air = standard_atmosphere(3000.0)
    hose = replace(_hose(links=4, **LIMP), line_density_kg_m=1e-3, normal_drag_coefficient=0.0)
    hose = replace(hose, supercritical_drag_coefficient=0.0, friction_coefficient=0.0)
    rig = HoseRig(hose, DROGUE, np.array([-120.0, 0.0, 0.0]), air)
    rig.put(_straight(hose))
    rig.relax(20.0, 1.0)
    drag = 0.5 * air.density_kg_m3 * 120.0**2 * 0.8 * np.pi / 4.0 * 0.5**2
    angle = np.arctan2(DROGUE.mass_kg * GRAVITY, drag)
    # 15 g of hose on 105 kg of pull: 1e-4 of it
    np.testing.assert_allclose(rig.hose_end(), [-15.0 * np.cos(angle), 0.0, -15.0 * np.sin(angle)], atol=3e-3)
    assert rig.tensions()[0] == pytest.approx(np.hypot(drag, DROGUE.mass_kg * GRAVITY), rel=1e-4)


def _energy_drift(integrator, step_s, duration_s=2.0):
    """Largest change [J] of energy without air and friction, of a hose let go 35 degrees from hanging."""
    hose = _hose(bending_damping_n_m2_s=0.0)
    drogue = load_parameters("drogue", DrogueParameters, {"hinge_damping_n_m_s": 0.0})
    rig = HoseRig(hose, drogue, np.zeros(3), None, step_s=step_s, integrator=integrator)
    rig.put(_straight(hose, (0.57, 0.1, 0.82)))
    start, worst = rig.energy_j(), 0.0
    for _ in range(round(duration_s / 0.2)):
        for _ in range(round(0.2 / step_s)):
            rig.step()
        worst = max(worst, abs(rig.energy_j() - start))
    assert np.linalg.norm(rig.hose_end() - 15.0 * np.array([-0.57, -0.1, -0.82])) > 3.0  # it has swung
    return worst


def test_energy_without_air_and_friction_drifts_by_a_sixteenth_or_less_when_the_step_halves_with_rk4():
    coarse, fine = _energy_drift("RK4", 10e-3), _energy_drift("RK4", 5e-3)
    assert 16.0 * fine < coarse < 1e-3


def test_energy_of_the_worlds_integrator_is_first_order_in_the_step():
    """implicitfast: 0.6 J of a swing of 1.4 kJ at 1 kHz, twice that at 500 Hz; it does not quarter."""
    coarse, fine = _energy_drift("implicitfast", 2e-3), _energy_drift("implicitfast", 1e-3)
    assert coarse / fine == pytest.approx(2.0, rel=0.02)
    assert fine < 1.0


def test_the_winds_power_is_what_the_energy_gains_and_on_a_chain_at_rest_it_is_odd_in_the_motion():
    """Without friction of the hose's own, over one step of 10 us."""
    hose, step_s = _hose(bending_damping_n_m2_s=0.0), 1e-5
    drogue = load_parameters("drogue", DrogueParameters, {"hinge_damping_n_m_s": 0.0})
    rig = HoseRig(hose, drogue, FAST_W, standard_atmosphere(6000.0), step_s=step_s)
    start, rates = _leaning(rig), np.random.default_rng(4).normal(0.0, 0.5, (hose.links + 1, 2))
    rig.put(start, -rates)
    opposite, _ = rig.air_powers_w()
    rig.put(start, rates)
    before, powers = rig.energy_j(), [rig.air_powers_w()]
    assert powers[0][0] == pytest.approx(-opposite, rel=1e-9)
    rig.step()
    gained = rig.energy_j() - before
    powers.append(rig.air_powers_w())
    assert gained / step_s == pytest.approx(0.5 * np.sum(powers), rel=1e-3)
    assert min(np.abs(powers[0])) > 0.01 * max(np.abs(powers[0]))


def _path(rig, ticks=1500):
    places = np.empty((ticks, 3))
    for k in range(ticks):
        rig.step()
        places[k] = rig.hose_end()
    return places


def test_hose_towed_through_air_at_rest_swings_as_one_at_rest_in_a_wind():
    hose, air = _hose(), standard_atmosphere(6000.0)
    windy, towed = HoseRig(hose, DROGUE, FAST_W, air), HoseRig(hose, DROGUE, np.zeros(3), air)
    start = _leaning(windy)
    windy.put(start)
    towed.put(start, exit_m_s=180.0)
    expected = _path(windy)
    assert np.ptp(expected[:, 1]) > 0.5
    np.testing.assert_allclose(_path(towed), expected, atol=1e-9)


@pytest.mark.parametrize("degrees", [90.0, -140.0])
def test_turning_gravity_wind_and_hose_about_the_stream_turns_the_swing(degrees):
    """Not to rounding: universal joints about y, then z, hand on another roll to the drogue. 0.2 mm in 1 m of swing."""
    hose, air = _hose(), standard_atmosphere(6000.0)
    Q = exp(np.array([np.deg2rad(degrees), 0.0, 0.0]))
    upright, turned = (HoseRig(hose, DROGUE, FAST_W, air, gravity_W=q @ [0.0, 0.0, -GRAVITY]) for q in (np.eye(3), Q))
    start = _leaning(upright)
    upright.put(start)
    turned.put(start @ Q.T)
    np.testing.assert_allclose(_path(turned) @ Q, _path(upright), atol=4e-4)


def test_each_body_meets_the_gust_of_its_own_place():
    """Gust on the rear third of the hose alone: only its links and the drogue begin to move sideways."""
    hose, air = _hose(), standard_atmosphere(6000.0)
    rig = HoseRig(hose, DROGUE, FAST_W, air)
    seen = []

    def gust(places_W):
        seen.append(places_W.copy())
        return np.where(places_W[:, :1] < -10.0, [[0.0, 5.0, 0.0]], 0.0)

    for _ in range(150):
        rig.step(gust)
    np.testing.assert_allclose(seen[0][:-1], 0.5 * (rig.rest.p_WH[:-1] + rig.rest.p_WH[1:]), atol=1e-9)
    sideways = rig.joints()[:, 1]
    assert sideways[-1] > 0.01 and abs(sideways[4]) < 0.05 * sideways[-1]
