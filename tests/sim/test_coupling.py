"""The coupling: its states, and the probe flown into it on rails."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.hose.coupling import (
    CouplingParameters,
    CouplingState,
    ProbeInCoupling,
    next_coupling_state,
    probe_in_coupling,
    stays,
)
from dockair.sim.hose.probe_push import probe_push

COUPLING = load_parameters("coupling", CouplingParameters)
SEATED = ProbeInCoupling(distance_m=0.0, angle_rad=0.05, closing_speed_m_s=1.2, pull_n=0.0)
READY, LATCHED, BARRED = CouplingState.READY, CouplingState.LATCHED, CouplingState.BARRED


@pytest.mark.parametrize(
    ("before", "probe", "after"),
    [
        (READY, SEATED, LATCHED),
        (READY, replace(SEATED, distance_m=COUPLING.capture_distance_m + 1e-6), READY),
        (READY, replace(SEATED, distance_m=COUPLING.capture_distance_m + 1e-6, closing_speed_m_s=9.0), READY),
        (READY, replace(SEATED, angle_rad=COUPLING.angle_limit_rad + 1e-6), READY),
        (READY, replace(SEATED, closing_speed_m_s=COUPLING.closing_speed_min_m_s + 1e-6), LATCHED),
        (READY, replace(SEATED, closing_speed_m_s=COUPLING.closing_speed_min_m_s - 1e-6), READY),
        (READY, replace(SEATED, closing_speed_m_s=COUPLING.closing_speed_max_m_s + 1e-6), BARRED),
        (READY, replace(SEATED, closing_speed_m_s=-2.0 * COUPLING.closing_speed_max_m_s), READY),
        (LATCHED, replace(SEATED, pull_n=COUPLING.release_force_n - 1.0), LATCHED),
        (LATCHED, replace(SEATED, pull_n=-10.0 * COUPLING.release_force_n), LATCHED),
        (LATCHED, replace(SEATED, pull_n=COUPLING.release_force_n + 1.0), BARRED),
        (BARRED, SEATED, BARRED),
        (BARRED, replace(SEATED, distance_m=COUPLING.rearm_distance_m - 1e-6), BARRED),
        (BARRED, replace(SEATED, distance_m=COUPLING.rearm_distance_m + 1e-6), READY),
    ],
)
def test_coupling_goes_from_state_to_state_as_tabled(before, probe, after):
    assert next_coupling_state(before, probe, COUPLING) is after
    assert after is before or not stays(before, probe.distance_m, probe.pull_n, COUPLING)


@pytest.mark.parametrize("beyond_m", [-1e-6, 1e-6])
@pytest.mark.parametrize("pulled_n", [-1.0, 1.0])
def test_most_ticks_are_decided_by_distance_and_pull(beyond_m, pulled_n):
    distance_m, pull_n = COUPLING.capture_distance_m + beyond_m, COUPLING.release_force_n + pulled_n
    assert stays(READY, distance_m, pull_n, COUPLING) is (beyond_m > 0.0)
    assert stays(LATCHED, distance_m, pull_n, COUPLING) is (pulled_n < 0.0)
    assert not stays(BARRED, distance_m, pull_n, COUPLING)


def _fly_in(make_world, receiver_on_rails, *, y=0.0, z=0.0, speed=1.2, pitch_rad=0.0):
    """Push the probe from 0.35 m behind the ring to 0.5 m past the coupling; stop where it latches."""
    receiver = receiver_on_rails(trim_R_WB=exp(np.array([0.0, pitch_rad, 0.0])))
    world = make_world(receiver=receiver, p_PD_B=(0.35, y, z))
    command = ReceiverCommand(velocity_m_s=np.array([speed, 0.0, 0.0]))
    touched = False
    for _ in range(round(1000 * 1.15 / speed)):
        truth = world.step(command)
        touched = touched or truth.probe_touches_drogue
        assert truth.receiver_touches == ""
        if truth.latched:
            break
    return world, truth, touched


@pytest.mark.parametrize("speed", [0.3, 1.0, 1.2, 1.5, 2.5])
def test_probe_pushed_through_the_centre_latches(make_world, receiver_on_rails, speed):
    _, truth, _ = _fly_in(make_world, receiver_on_rails, speed=speed)
    assert truth.latched


@pytest.mark.parametrize(("y", "z"), [(0.1, 0.0), (-0.15, 0.0), (0.0, 0.15), (0.0, -0.15), (0.1, 0.1)])
def test_basket_leads_a_probe_that_comes_in_beside_the_centre_to_the_coupling(make_world, receiver_on_rails, y, z):
    world, truth, touched = _fly_in(make_world, receiver_on_rails, y=y, z=z)
    assert touched and truth.latched
    for _ in range(500):
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0])))
    assert truth.latched
    np.testing.assert_allclose(truth.p_DP, [COUPLING.depth_m, 0.0, 0.0], atol=0.005)


@pytest.mark.parametrize(
    ("y", "z", "nose_down_deg", "speed"),
    [(0.0, 0.1, 6.0, 1.0), (0.1, 0.1, 6.0, 1.5), (0.1, -0.1, -6.0, 1.5), (0.2, 0.0, 0.0, 2.2), (0.0, -0.1, 0.0, 2.2)],
)
def test_a_nozzle_taken_while_it_presses_on_the_bottom_is_not_thrown_out_by_that(
    make_world, receiver_on_rails, y, z, nose_down_deg, speed
):
    """Latch and bottom then strain against each other with kilonewtons, more than the release force."""
    pitch_rad = np.deg2rad(nose_down_deg)
    world, truth, _ = _fly_in(make_world, receiver_on_rails, y=y, z=z, speed=speed, pitch_rad=pitch_rad)
    assert truth.latched
    for _ in range(60):
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([speed, 0.0, 0.0])))
        assert truth.latched


@pytest.mark.parametrize(("probe", "drogue", "ways"), [("ball", "table", 1.0), ("table", "ball", -1.0)])
def test_push_is_that_of_the_probe_on_the_drogue_whichever_of_them_mujoco_names_first(probe, drogue, ways):
    """A ball of 2 kg that cannot roll, held by a sloping table's friction and pressure; another ball is neither."""
    spec, gravity = mujoco.MjSpec(), np.array([3.0, -2.0, -9.0])
    spec.option.gravity = gravity
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=[1.0, 1.0, 0.1])
    for name, x, mass in (("ball", 0.2, 2.0), ("other", -0.2, 5.0)):
        body = spec.worldbody.add_body(name=name, pos=[x, 0.0, 0.15])
        for axis in np.eye(3):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0.0, 0.0], mass=mass)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    is_probe, is_drogue = (np.arange(model.ngeom) == model.geom(name).id for name in (probe, drogue))
    np.testing.assert_allclose(probe_push(model, data, is_probe, is_drogue), ways * 2.0 * gravity, atol=0.01)


