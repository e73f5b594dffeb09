"""Hose and drogue behind a tanker that moves in W: equivalence, Galilei, and rest in a turn."""

import mujoco
import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.aircraft.tanker_motion import STATE, A, P, R, V
from dockair.sim.hose.loads import drogue_force, hose_load_per_length, load_coefficients

FAR = (60.0, 0.0, 0.0)
G = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])
BANK = np.radians(25.0)


class Path:
    """Uniform acceleration from a velocity, without turning."""

    is_straight = False

    def __init__(self, velocity=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, 0.0), start=(7.0, 12.0, 2.2)):
        self.velocity, self.acceleration, self.start = (np.array(x) for x in (velocity, acceleration, start))

    def vector(self, time_s):
        x = np.zeros(STATE)
        x[P] = self.start + self.velocity * time_s + 0.5 * self.acceleration * time_s**2
        x[V], x[A], x[R] = self.velocity + self.acceleration * time_s, self.acceleration, np.eye(3).ravel()
        return x


class Wind:
    """The same gust everywhere, growing evenly in time."""

    def __init__(self, velocity=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, 0.0), step_s=1e-3):
        self.now, self.change = np.array(velocity, dtype=float), step_s * np.array(acceleration)

    def step(self):
        self.now = self.now + self.change

    def velocity(self, x):
        return np.tile(self.now, (len(x), 1))

    def write_gusts(self, x, rolling_x, gusts):
        gusts[:] = self.velocity(x)
        return 0.0


def _flown(world, ticks):
    return [world.step(ReceiverCommand()) for _ in range(ticks)][-1]


def _tow_from_exit(world, truth):
    """Joints of the hose and ring centre from the exit, in the tanker's axes."""
    points = np.vstack([truth.p_WH, truth.p_WD]) - truth.p_WT
    return points @ truth.R_WT - world.parameters.tanker.exit_m


def _start_of(make_world):
    return -np.asarray(make_world().parameters.tanker.exit_m)


def test_tanker_is_where_its_path_has_it_and_so_are_its_velocities(make_world):
    racetrack = TankerPathParameters(
        manoeuvre="racetrack", starts_s=0.1, bank_rad=BANK, roll_rate_rad_s=np.radians(30.0)
    )
    world = make_world(p_PD_B=FAR, tanker_path=racetrack)
    truth = _flown(world, 800)
    state = TankerPath(racetrack, 180.0, _start_of(make_world)).at(0.8)
    body = world.data.body("tanker")
    np.testing.assert_allclose(truth.p_WT, state.p_WT, atol=1e-12)
    np.testing.assert_allclose(body.xpos, state.p_WT, atol=1e-12)
    np.testing.assert_allclose(body.xmat.reshape(3, 3), state.R_WT, atol=1e-12)
    np.testing.assert_allclose(truth.v_WT, state.v_WT_W, atol=1e-12)
    np.testing.assert_allclose(truth.w_WT_T, state.w_WT_T, atol=1e-12)
    exit_W = truth.p_WT + truth.R_WT @ world.parameters.tanker.exit_m
    along = truth.reel_position_m * truth.R_WT[:, 0]
    np.testing.assert_allclose(truth.p_WH[0], exit_W + along, atol=1e-9)  # the hose begins where its reel is
    path, dof = TankerPath(racetrack, 180.0, _start_of(make_world)), world.model.joint("tanker").dofadr[0]
    change = (path.at(0.8).w_WT_T - path.at(0.799).w_WT_T) / 1e-3
    assert np.linalg.norm(change) > 0.1
    np.testing.assert_allclose(world.data.qacc[dof + 3 : dof + 6], change, atol=1e-6)


