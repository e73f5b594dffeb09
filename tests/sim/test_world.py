"""The world as a whole: truth, determinism, energy, frames."""

from dataclasses import fields
from hashlib import sha256

import mujoco
import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters
from dockair.sim.aircraft.tanker import TankerPathParameters
from dockair.sim.truth import Truth
from dockair.streams import random_stream

FORWARD = ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0]))
FAR = (60.0, 0.0, 0.0)


class UniformGust:
    """The same wind everywhere and always."""

    def __init__(self, gust_W):
        self.gust_W = np.asarray(gust_W, dtype=float)

    def step(self):
        pass

    def velocity(self, x):
        return np.tile(self.gust_W, (len(x), 1))

    def write_gusts(self, x, rolling_x, gusts):
        gusts[:] = self.velocity(x)
        return 0.0


def _gusts(seed, sigma_m_s=1.1, rate_hz=1000):
    parameters = load_parameters("turbulence", TurbulenceParameters, {"sigma_m_s": sigma_m_s})
    return DrydenField(parameters, 180.0, 1.0 / rate_hz, random_stream(seed, "gust"))


def _swing(world, rate_rad_s):
    """Give the hose's hinges 3 a rate of turn."""
    for letter in "yz":
        world.data.qvel[world.model.joint(f"hose_3_{letter}").dofadr[0]] = rate_rad_s
    mujoco.mj_step1(world.model, world.data)
    world._observe(0)


def _digest(world):
    return sha256(world.data.qpos.tobytes() + world.data.qvel.tobytes()).hexdigest()


def test_world_begins_in_its_rest_shape_and_stays_there_in_still_air(make_world):
    world = make_world(p_PD_B=FAR)
    start = world.truth
    for _ in range(2000):
        truth = world.step(ReceiverCommand())
    assert np.linalg.norm(truth.p_WD - start.p_WD) < 2e-3
    assert truth.root_tension_n == pytest.approx(world.rest.root_tension_n, rel=1e-3)
    assert truth.drogue_tension_n == pytest.approx(world.rest.drogue_tension_n, rel=1e-3)
    np.testing.assert_allclose(truth.p_WH, world.rest.p_WH, atol=3e-3)


def test_receiver_starts_where_it_was_asked_to_from_the_mean_drogue(make_world):
    """In still air the mean is the drogue's place; in gusts it is the mean over the second half of the settling."""
    truth = make_world(p_PD_B=(4.0, 0.3, -0.2), settle_s=0.5).truth
    np.testing.assert_allclose(truth.p_PD_B, [4.0, 0.3, -0.2], atol=1e-3)
    assert truth.tick == 0 and truth.time_s == 0.0

    places, world = [], make_world(p_PD_B=(4.0, 0.0, 0.0), settle_s=0.0, gusts=_gusts(1))
    for _ in range(400):
        places.append(world.step(ReceiverCommand()).p_WD)
    settled = make_world(p_PD_B=(4.0, 0.0, 0.0), settle_s=0.4, gusts=_gusts(1)).truth
    # the receiver's own 0.4 s in the gusts differ from its waiting, but the hose does not know of either
    mean = np.mean(places[200:], axis=0)
    np.testing.assert_allclose(settled.p_WP + [4.0, 0.0, 0.0], mean, atol=1e-9)
    np.testing.assert_array_equal(settled.v_WB, 0.0)


def test_the_engines_clock_is_the_flights_whatever_went_before(make_world):
    """The camera's clouds pass by that clock; the settling is no part of the flight."""
    world = make_world(p_PD_B=FAR, settle_s=0.05)
    state = world.save()
    for _ in range(2):
        assert world.data.time == world.truth.time_s == 0.0
        for _ in range(20):
            truth = world.step(ReceiverCommand())
        assert world.data.time == pytest.approx(truth.time_s, abs=1e-12) and truth.time_s == 0.02
        world.restore(state)


def test_every_velocity_of_the_truth_is_the_rate_of_its_place(make_world):
    """A difference over two ticks is the mean of the rates at the ends of its halves, to order (jerk dt^2)."""
    world = make_world(gusts=_gusts(3))
    _swing(world, 0.1)
    history = [world.step(FORWARD) for _ in range(400)]
    a, b, c = history[-3:]
    for place, rate in (("p_WB", "v_WB"), ("p_WP", "v_WP"), ("p_WD", "v_WD")):
        difference = (getattr(c, place) - getattr(a, place)) * 500.0
        np.testing.assert_allclose(0.5 * (getattr(b, rate) + getattr(c, rate)), difference, atol=5e-4, err_msg=rate)
    turn = b.R_WD.T @ (c.R_WD - a.R_WD) * 500.0
    np.testing.assert_allclose(0.5 * (b.w_WD_D + c.w_WD_D), [turn[2, 1], turn[0, 2], turn[1, 0]], atol=5e-4)
    np.testing.assert_allclose(b.a_WB, (b.v_WB - a.v_WB) * 1000.0, atol=1e-6)
    assert c.reel_rate_m_s == pytest.approx((c.reel_position_m - b.reel_position_m) * 1000.0, abs=1e-6)