@pytest.mark.parametrize("direction_deg", np.arange(0.0, 360.0, 45.0))
def test_basket_leads_a_fast_probe_to_the_coupling_from_any_side(make_world, receiver_on_rails, direction_deg):
    """Just under the limit of the closing speed: the blow turns the drogue, which takes it once it is in line again."""
    angle = np.radians(direction_deg)
    aside = {"y": 0.15 * float(np.cos(angle)), "z": 0.15 * float(np.sin(angle))}
    _, truth, touched = _fly_in(make_world, receiver_on_rails, speed=2.5, **aside)
    assert touched and truth.latched


@pytest.mark.parametrize(("y", "z"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3)])
def test_probe_at_the_rim_strikes_it_and_does_not_latch(make_world, receiver_on_rails, y, z):
    _, truth, touched = _fly_in(make_world, receiver_on_rails, y=y, z=z)
    assert touched and not truth.latched


def test_probe_well_outside_the_rim_touches_nothing(make_world, receiver_on_rails):
    _, truth, touched = _fly_in(make_world, receiver_on_rails, y=0.45)
    assert not touched and not truth.latched


@pytest.mark.parametrize("speed", [2.8, 3.5])
def test_probe_that_comes_in_too_fast_does_not_latch_not_even_in_the_rebound(make_world, receiver_on_rails, speed):
    _, truth, touched = _fly_in(make_world, receiver_on_rails, speed=speed)
    assert touched and not truth.latched


@pytest.mark.parametrize(("down_deg", "latches"), [(12.0, True), (20.0, False)])
def test_probe_at_an_angle_latches_only_once_the_drogue_has_turned_to_it(
    make_world, receiver_on_rails, down_deg, latches
):
    """Nose down to a drogue that points 3.5 degrees up: 12 degrees it can turn after, 20 it cannot."""
    _, truth, touched = _fly_in(make_world, receiver_on_rails, pitch_rad=np.deg2rad(down_deg))
    angle = np.arccos(truth.R_WB[:, 0] @ truth.R_WD[:, 0])
    assert touched and truth.latched is latches
    assert bool(angle <= COUPLING.angle_limit_rad + 0.01) is latches


