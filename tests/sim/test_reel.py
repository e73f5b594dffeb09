"""The reel's motor, its stops, and the guide in the pod."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import Light, ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.reel import Reel, ReelParameters, guide_coefficients, guide_loads, reel_light, set_point_n
from dockair.sim.hose.rest import hinge_angles, rest_shape

REEL = load_parameters("reel", ReelParameters)
STATIC, STEP = 1900.0, 1e-3
SET_POINT = REEL.set_point_fraction * STATIC
STATIC_PULL = 0.98 * STATIC  # of a hose that leaves the pod at an angle
FREE_M = 1.0  # a place clear of the outer stop's buffer


def _reel(**sheet):
    forces = {"static_root_tension_n": STATIC, "static_pull_n": STATIC_PULL, "set_point_n": SET_POINT}
    return Reel(replace(REEL, **sheet), **forces, step_s=STEP)


def test_motor_follows_a_step_in_tension_as_a_first_order_lag():
    reel = _reel()
    start = reel.motor_force_n
    wanted = reel.set_point_n + REEL.tension_gain * (reel.set_point_n - 1000.0)
    ticks = round(REEL.response_time_s / STEP)
    for _ in range(ticks):
        reel.step(1000.0, FREE_M, 0.0)
    assert reel.motor_force_n == pytest.approx(wanted + (start - wanted) * np.exp(-1.0), rel=1e-9)


def test_hose_rests_on_its_outer_stop_at_full_trail(make_world):
    """In the whole world, to a twentieth of a millimetre; the tension's part across the pod's axis would be 0.84 mm."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), settle_s=3.0)
    assert abs(world.truth.reel_position_m) < 5e-5
    assert world.truth.root_tension_n == pytest.approx(world.rest.root_tension_n, rel=1e-3)


def _buffer_n(position_m, rate_m_s):
    """The buffer's part of Eq. (2): the reel's force less that at the same speed and tension clear of the stop."""
    return _reel().step(STATIC, position_m, rate_m_s) - _reel().step(STATIC, FREE_M, rate_m_s)


@pytest.mark.parametrize("rate_m_s", [-2.0, -0.5, 0.0, 0.5])
def test_buffer_does_not_touch_a_hose_that_has_not_come_to_it(rate_m_s):
    """Its spring ends some millimetres from full trail; before, its damper has nothing to press on."""
    end_m = _buffer_n(0.0, 0.0) / REEL.buffer_stiffness_n_m
    assert 0.001 < end_m < 0.02
    for position_m in (end_m + 1e-6, 0.03, 0.07):
        assert _buffer_n(position_m, rate_m_s) == 0.0
    assert abs(_buffer_n(end_m - 1e-6, rate_m_s)) < 1.0  # and takes hold without a jump


def test_buffer_is_spring_and_damper_where_it_is_pressed_and_never_pulls_the_hose_out():
    preload = _buffer_n(0.0, 0.0)
    assert preload == pytest.approx(STATIC_PULL - _reel().motor_force_n)
    expected = preload + REEL.buffer_stiffness_n_m * 0.05 + REEL.buffer_damping_n_s_m * 0.8
    assert _buffer_n(-0.05, -0.8) == pytest.approx(expected)
    assert _buffer_n(-0.001, 3.0) == 0.0


def test_motor_gives_no_pull_beyond_the_take_up_speed_and_brakes_beyond_the_pay_out_speed():
    reel = _reel()
    drag = REEL.drum_damping_n_s_m
    too_fast_in = REEL.take_up_speed_m_s + 0.01
    assert reel.step(0.0, FREE_M, too_fast_in) == pytest.approx(-drag * too_fast_in)
    too_fast_out = -REEL.pay_out_speed_m_s - REEL.speed_band_m_s
    force = reel.step(STATIC, FREE_M, too_fast_out)
    assert force == pytest.approx(reel.motor_force_n + REEL.brake_force_n - drag * too_fast_out)