def test_truth_is_complete_finite_and_a_copy(make_world):
    world = make_world(gusts=_gusts(4))
    truth = world.step(FORWARD)
    before = {f.name: np.copy(getattr(truth, f.name)) for f in fields(Truth)}
    for _ in range(50):
        world.step(FORWARD)
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(truth, name), value, err_msg=name)
        if value.dtype.kind == "f":
            assert np.all(np.isfinite(value)), name
    assert truth.p_WH.shape == (world.parameters.hose.links + 1, 3)
    hose_end = truth.p_WD + truth.R_WD @ [world.parameters.drogue.hose_joint_x_m, 0.0, 0.0]
    np.testing.assert_allclose(truth.p_WH[-1], hose_end, atol=1e-12)


def test_receiver_without_forces_falls_freely_and_its_accelerometer_reads_nothing(make_world, receiver_on_rails):
    class Falling(receiver_on_rails):
        def step(self, **state):
            self.specific_force_B = state["specific_force_B"]
            return np.zeros(3), np.zeros(3)

    receiver = Falling()
    world = make_world(receiver=receiver, p_PD_B=FAR)
    start = world.truth.p_WB
    for _ in range(1000):
        truth = world.step(ReceiverCommand())
    np.testing.assert_allclose(truth.a_WB, [0.0, 0.0, -9.80665], atol=1e-12)
    np.testing.assert_allclose(receiver.specific_force_B, 0.0, atol=1e-12)
    # implicit Euler falls g dt t / 2 farther than g t^2 / 2
    assert truth.p_WB[2] - start[2] == pytest.approx(-0.5 * 9.80665 * (1.0 + 1e-3), rel=1e-6)


