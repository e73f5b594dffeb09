"""The tow: loads of air, pod and reel put together."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters, velocities_at
from dockair.sim.hose.loads import load_coefficients, tow_loads
from dockair.sim.hose.reel import ReelParameters, guide_loads
from dockair.sim.hose.rest import rest_shape
from dockair.sim.hose.tow import PodMotion, Tow

HOSE = load_parameters("hose", HoseParameters)
DROGUE = load_parameters("drogue", DrogueParameters)
WIND_W = np.array([-180.0, 0.0, 0.0])


def make(wind_W=WIND_W):
    reel = load_parameters("reel", ReelParameters)
    return Tow(HOSE, DROGUE, reel, standard_atmosphere(6000.0), np.asarray(wind_W), 1e-3)


def at_rest(tow):
    """Middles, axes and velocities (none) of the bodies in their rest shape."""
    t = np.vstack([tow.rest.t_W, tow.rest.t_D_W])
    R = np.zeros((len(t), 3, 3))
    R[:, :, 0] = t
    joints = tow.rest.p_WH
    end = joints[-1] + (DROGUE.centre_of_mass_x_m - DROGUE.hose_joint_x_m) * t[-1]
    return np.vstack([0.5 * (joints[:-1] + joints[1:]), end]), R, np.zeros((len(t), 6)), np.zeros(3)


def test_at_rest_loads_and_weight_are_carried_by_the_root():
    tow = make()
    wrench = tow.wrenches(*at_rest(tow), np.zeros((HOSE.links + 1, 3)), 0.0)
    weight = (HOSE.links * HOSE.link_mass_kg + DROGUE.mass_kg) * 9.80665
    carried = wrench[:, :3].sum(axis=0) - [0.0, 0.0, weight]
    np.testing.assert_allclose(carried, -tow.rest.root_tension_n * tow.rest.t_W[0], rtol=0.02, atol=10.0)
    assert np.linalg.norm(carried) == pytest.approx(tow.rest.root_tension_n, rel=1e-6)


def test_set_point_leaves_the_force_to_run_out_to_a_hose_of_which_all_of_the_reels_range_is_wound_in():
    """In slow flight, at rest: T cos(theta) less the motor's pull T_s + k (T_s - T), on a hose so much shorter."""
    slow_W, reel, air = np.array([-100.0, 0.0, 0.0]), load_parameters("reel", ReelParameters), standard_atmosphere(6e3)
    shorter = replace(HOSE, length_m=HOSE.length_m - reel.range_m)
    rest = rest_shape(shorter, DROGUE, slow_W, air.density_kg_m3, air.kinematic_viscosity_m2_s)
    tension_n, held_n = rest.root_tension_n, make(slow_W).reel.set_point_n
    motor_n = held_n + reel.tension_gain * (held_n - tension_n)
    assert tension_n * rest.t_W[0, 0] - motor_n == pytest.approx(reel.run_out_force_n, rel=1e-9)


def test_reel_at_full_trail_pulls_with_what_of_the_tension_at_rest_lies_along_the_pods_axis():
    """The motor's pull and the buffer's push, nothing moving: so the hose rests on its stop."""
    tow = make()
    pull_n = tow.reel.step(tow.rest.root_tension_n, 0.0, 0.0)
    assert pull_n == pytest.approx(tow.rest.root_tension_n * tow.rest.t_W[0, 0], rel=1e-12)


def test_tube_turns_a_half_drawn_in_link_under_the_tension_that_the_exit_bears_at_rest():
    """Eq. (4) of the reel: T l t_z about y, besides the weight that the tube carries; a link turned to the side."""
    tow, air, length = make(), standard_atmosphere(6000.0), HOSE.link_length_m
    place, R, spatial, reference = at_rest(tow)
    R[0, :, 0] = [0.0, 0.8, 0.6]
    of_air = load_coefficients(HOSE, DROGUE, air.density_kg_m3, air.kinematic_viscosity_m2_s)
    still = np.zeros((HOSE.links + 1, 3))
    blown = tow_loads(R, still, still, still + WIND_W, 0.5 * length, of_air)
    tube = tow.wrenches(place, R, spatial, reference, still, 0.5 * length)[0] - blown[0]
    assert tube[4] == pytest.approx(tow.rest.root_tension_n * length * 0.6, rel=1e-9)