def test_brake_pulls_with_its_whole_force_and_no_more_however_fast_the_hose_runs_out():
    reel, fast_out = _reel(), -REEL.pay_out_speed_m_s - 4.0 * REEL.speed_band_m_s
    expected = reel.motor_force_n + REEL.brake_force_n - REEL.drum_damping_n_s_m * fast_out
    assert reel.step(STATIC, FREE_M, fast_out) == pytest.approx(expected)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_motor_fades_and_brake_comes_in_over_the_speed_band_in_a_straight_line(share):
    reel, drag = _reel(), REEL.drum_damping_n_s_m
    fast_in = REEL.take_up_speed_m_s - share * REEL.speed_band_m_s
    assert reel.step(STATIC, FREE_M, fast_in) == pytest.approx(share * reel.motor_force_n - drag * fast_in)
    fast_out = -REEL.pay_out_speed_m_s - share * REEL.speed_band_m_s
    expected = reel.motor_force_n + share * REEL.brake_force_n - drag * fast_out
    assert reel.step(STATIC, FREE_M, fast_out) == pytest.approx(expected)


def test_motor_never_pushes_the_hose_out():
    reel = _reel()
    for _ in range(5000):
        assert reel.step(20.0 * STATIC, FREE_M, 0.0) >= 0.0


@pytest.mark.parametrize(("position_m", "rate_m_s"), [(0.0, 0.0), (-0.04, 0.0), (0.03, -1.5), (1.0, 5.0)])
def test_locked_drum_is_a_spring_about_where_it_stood_with_the_tension_it_had_whatever_the_speed(position_m, rate_m_s):
    """Eq. (3): no limit of speed, no buffer, no set-point."""
    reel = _reel()
    at_m, held_n = 0.2, 1500.0
    assert reel.step(held_n, at_m, 0.0, locked=True) == pytest.approx(held_n)
    stretch = REEL.lock_stiffness_n_m * (at_m - position_m)
    for _ in range(3):  # and the tension afterwards does not matter
        force = reel.step(9000.0, position_m, rate_m_s, locked=True)
    assert force == pytest.approx(held_n + stretch - REEL.lock_damping_n_s_m * rate_m_s)


def test_reel_that_comes_to_life_begins_with_the_pull_that_the_lock_held_and_goes_back_to_its_own():
    reel = _reel()
    reel.step(1500.0, FREE_M, 0.0, locked=True)
    assert reel.step(1500.0, FREE_M, 0.0) == pytest.approx(1500.0, rel=1e-2)
    for _ in range(5000):
        force = reel.step(1500.0, FREE_M, 0.0)
    assert force == pytest.approx(reel.set_point_n + REEL.tension_gain * (reel.set_point_n - 1500.0))
    assert reel.step(1700.0, 2.0, 0.0, locked=True) == pytest.approx(1700.0)  # locked anew, it holds the new place


def test_reel_that_comes_to_life_against_its_buffer_goes_on_with_the_lock_s_force_of_which_the_buffer_bears_its_part():
    """One tick moves the motor by a share of tick over response time of what it lacks."""
    reel = _reel()
    reel.step(2500.0, -0.01, 0.0, locked=True)
    assert _buffer_n(-0.01, 0.0) > 200.0
    assert reel.step(STATIC, -0.01, 0.0) == pytest.approx(2500.0, rel=1e-2)


def test_reel_that_comes_to_life_while_the_buffer_bears_more_than_the_lock_held_begins_without_a_pull():
    reel = _reel()
    reel.step(100.0, -0.01, 0.0, locked=True)
    assert _buffer_n(-0.01, 0.0) > 200.0
    assert reel.motor_force_n == 0.0


@pytest.mark.parametrize(
    ("position_m", "locked", "light"),
    [
        (0.0, False, Light.AMBER),
        (REEL.refuelling_from_m - 1e-6, False, Light.AMBER),
        (REEL.refuelling_from_m, False, Light.GREEN),
        (REEL.inner_limit_m, False, Light.GREEN),
        (REEL.inner_limit_m + 1e-6, False, Light.FLASHING_AMBER),
        (3.0, True, Light.RED),
    ],
)
def test_light_says_where_in_its_range_the_reel_is_and_whether_it_is_dead(position_m, locked, light):
    assert reel_light(position_m, locked, REEL) is light