def test_receiver_is_told_the_air_with_its_gust_and_its_specific_force_at_trim(make_world, receiver_on_rails):
    receiver = receiver_on_rails()
    world = make_world(receiver=receiver, gusts=UniformGust([2.0, -1.0, 0.5]))
    world.step(ReceiverCommand())
    np.testing.assert_allclose(receiver.air_velocity_W, [-178.0, -1.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(receiver.specific_force_B, [0.0, 0.0, 9.80665], atol=1e-12)
    np.testing.assert_allclose(world.truth.gust_D_m_s, [2.0, -1.0, 0.5], atol=1e-12)


def test_truth_says_of_airspeed_flow_angles_and_throttle_what_the_receiver_says(make_world, receiver_on_rails):
    said = {"airspeed_m_s": 171.0, "angle_of_attack_rad": 0.1, "sideslip_rad": -0.02, "throttle": 0.7}
    world = make_world(receiver=receiver_on_rails(**said), p_PD_B=FAR)
    for truth in (world.truth, world.step(ReceiverCommand())):
        assert {name: getattr(truth, name) for name in said} == said


def test_each_body_is_told_the_gust_of_its_own_place(make_world, receiver_on_rails):
    class Shear:
        def step(self):
            pass

        def velocity(self, x):
            return np.column_stack([0.01 * x, np.zeros((len(x), 2))])

        def write_gusts(self, x, rolling_x, gusts):
            gusts[:] = self.velocity(x)
            return 0.0

    receiver = receiver_on_rails()
    world = make_world(receiver=receiver, gusts=Shear())
    before = world.truth
    drogue_x = (before.p_WD + before.R_WD @ [world.parameters.drogue.drag_centre_x_m, 0.0, 0.0])[0]  # its canopy's
    np.testing.assert_allclose(before.gust_B_m_s, [0.01 * before.p_WB[0], 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(before.gust_D_m_s, [0.01 * drogue_x, 0.0, 0.0], atol=1e-12)
    world.step(ReceiverCommand())
    assert receiver.air_velocity_W[0] == pytest.approx(-180.0 + 0.01 * before.p_WB[0], abs=1e-9)


def test_air_acts_on_the_links_in_their_middles_and_on_the_drogue_at_its_canopy(make_world):
    """In a swing, so that no component is 0; these are the places whose air is asked for."""
    world = make_world(p_PD_B=FAR)
    _swing(world, 0.3)
    for _ in range(150):
        truth = world.step(ReceiverCommand())
    places = truth._seen.hose[1]
    assert np.abs(truth.R_WD[1:, 0]).min() > 1e-3
    np.testing.assert_allclose(places[:-1], 0.5 * (truth.p_WH[:-1] + truth.p_WH[1:]), atol=1e-12)
    canopy_D = [world.parameters.drogue.drag_centre_x_m, 0.0, 0.0]
    np.testing.assert_allclose(places[-1], truth.p_WD + truth.R_WD @ canopy_D, atol=1e-12)


def test_turning_receiver_moves_its_probe_and_feels_its_weight_in_its_own_axes(make_world, receiver_on_rails):
    class Turning(receiver_on_rails):
        """Held up in W, and turned."""

        def step(self, **state):
            self.R_WB, self.specific_force_B = state["R_WB"], state["specific_force_B"]
            return self.mass_kg * np.array([0.0, 0.0, 9.80665]), np.array([2e4, -5e4, 8e4])

    receiver = Turning(trim_R_WB=exp(np.array([0.4, -0.2, 0.3])))
    world = make_world(receiver=receiver, p_PD_B=FAR)
    a, b, c = [world.step(ReceiverCommand()) for _ in range(500)][-3:]
    assert np.linalg.norm(b.v_WP) > 1.0
    np.testing.assert_allclose(0.5 * (b.v_WP + c.v_WP), (c.p_WP - a.p_WP) * 500.0, atol=5e-3)
    turn = b.R_WB.T @ (c.R_WB - a.R_WB) * 500.0
    np.testing.assert_allclose(0.5 * (b.w_WB_B + c.w_WB_B), [turn[2, 1], turn[0, 2], turn[1, 0]], atol=2e-3)
    assert np.abs(b.alpha_WB_B).min() > 0.1
    np.testing.assert_allclose(b.alpha_WB_B, (b.w_WB_B - a.w_WB_B) * 1000.0, atol=5e-3)
    np.testing.assert_allclose(receiver.specific_force_B, receiver.R_WB.T @ [0.0, 0.0, 9.80665], atol=0.01)


def test_uniform_gust_along_the_wind_is_another_airspeed(make_world):
    """170 m/s into a headwind of 10 m/s is 180 m/s: the hose swings the same. The reel's set-point is made equal."""
    fast = make_world(p_PD_B=FAR)
    slow = make_world(p_PD_B=FAR, airspeed_m_s=170.0, gusts=UniformGust([-10.0, 0.0, 0.0]))
    slow._tow.reel = fast.save().parts[0]
    slow.data.qpos[:] = fast.data.qpos
    for world in (fast, slow):
        _swing(world, 0.4)
    for _ in range(1500):
        a, b = fast.step(ReceiverCommand()), slow.step(ReceiverCommand())
    assert np.linalg.norm(a.v_WD) > 0.3  # it does swing
    np.testing.assert_allclose(b.p_WD, a.p_WD, atol=1e-4)  # the guide's stiffness alone knows the nominal airspeed
    np.testing.assert_allclose(b.v_WD, a.v_WD, atol=1e-3)


def test_hanging_hose_in_still_air_only_loses_energy(make_world):
    """Without wind the tow hangs and swings; kinetic, potential and bending energy less the reel's work must fall.

    The reel is clamped by a damped spring: it pulls along the pod, which a hose that hangs down does not.
    """

    class Clamp:
        def step(self, tension_n, position_m, rate_m_s, locked):
            return -1e5 * position_m - 1e3 * rate_m_s

    world = make_world(airspeed_m_s=1e-9, p_PD_B=FAR)
    world._tow.reel = Clamp()
    _swing(world, 0.15)
    model, data = world.model, world.data
    reel, work, energies, potential = model.joint("reel"), 0.0, [], []
    for _ in range(4000):
        world.step(ReceiverCommand())
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        work += float(data.qfrc_applied[reel.dofadr[0]] * data.qvel[reel.dofadr[0]]) * model.opt.timestep
        energies.append(data.energy.sum() - work)
        potential.append(data.energy[0])
    energies = np.array(energies)
    swing = np.ptp(potential[:1500])
    assert swing > 5.0
    assert energies[-1] < energies[0] - 0.02 * swing
    # the steps are first order: allow what a thousandth of the swing would be
    assert np.diff(energies[::10]).max() < 1e-3 * swing


def test_same_seed_same_bits(make_world):
    digests = []
    for seed in (5, 5, 6):
        world = make_world(gusts=_gusts(seed), settle_s=0.2)
        for _ in range(2000):
            world.step(FORWARD)
        digests.append(_digest(world))
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize("when", [300, 1500])
def test_restored_world_goes_on_to_the_bit(make_world, when):
    """Saved in free flight and after contact (latched, reel running); restored into the world that has flown on.

    Twice: what flies on from a state does not change it.
    """
    world = make_world(p_PD_B=(1.0, 0.08, 0.05), gusts=_gusts(7, sigma_m_s=0.1))
    for _ in range(when):
        world.step(FORWARD)
    state = world.save()
    assert world.truth.latched == (when > 1400)
    ends = []
    for _ in range(3):
        truths = [world.step(FORWARD) for _ in range(400)]
        ends.append((_digest(world), truths[-1].root_tension_n, truths[-1].coupling_force_n, truths[-1].tick))
        world.restore(state)
    assert ends[0] == ends[1] == ends[2]


def test_whatever_is_written_into_a_truth_changes_neither_it_nor_the_flight_nor_what_was_saved(make_world, wind_in):
    """A tanker that turns, a hose that is partly wound in, gusts: all that the next tick is made of."""
    racetrack = TankerPathParameters(manoeuvre="racetrack", bank_rad=0.4)

    def flown(spoilt):
        world = make_world(p_PD_B=FAR, gusts=_gusts(8), tanker_path=racetrack)
        wind_in(world, 2.0)
        ends, state = [], world.save()
        for _ in range(2):
            for _ in range(20):
                truth = world.step(FORWARD)
                arrays = [getattr(truth, f.name) for f in fields(Truth)]
                for array in [a for a in [*arrays, truth.p_DP] if spoilt and isinstance(a, np.ndarray)]:
                    array += 1.0
            ends.append((_digest(world), *np.concatenate([truth.gust_D_m_s, truth.p_WT, truth.specific_force_B])))
            world.restore(state)
        return ends

    (first, again), untouched = flown(spoilt=True), flown(spoilt=False)
    assert [first, again] == untouched and first == again


def test_halving_the_step_moves_the_settled_drogue_by_less_than_a_millimetre(make_world):
    places = []
    for rate_hz in (1000, 2000):
        world = make_world(p_PD_B=FAR, rate_hz=rate_hz, settle_s=1.5)
        places.append(world.truth.p_WD)
    assert np.linalg.norm(places[0] - places[1]) < 1e-3


def test_halving_the_step_leaves_a_swing_of_two_metres_the_same_within_two_centimetres(make_world):
    places = []
    for rate_hz in (1000, 2000):
        world = make_world(p_PD_B=FAR, rate_hz=rate_hz)
        _swing(world, 0.5)
        for _ in range(2 * rate_hz):
            truth = world.step(ReceiverCommand())
        places.append(truth.p_WD)
    assert np.linalg.norm(places[0] - places[1]) < 0.02


@pytest.mark.slow
def test_halving_the_step_moves_the_contact_by_less_than_a_centimetre(make_world):
    contacts = []
    for rate_hz in (1000, 2000):
        world = make_world(p_PD_B=(1.0, 0.08, 0.05), rate_hz=rate_hz)
        for _ in range(3 * rate_hz):
            truth = world.step(FORWARD)
            if truth.latched:
                break
        contacts.append(truth)
    assert all(truth.latched for truth in contacts)
    assert np.linalg.norm(contacts[0].p_WP - contacts[1].p_WP) < 0.01


def test_receiver_that_runs_into_the_drogue_with_its_nose_is_noticed_by_name(make_world):
    """The drogue straight ahead of the nose: 0.9 m to the left of the probe, 0.65 m below."""
    world = make_world(p_PD_B=(0.6, 0.9, -0.65))
    for _ in range(3000):
        truth = world.step(FORWARD)
        if truth.receiver_touches:
            break
    assert truth.receiver_touches.startswith(("basket_", "coupling_", "hose_"))
    assert not truth.latched


def test_step_that_diverges_is_an_error_and_not_a_silent_reset(make_world):
    world = make_world(p_PD_B=FAR)
    world.data.qvel[world.model.joint("hose_3_y").dofadr[0]] = 1e9
    mujoco.mj_step1(world.model, world.data)
    with pytest.raises(DockairError, match="diverged"):
        for _ in range(20):
            world.step(ReceiverCommand())


def test_negative_settling_time_is_refused(make_world):
    with pytest.raises(DockairError, match=r"start\.settle_s: expected a time >= 0"):
        make_world(settle_s=-1.0)