def test_tip_never_goes_through_the_basket(make_world, receiver_on_rails):
    """Struck at the limit of speed, off centre: 2.6 mm a tick, and the tip stays inside the cone of the ribs."""
    world = make_world(p_PD_B=(0.35, 0.18, 0.0))
    drogue, tip = world.parameters.drogue, COUPLING.probe_tip_radius_m
    inside = 0
    for _ in range(250):
        p_DP = world.step(ReceiverCommand(velocity_m_s=np.array([2.6, 0.0, 0.0]))).p_DP
        along = (p_DP[0] - tip - drogue.rim_x_m) / (drogue.throat_x_m - drogue.rim_x_m)
        if 0.0 < along < 1.0:
            throat = COUPLING.socket_radius_m + drogue.rib_radius_m
            ribs = 0.5 * drogue.ring_diameter_m * (1.0 - along) + throat * along
            assert np.hypot(p_DP[1], p_DP[2]) < ribs
            inside += 1
    assert inside > 20


def test_receiver_that_backs_off_is_let_go_at_the_outer_stop_once_and_not_taken_again(make_world, receiver_on_rails):
    world, truth, _ = _fly_in(make_world, receiver_on_rails)
    speed, pulls, released_at, latched_again = 1.2, [], None, False
    for tick in range(5000):
        if tick > 800:
            speed = max(speed - 0.002, -1.0)
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([speed, 0.0, 0.0])))
        if truth.latched:
            pulls.append(truth.coupling_force_n)
            latched_again = latched_again or released_at is not None
        elif released_at is None:
            released_at = truth
    assert not latched_again
    assert released_at.coupling_force_n > COUPLING.release_force_n
    assert COUPLING.release_force_n * 0.9 < max(pulls) <= COUPLING.release_force_n
    assert abs(released_at.reel_position_m) < 0.1  # at the outer stop, not on the way
    assert truth.p_DP[0] < -0.3 and np.linalg.norm(truth.v_WD) < 1.0
    assert truth.coupling_force_n == 0.0


def test_coupling_force_is_what_the_probe_feels(make_world, receiver_on_rails):
    """Newton for the receiver: m a = own force + weight + coupling's force, along the drogue's axis."""
    receiver = receiver_on_rails()
    world = make_world(receiver=receiver, p_PD_B=(0.35, 0.0, 0.0))
    checked = 0
    for _ in range(1500):
        before = world.truth
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0])))
        if before.latched and not before.probe_touches_drogue:
            weight = receiver.mass_kg * np.array([0.0, 0.0, -9.80665])
            felt = receiver.mass_kg * truth.a_WB - receiver.force_W - weight
            assert felt @ before.R_WD[:, 0] == pytest.approx(truth.coupling_force_n, abs=1.0)
            checked += 1
    assert checked > 500


def test_closing_speed_is_the_rate_at_which_the_tip_moves_along_the_turning_drogues_axis(make_world):
    """Against a difference of the tip's place in drogue axes, for a tip off the axis and a drogue that turns."""
    h = 1e-6
    now = replace(
        make_world().truth,
        R_WD=exp(np.array([0.3, -0.2, 0.4])),
        w_WD_D=np.array([0.3, -1.5, 2.0]),
        p_WD=np.array([-15.0, 0.2, -3.0]),
        v_WD=np.array([0.2, -0.4, 0.3]),
        p_WP=np.array([-15.1, 0.35, -2.8]),
        v_WP=np.array([1.2, 0.1, -0.2]),
    )
    later = replace(
        now, R_WD=now.R_WD @ exp(h * now.w_WD_D), p_WD=now.p_WD + h * now.v_WD, p_WP=now.p_WP + h * now.v_WP
    )
    probe = probe_in_coupling(now, 0.0, COUPLING)
    assert probe.closing_speed_m_s == pytest.approx((later.p_DP[0] - now.p_DP[0]) / h, abs=1e-5)
    seat_W = now.p_WD + now.R_WD @ [COUPLING.depth_m, 0.0, 0.0]
    assert probe.distance_m == pytest.approx(np.linalg.norm(now.p_WP - seat_W))
    assert probe.angle_rad == pytest.approx(np.arccos(now.R_WD[0, 0]))  # the probe's axis is W's x


def test_axes_that_are_the_same_but_for_rounding_are_at_no_angle(make_world):
    """Of a column a little longer than 1."""
    turns = (exp(np.array([0.1 * k, 0.2, -0.3])) for k in range(1000))
    R = next(R for R in turns if R[:, 0] @ R[:, 0] > 1.0)
    assert probe_in_coupling(replace(make_world().truth, R_WB=R, R_WD=R), 0.0, COUPLING).angle_rad == 0.0