@pytest.mark.parametrize(
    ("key", "value"), [("refuelling_from_m", REEL.inner_limit_m), ("range_m", REEL.inner_limit_m - 0.1)]
)
def test_refuelling_range_outside_the_reels_own_is_refused_with_the_keys_name(key, value):
    named = "inner_limit_m" if key == "refuelling_from_m" else key
    with pytest.raises(DockairError, match=rf"parameters\.reel\.{named}: expected"):
        _reel(**{key: value})


def test_refuelling_range_may_reach_as_far_in_as_the_reels_own():
    assert _reel(range_m=REEL.inner_limit_m).set_point_n == SET_POINT


def test_hose_taken_in_by_five_metres_runs_out_again_unaided(make_world, wind_in):
    world = make_world(p_PD_B=(60.0, 0.0, 0.0))
    wind_in(world, 5.0)
    fastest, deepest = 0.0, 0.0
    for _ in range(9000):
        truth = world.step(ReceiverCommand())
        fastest, deepest = min(fastest, truth.reel_rate_m_s), min(deepest, truth.reel_position_m)
    assert abs(truth.reel_position_m) < 0.01 and abs(truth.reel_rate_m_s) < 0.01
    assert fastest > -(REEL.pay_out_speed_m_s + REEL.speed_band_m_s)
    assert deepest > -REEL.buffer_travel_m
    assert truth.root_tension_n == pytest.approx(world.rest.root_tension_n, rel=0.01)


def test_tension_at_the_exit_stays_near_the_set_point_while_the_probe_pushes_the_drogue_in(make_world):
    """At 1.2 m/s over 3 m, from 0.3 s after contact: mean within 1 %, rms within 3 %; a joint that enters dips it."""
    world = make_world(p_PD_B=(0.1, 0.0, 0.0))
    tension, forward = [], ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0]))
    while not world.truth.latched:
        world.step(forward)
    for tick in range(2500):
        truth = world.step(forward)
        if tick >= 300:
            tension.append(truth.root_tension_n)
    relative = np.array(tension) / world._tow.reel.set_point_n - 1.0
    assert truth.reel_position_m == pytest.approx(3.0, abs=0.1)
    assert abs(relative.mean()) < 0.01 and np.sqrt(np.mean(relative**2)) < 0.03


def test_tension_at_the_exit_is_that_of_the_link_in_it_and_not_the_less_that_the_tube_leaves_to_the_links_inside(
    make_world,
):
    """Six links inside, the others at rest, the reel pulling with T cos(theta): inside no more is left than that."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0))
    p, air, inside = world.parameters, world.parameters.air, 6
    outside = replace(p.hose, length_m=(p.hose.links - inside) * p.hose.link_length_m, links=p.hose.links - inside)
    wind_W = np.array([-p.airspeed_m_s, 0.0, 0.0])
    rest = rest_shape(outside, p.drogue, wind_W, air.density_kg_m3, air.kinematic_viscosity_m2_s)

    class Holding:
        def step(self, tension_n, position_m, rate_m_s, locked):
            return rest.root_tension_n * rest.t_W[0, 0]

    world._tow.reel = Holding()
    directions = np.vstack([np.tile([1.0, 0.0, 0.0], (inside, 1)), rest.t_W, rest.t_D_W])
    world.data.qpos[world._at.hinges] = hinge_angles(directions).ravel()
    world.data.qpos[world._at.reel_qpos] = inside * p.hose.link_length_m + 1e-4
    mujoco.mj_step1(world.model, world.data)
    world._observe(0)
    for _ in range(200):  # the joint at the exit gives way a little
        truth = world.step(ReceiverCommand())
    assert truth.root_tension_n == pytest.approx(rest.root_tension_n, rel=2e-3)
    assert rest.t_W[0, 0] < 0.985


def test_links_inside_the_pod_feel_no_air(make_world, wind_in):
    """A gale that blows only within the pod changes nothing, to the bit."""

    class InThePod:
        def step(self):
            pass

        def velocity(self, x):
            return np.where(x > 0.5, 1.0, 0.0)[:, None] * [30.0, -40.0, 50.0]

        def write_gusts(self, x, rolling_x, gusts):
            gusts[:] = self.velocity(x)
            return 0.0

    places = []
    for gusts in (None, InThePod()):
        world = make_world(p_PD_B=(60.0, 0.0, 0.0), gusts=gusts)
        wind_in(world, 5.0)
        for _ in range(300):
            world.step(ReceiverCommand())
        assert (world.truth.p_WH[:, 0] > 1.0).sum() >= 3
        places.append(world.data.qpos.copy())
    np.testing.assert_array_equal(*places)


def test_dead_reel_neither_takes_up_nor_pays_out_and_the_tow_swings_on_the_hoses_stretch(make_world):
    """Struck at rest, it moves in and out at (k_l / m)^1/2 of hose and drogue; the drum stands."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), reel_locked=lambda time_s: True)
    reel_dof = world.model.joint("reel").dofadr[0]
    world.data.qvel[reel_dof] = -0.2
    mujoco.mj_step1(world.model, world.data)
    world._observe(0)
    position = np.array([world.step(ReceiverCommand()).reel_position_m for _ in range(1500)])
    assert np.abs(position).max() < 0.02 and abs(position[-1]) < 1e-3
    sheets = world.parameters
    mass = sheets.hose.line_density_kg_m * sheets.hose.length_m + sheets.drogue.mass_kg
    expected_s = 2.0 * np.pi * np.sqrt(mass / REEL.lock_stiffness_n_m)
    crossings = np.flatnonzero((position[:-1] < 0.0) & (position[1:] >= 0.0))
    assert crossings[1] - crossings[0] == pytest.approx(1e3 * expected_s, rel=0.1)