def test_gust_counts_as_wind_on_every_body_and_only_there():
    tow, gust = make(), np.array([3.0, -2.0, 1.0])
    bodies, gusts = at_rest(tow), np.zeros((HOSE.links + 1, 3))
    still = tow.wrenches(*bodies, gusts, 0.0)
    whole = tow.wrenches(*bodies, gusts + gust, 0.0)
    np.testing.assert_allclose(whole, make(WIND_W + gust).wrenches(*bodies, gusts, 0.0), rtol=1e-12, atol=1e-9)
    gusts[4] = gust
    one = tow.wrenches(*bodies, gusts, 0.0)
    np.testing.assert_array_equal(one[4], whole[4])
    np.testing.assert_array_equal(np.delete(one, 4, axis=0), np.delete(still, 4, axis=0))


def test_link_at_the_exit_is_the_one_that_the_wound_in_length_reaches():
    tow, length = make(), HOSE.link_length_m
    cases = ((-0.1, 0), (0.0, 0), (0.99 * length, 0), (1.01 * length, 1), (3.5 * length, 3), (1e3, HOSE.links - 1))
    for wound_in_m, link in cases:
        assert tow.link_at_exit(wound_in_m) == link


def _wound_in(seed):
    """A crooked tow in motion, 3 m of it in the pod."""
    rng = np.random.default_rng(seed)
    n = HOSE.links + 1
    place = np.column_stack([-np.arange(n) * HOSE.link_length_m + 3.0, *(0.02 * rng.normal(size=(2, n)))])
    R = np.array([exp(0.05 * rng.normal(size=3)) for _ in range(n)])
    return place, R, 0.3 * rng.normal(size=(n, 6)), np.zeros(3)


def _rates(place, spatial, reference):
    return velocities_at(place, spatial, reference), np.ascontiguousarray(spatial[:, :3])


def test_pod_turned_displaced_and_moving_with_the_whole_scene_guides_the_hose_as_one_at_rest():
    """The same places, rates and pod, seen from another frame: the tube's forces turn with it."""
    place, R, spatial, reference = _wound_in(3)
    tow = make()
    Q, shift, v, w = exp(np.array([0.4, -0.2, 1.1])), np.array([300.0, -40.0, 7.0]), np.array([5.0, -3.0, 2.0]), 0.1
    w_W = w * Q[:, 2]
    moved = place @ Q.T + shift
    v_at_reference = v + np.cross(w_W, -shift)  # of the tanker's material at the origin of W
    turned = np.hstack([spatial[:, :3] @ Q.T + w_W, spatial[:, 3:] @ Q.T + v_at_reference])
    turned[:, 3:] -= np.cross(spatial[:, :3] @ Q.T, shift)
    pod = PodMotion(R_WT=Q, p_WO=shift, v_WO=v, w_WT=w_W)
    expected = guide_loads(place, R, *_rates(place, spatial, reference), 3.0, tow._guide)
    got = tow._guided(moved, Q @ R, *_rates(moved, turned, np.zeros(3)), 3.0, pod)
    np.testing.assert_allclose(got, np.hstack([expected[:, :3] @ Q.T, expected[:, 3:] @ Q.T]), rtol=1e-7, atol=1e-5)


def test_pod_that_rests_in_the_origin_loads_the_tow_alike_whether_it_is_told_of_or_not():
    """Air and tube together; part of the hose is inside."""
    tow, gusts, still = make(), np.zeros((HOSE.links + 1, 3)), np.zeros(3)
    bodies = _wound_in(4)
    told = tow.wrenches(*bodies, gusts, 3.0, PodMotion(R_WT=np.eye(3), p_WO=still, v_WO=still, w_WT=still))
    np.testing.assert_allclose(told, tow.wrenches(*bodies, gusts, 3.0), rtol=1e-12, atol=1e-9)