def test_hose_pulls_nothing_out_of_the_prescribed_tanker(make_world):
    """What MuJoCo solves for as its acceleration is the path's, however the hose pulls: 2 kN on 1e10 kg."""
    world = make_world(p_PD_B=FAR, tanker_path=Path(acceleration=(0.5, -1.0, 2.0), start=_start_of(make_world)))
    _flown(world, 50)
    dof = world.model.joint("tanker").dofadr[0]
    np.testing.assert_allclose(world.data.qacc[dof : dof + 3], [0.5, -1.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(world.data.qacc[dof + 3 : dof + 6], 0.0, atol=1e-7)


@pytest.mark.parametrize("drawn_in_m", [0.0, 1.3])
def test_tanker_and_air_moving_evenly_together_change_nothing(make_world, drawn_in_m):
    """Galilei: over a swing of a second the tow is the same, seen from the exit, but for rounding.

    At full trail, and while a hose that was wound in runs out again through the tube in the pod.
    """
    u, start = np.array([-30.0, 55.0, 8.0]), _start_of(make_world)
    worlds = (
        make_world(p_PD_B=FAR, gusts=Wind(), tanker_path=Path(start=start)),
        make_world(p_PD_B=FAR, gusts=Wind(u), tanker_path=Path(u, start=start)),
    )
    for world in worlds:
        world.data.qvel[world.model.joint("hose_3_z").dofadr[0]] = 0.3
        world.data.qpos[world.model.joint("reel").qposadr[0]] = drawn_in_m
        world.data.qpos[world._at.hinges.start : world._at.hinges.start + (4 if drawn_in_m else 0)] = 0.0
        mujoco.mj_step1(world.model, world.data)
        world._observe(0)
    for _ in range(4):
        a, b = (_flown(world, 250) for world in worlds)
        np.testing.assert_allclose(_tow_from_exit(worlds[1], b), _tow_from_exit(worlds[0], a), atol=1e-9)
        np.testing.assert_allclose(b.v_WD - u, a.v_WD, atol=1e-9)
        assert b.root_tension_n == pytest.approx(a.root_tension_n, rel=1e-9)
    assert np.linalg.norm(a.v_WD) > 0.05


def test_tanker_accelerating_with_its_air_is_another_gravity(make_world):
    """Equivalence: with the air taken along, an acceleration a is gravity g - a; neither shape nor tension can tell."""
    a, start = np.array([1.5, -3.0, 2.0]), _start_of(make_world)
    moving = make_world(p_PD_B=FAR, gusts=Wind(acceleration=a), tanker_path=Path(acceleration=a, start=start))
    still = make_world(p_PD_B=FAR, gusts=Wind())
    still.model.opt.gravity[:] = G - a
    mujoco.mj_step1(still.model, still.data)
    for _ in range(4):
        truth, other = _flown(moving, 250), _flown(still, 250)
        np.testing.assert_allclose(_tow_from_exit(moving, truth), _tow_from_exit(still, other), atol=1e-9)
        np.testing.assert_allclose(truth.v_WD - truth.v_WT, other.v_WD, atol=1e-9)
        assert truth.root_tension_n == pytest.approx(other.root_tension_n, rel=1e-9)
    assert np.linalg.norm(truth.p_WD - truth.p_WT - (moving.rest.p_WH[-1] - start)) > 0.2  # it did swing


def _rest_in_a_turn(world, turn_rad_s, centre_T):
    """Joints from the exit and root tension of the tow at rest in axes that turn with the tanker; both in level axes.

    Each link is in balance about its front joint under the centrifugal field and the stream of its own place; the
    drogue about the hose's end, its moment against turning left out.
    """
    p = world.parameters
    hose, drogue = p.hose, p.drogue
    k = load_coefficients(hose, drogue, p.air.density_kg_m3, p.air.kinematic_viscosity_m2_s)
    w = np.array([0.0, 0.0, turn_rad_s])

    def field(place):
        from_axis = (place - centre_T) * [1.0, 1.0, 0.0]
        return G + turn_rad_s**2 * from_axis, -np.cross(w, from_axis)

    def unit(v):
        return v / np.linalg.norm(v)

    t, t_D = np.tile([1.0, 0.0, 0.0], (hose.links, 1)), np.array([1.0, 0.0, 0.0])
    for _ in range(60):
        joints = np.vstack([np.zeros(3), np.cumsum(-hose.link_length_m * t, axis=0)])
        gravity, _ = field(joints[-1] - (drogue.hose_joint_x_m - drogue.centre_of_mass_x_m) * t_D)
        _, stream = field(joints[-1] - (drogue.hose_joint_x_m - drogue.drag_centre_x_m) * t_D)
        weight, force = drogue.mass_kg * gravity, drogue_force(t_D, stream, k)
        mass_arm = drogue.hose_joint_x_m - drogue.centre_of_mass_x_m
        t_D = unit(-(mass_arm * weight + (drogue.hose_joint_x_m - drogue.drag_centre_x_m) * force))
        pull = force + weight
        for i in reversed(range(hose.links)):
            gravity, stream = field(0.5 * (joints[i] + joints[i + 1]))
            load = hose.link_mass_kg * gravity + hose.link_length_m * hose_load_per_length(t[i], stream, k)
            t[i] = unit(-(pull + 0.5 * load))
            pull = pull + load
    joints = np.vstack([np.zeros(3), np.cumsum(-hose.link_length_m * t, axis=0)])
    return joints, float(np.linalg.norm(pull))


@pytest.mark.slow
def test_hose_in_a_steady_turn_rests_where_the_turning_axes_say(make_world):
    """Every joint within 5 mm, the root tension within 0.05 per cent, of the mean over the last of its swing.

    Rolled in within 3 s, then flown for 22 s; a Hann window over the last 10 s leaves 1e-3 of a swing at 0.33 Hz.
    """
    racetrack = TankerPathParameters(manoeuvre="racetrack", bank_rad=BANK, roll_rate_rad_s=np.radians(17.0))
    soft = {"guide_stiffness_n_m2": 24000.0}  # bears 500 Hz; no hose comes in
    world = make_world(
        p_PD_B=FAR, tanker_path=racetrack, rate_hz=500, hose={"bending_damping_n_m2_s": 100.0}, reel=soft
    )
    exit_T, turn = world.parameters.tanker.exit_m, STANDARD_GRAVITY_M_S2 * np.tan(BANK) / 180.0
    _flown(world, 7500)
    ours, tensions, weights = [], [], np.hanning(5000)
    for _ in weights:
        truth = world.step(ReceiverCommand())
        ours.append((truth.p_WH - truth.p_WT) @ truth.R_WT - exit_T)
        tensions.append(truth.root_tension_n)
    level_from_T = exp(np.array([-BANK, 0.0, 0.0]))  # left wing down
    joints_T, tension = np.average(ours, axis=0, weights=weights), np.average(tensions, weights=weights)
    joints, expected = _rest_in_a_turn(world, turn, np.array([0.0, 180.0 / turn, 0.0]) - level_from_T @ exit_T)
    np.testing.assert_allclose(joints_T @ level_from_T.T, joints, atol=5e-3)
    assert tension == pytest.approx(expected, rel=5e-4)
    assert joints_T[-1, 2] == pytest.approx(world.rest.p_WH[-1, 2], abs=0.2)  # banked with the tanker, near enough
    assert tension > world.rest.root_tension_n + 10.0