def test_a_drum_that_locks_takes_its_inertia_out_of_the_hoses_way_and_a_restored_world_does_so_too(make_world, wind_in):
    """To the bit: what the restored world does next is what the saved one did."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), reel_locked=lambda time_s: 0.02 <= time_s < 0.06)
    wind_in(world, 3.0)
    dof, seen = world.model.joint("reel").dofadr[0], []
    states = []
    for _ in range(100):
        states.append(world.save())
        world.step(ReceiverCommand())
        seen.append(float(world.model.dof_armature[dof]))
    assert seen == [REEL.drum_mass_kg] * 20 + [0.0] * 40 + [REEL.drum_mass_kg] * 40
    for at in (15, 25, 58, 65):
        world.restore(states[at])
        again = [world.step(ReceiverCommand()).reel_position_m for _ in range(10)]
        world.restore(states[at + 10])
        assert again[-1] == world.truth.reel_position_m


def test_reel_that_dies_during_the_push_holds_the_hose_where_it_was_until_it_lives_again(make_world, wind_in):
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), reel_locked=lambda time_s: 0.5 <= time_s < 2.0)
    wind_in(world, 3.0)
    position = np.array([world.step(ReceiverCommand()).reel_position_m for _ in range(2600)])
    assert np.ptp(position[600:2000]) < 0.02  # the hose runs out only before and after
    assert position[500] < 2.98 and position[-1] < position[1999] - 0.05


@pytest.mark.parametrize(
    ("airspeed_m_s", "altitude_m"), [(180.0, 6000.0), (150.0, 6000.0), (120.0, 3000.0), (100.0, 3000.0)]
)
def test_all_of_the_reels_range_runs_out_again_in_slow_flight_too(make_world, wind_in, airspeed_m_s, altitude_m):
    """A fraction of the static tension alone would keep 6.5 m of hose in at 120 m/s and below."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), airspeed_m_s=airspeed_m_s, altitude_m=altitude_m)
    wind_in(world, REEL.range_m)
    for _ in range(25000):
        truth = world.step(ReceiverCommand())
        if abs(truth.reel_position_m) < 0.01:
            break
    assert abs(truth.reel_position_m) < 0.01


def _shapes(airspeed_m_s):
    """At rest at full trail, and with the reel's range wound in; at 6000 m."""
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    wind = np.array([-airspeed_m_s, 0.0, 0.0])
    lengths = hose.length_m, hose.length_m - REEL.range_m
    return [rest_shape(replace(hose, length_m=length), drogue, wind, 0.66, 2.4e-5) for length in lengths]


def test_set_point_is_a_fraction_of_the_static_tension_where_the_hose_runs_out_of_itself():
    full, wound = _shapes(180.0)
    assert set_point_n(REEL, full, wound) == REEL.set_point_fraction * full.root_tension_n


def test_set_point_of_slow_flight_leaves_the_force_to_run_out_with_all_wound_in():
    full, wound = _shapes(100.0)
    held = set_point_n(REEL, full, wound)
    tension, cosine = wound.root_tension_n, wound.t_W[0, 0]
    pull = held + REEL.tension_gain * (held - tension)
    assert held < REEL.set_point_fraction * full.root_tension_n
    assert tension * cosine - pull == pytest.approx(REEL.run_out_force_n)


def test_set_point_of_a_hose_that_would_not_run_out_even_without_it_is_none_and_no_push():
    full, wound = _shapes(180.0)
    unreachable = replace(REEL, run_out_force_n=2.0 * (1.0 + REEL.tension_gain) * wound.root_tension_n)
    assert set_point_n(unreachable, full, wound) == 0.0


@pytest.mark.parametrize("range_m", [10.0, 11.0])
def test_reel_that_would_wind_in_all_of_the_hose_is_refused(make_world, range_m):
    with pytest.raises(DockairError, match=r"parameters\.reel\.range_m: expected less than the hose's length"):
        make_world(hose={"length_m": 10.0}, reel={"range_m": range_m})


def test_set_point_equal_to_the_static_tension_would_keep_the_hose_in(make_world, wind_in):
    """Why the set-point is below it: without the margin the same hose does not come back."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0))
    reel = world._tow.reel
    reel.set_point_n = world.rest.root_tension_n
    wind_in(world, 5.0)
    for _ in range(9000):
        truth = world.step(ReceiverCommand())
    assert truth.reel_position_m > 4.0


def test_hose_that_goes_slack_is_taken_up_no_faster_than_the_limit_and_no_farther_than_the_range(make_world):
    """A drogue pushed forward with twice its drag: the reel is left with nothing to hold."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0))
    drogue = world.model.body("drogue").id
    fastest = farthest = 0.0
    add, wrenches = np.zeros((19, 6)), world._tow.wrenches
    add[-1, 0] = 1900.0
    world._tow = _Pushed(world._tow, wrenches, add)
    assert drogue == world.model.body("hose_0").id + 18
    for _ in range(6000):
        truth = world.step(ReceiverCommand())
        fastest, farthest = max(fastest, truth.reel_rate_m_s), max(farthest, truth.reel_position_m)
    assert 1.0 < fastest < REEL.take_up_speed_m_s + REEL.speed_band_m_s
    assert REEL.range_m - 0.05 < farthest < REEL.range_m + 0.1


class _Pushed:
    """A tow with an extra load on it."""

    def __init__(self, tow, wrenches, add):
        self.reel, self.rest, self.link_at_exit = tow.reel, tow.rest, tow.link_at_exit
        self._wrenches, self._add = wrenches, add

    def wrenches(self, *arguments):
        return self._wrenches(*arguments) + self._add


@pytest.mark.slow
def test_drogue_hangs_as_from_a_shorter_hose_while_joint_after_joint_passes_the_exit(make_world):
    """Wound in by hand at 0.15 m/s over three links, against the rest shape of a hose of 100 links and that length.

    20 mm and 0.5 %: what is left of the discretisation; a joint that snapped straight would show 140 mm.
    """
    world = make_world(p_PD_B=(60.0, 0.0, 0.0))
    parameters, air = world.parameters, world.parameters.air
    wind = np.array([-parameters.airspeed_m_s, 0.0, 0.0])
    rate, worst, worst_tension = 0.15, 0.0, 0.0

    class Winch:
        def step(self, tension_n, position_m, rate_m_s, locked=False):
            wanted = rate * (world.truth.tick + 1) * 1e-3
            return tension_n + 4000.0 * (rate - rate_m_s) + 20000.0 * (wanted - position_m)

    world._tow.reel = Winch()
    for tick in range(17000):
        truth = world.step(ReceiverCommand())
        if tick > 500 and tick % 100 == 0:
            hose = replace(parameters.hose, length_m=parameters.hose.length_m - truth.reel_position_m, links=100)
            shorter = rest_shape(hose, parameters.drogue, wind, air.density_kg_m3, air.kinematic_viscosity_m2_s)
            worst = max(worst, np.linalg.norm(truth.p_WH[-1] - shorter.p_WH[-1]))
            worst_tension = max(worst_tension, abs(truth.root_tension_n / shorter.root_tension_n - 1.0))
    assert truth.reel_position_m > 2.5
    assert worst < 0.020 and worst_tension < 0.005


HOSE = load_parameters("hose", HoseParameters)
GUIDE = guide_coefficients(HOSE, REEL, STATIC)


def _guide_on_one_link(t, share):
    """(6,) what the tube does to link 0, at rest, of direction t, drawn in by a share of its length."""
    R = np.eye(3)[None].copy()
    R[0, :, 0] = t
    zero = np.zeros((1, 3))
    return guide_loads(zero, R, zero, zero, share * HOSE.link_length_m, GUIDE)[0]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
@pytest.mark.parametrize("outward", [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -0.6, -0.8)])
def test_half_drawn_in_link_turns_by_its_outer_share_of_the_hoses_angle_whichever_way_that_is(outward, share):
    """Pulled at its rear end with the static tension at a small angle to the axis; its weight is another test's."""
    angle, e = 1e-4, np.array(outward)
    t = np.array([1.0, 0.0, 0.0]) - (1.0 - share) * angle * e
    pull = STATIC * (np.array([-1.0, 0.0, 0.0]) + angle * e)
    turning = _guide_on_one_link(t, share)[3:] - _guide_on_one_link(np.array([1.0, 0.0, 0.0]), share)[3:]
    np.testing.assert_allclose(turning + np.cross(-HOSE.link_length_m * t, pull), 0.0, atol=1e-3 * STATIC * angle)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 1.0])
def test_tube_bears_the_weight_of_what_lies_in_it_where_it_lies(share):
    """Weight and tube together are the weight of the part outside, at that part's middle."""
    weight = HOSE.link_mass_kg * 9.80665
    wrench = _guide_on_one_link(np.array([1.0, 0.0, 0.0]), share)
    middle_of_outside = np.array([-0.5 * share * HOSE.link_length_m, 0.0, 0.0])
    outside = np.array([0.0, 0.0, -(1.0 - share) * weight])
    np.testing.assert_allclose(wrench[:3] + [0.0, 0.0, -weight], outside, atol=1e-12)
    np.testing.assert_allclose(wrench[3:], np.cross(middle_of_outside, outside), atol=1e-12)


def test_weight_of_a_link_that_leans_aside_in_the_tube_has_its_lever_along_the_tubes_axis():
    """About y, where a lean to the side brings no torsion spring in."""
    t, share, weight = np.array([np.cos(0.6), np.sin(0.6), 0.0]), 0.4, HOSE.link_mass_kg * 9.80665
    carried = np.cross(0.5 * (1.0 - share) * HOSE.link_length_m * t, [0.0, 0.0, share * weight])
    assert _guide_on_one_link(t, share)[4] == pytest.approx(carried[1], rel=1e-12)


def test_joint_in_the_pod_is_pressed_to_the_axis_and_its_motion_damped():
    """Two links, the first wholly inside: the joint between them, off the axis and moving outward, is pushed back."""
    length = HOSE.link_length_m
    position, R = np.array([[-0.5, 0.02, -0.03], [-1.5, 0.02, -0.03]]) * [length, 1.0, 1.0], np.array([np.eye(3)] * 2)
    v = np.array([[0.0, 0.4, -0.5], [0.0] * 3])
    wrench = guide_loads(position, R, v, np.zeros((2, 3)), 1.5 * length, GUIDE)
    stiffness = REEL.guide_stiffness_n_m2 * HOSE.link_length_m
    damping = 2.0 * REEL.guide_damping_ratio * np.sqrt(stiffness * HOSE.link_mass_kg)
    force = -0.5 * (stiffness * position[0] + damping * v[0]) * [0.0, 1.0, 1.0]  # half of link 1 is in
    carried = [0.0, 0.0, HOSE.link_mass_kg * 9.80665]
    np.testing.assert_allclose(wrench[0, :3], force + carried, rtol=1e-9)
    np.testing.assert_allclose(wrench[0, 3:], np.cross([-0.5 * length, 0.0, 0.0], force), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_turning_of_a_half_drawn_in_link_is_damped_by_the_sheets_ratio_of_a_rod_about_its_end(share):
    """c = 2 zeta sqrt(k_t I), with k_t of Eq. (4) and I = m l^2/3."""
    length, zero, w = HOSE.link_length_m, np.zeros((1, 3)), np.array([[0.3, 0.4, -0.5]])
    still, turning = (guide_loads(zero, np.eye(3)[None], zero, of, share * length, GUIDE)[0] for of in (zero, w))
    stiffness, inertia = STATIC * length * share / (1.0 - share), HOSE.link_mass_kg * length**2 / 3.0
    damping = 2.0 * REEL.guide_damping_ratio * np.sqrt(stiffness * inertia)
    np.testing.assert_allclose(turning - still, [0.0, 0.0, 0.0, 0.0, -0.4 * damping, 0.5 * damping], rtol=1e-9)


def test_turning_of_a_link_wholly_in_the_pod_is_damped_by_the_sheets_ratio_of_a_rod_that_the_tube_holds():
    """c = 2 zeta sqrt(k_t I), with k_t = k l^2 of the tube's stiffness k, where Eq. (4) is capped."""
    length, zero, w = HOSE.link_length_m, np.zeros((1, 3)), np.array([[0.3, 0.4, -0.5]])
    still, turning = (guide_loads(zero, np.eye(3)[None], zero, of, length, GUIDE)[0] for of in (zero, w))
    stiffness, inertia = REEL.guide_stiffness_n_m2 * length**3, HOSE.link_mass_kg * length**2 / 3.0
    damping = 2.0 * REEL.guide_damping_ratio * np.sqrt(stiffness * inertia)
    np.testing.assert_allclose(turning - still, [0.0, 0.0, 0.0, 0.0, -0.4 * damping, 0.5 * damping], rtol=1e-9)


def test_link_wholly_in_the_pod_is_turned_to_the_axis_as_stiffly_as_the_tube_holds_its_end():
    """At an angle a its end is l a off the axis: l (k l) a about its joint, k l the tube's stiffness."""
    angle, length = 1e-4, HOSE.link_length_m
    moment = _guide_on_one_link(np.array([1.0, 0.0, -angle]), 1.0)[4]
    assert moment == pytest.approx(-REEL.guide_stiffness_n_m2 * length**3 * angle, rel=1e-9)


def test_link_is_turned_no_more_stiffly_than_by_the_tube_however_little_of_it_is_still_outside():
    """Eq. (4) alone would make it infinitely stiff just before its rear joint passes the exit."""
    angle, share = 1e-4, 1.0 - 1e-9
    moment = _guide_on_one_link(np.array([1.0, 0.0, -angle]), share)[4]
    stiffest = REEL.guide_stiffness_n_m2 * HOSE.link_length_m**3
    assert STATIC * HOSE.link_length_m * share / (1.0 - share) > 1e3 * stiffest
    assert moment == pytest.approx(-stiffest * angle, rel=1e-6)


def test_link_that_turns_about_its_rear_joint_leaves_the_tube_there_alone():
    length = HOSE.link_length_m
    arm, w = np.array([-0.5 * length, 0.0, 0.0]), np.array([0.0, 0.4, -0.5])
    v = np.array([-np.cross(w, arm), np.zeros(3)])
    wrench = guide_loads(
        np.zeros((2, 3)), np.array([np.eye(3)] * 2), v, np.array([w, np.zeros(3)]), 1.5 * length, GUIDE
    )
    np.testing.assert_allclose(wrench[0, :3], [0.0, 0.0, HOSE.link_mass_kg * 9.80665], rtol=1e-12, atol=1e-12)


def test_link_that_leans_with_its_rear_joint_on_the_axis_is_not_pressed_to_it():
    """Two links, the first wholly inside: its middle is off the axis, which is the torsion spring's matter."""
    length, R, zero = HOSE.link_length_m, np.array([np.eye(3)] * 2), np.zeros((2, 3))
    R[0, :, 0] = [0.8, 0.36, -0.48]
    position = np.array([0.5 * length * R[0, :, 0], np.zeros(3)])
    wrench = guide_loads(position, R, zero, zero, 1.5 * length, GUIDE)
    np.testing.assert_allclose(wrench[0, :3], [0.0, 0.0, HOSE.link_mass_kg * 9.80665], rtol=1e-12, atol=1e-9)
