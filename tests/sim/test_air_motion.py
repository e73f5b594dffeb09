"""Gusts, wake and bow wave joined: what reaches whom, in which axes, and that each can be switched off alone."""

import copy

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp, matrix_from_yaw_pitch_roll
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.bow_wave import BowWaveParameters, bow_wave_coefficients, bow_wave_velocity
from dockair.sim.air.discrete_gust import DiscreteGust, DiscreteGusts
from dockair.sim.air.motion import AirMotion, AirState
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters
from dockair.sim.air.wake import WakeParameters, wake_coefficients, wake_velocity

V, STEP_S = 180.0, 1e-3
EXIT_T = np.array([-19.5, 0.0, -1.9])
CENTRE = np.zeros((1, 3))
POINTS = np.array(  # nose, tail, wings, fin: they span all three axes
    [[4.8, 0, 0], [-5, 0, 0], [-1.5, 4, 0], [-1.5, -4, 0], [-1, 2, 0], [-1, -2, 0], [-5, 0, 2.5], [-1, 0, -0.7]]
)
TOW = np.column_stack([np.linspace(-0.5, -15.0, 19), np.linspace(0.0, 0.4, 19), np.linspace(0.0, -2.7, 19)])
LEVEL, P_WT = np.eye(3), -EXIT_T
R_WB, P_WB = exp(np.array([0.05, -0.08, 0.03])), np.array([-21.0, 0.9, -3.4])
WAKE = wake_coefficients(
    load_parameters("wake", WakeParameters), mass_kg=80e3, span_m=40.0, airspeed_m_s=V, air=standard_atmosphere(6000.0)
)
BOW_WAVE = bow_wave_coefficients(load_parameters("bow_wave", BowWaveParameters), np.array([6.0, -0.9, 0.6]), V)


class Ramp:
    """A gust that grows evenly forward: a rigid turning of the air about y and z, and a stretching."""

    def __init__(self, per_metre, rolling_rad_s=0.0):
        self.per_metre, self.rolling_rad_s, self.steps = np.asarray(per_metre), rolling_rad_s, 0

    def step(self):
        self.steps += 1

    def velocity(self, x):
        return np.outer(x, self.per_metre)

    def write_gusts(self, x, rolling_x, gusts):
        gusts[:] = self.velocity(x)
        return self.rolling_rad_s * rolling_x


class Uniform(Ramp):
    """The same gust everywhere."""

    def velocity(self, x):
        return np.tile(self.per_metre, (len(x), 1))


def dryden(seed=4):
    parameters = load_parameters("turbulence", TurbulenceParameters, {"sigma_m_s": 2.0})
    return DrydenField(parameters, V, STEP_S, np.random.default_rng(seed), 9.144)


def single():
    gust = DiscreteGust(at_s=0.0, length_m=30.0, velocity_m_s=np.array([0.5, 2.0, -3.0]))
    return DiscreteGusts([gust], V, STEP_S, met_at_m=-14.7, start_s=0.1)


def motion(gusts=None, discrete=None, wake=None, bow_wave=None, points_B=POINTS):
    return AirMotion(gusts, discrete, wake, bow_wave, exit_T=EXIT_T, receiver_points_B=points_B)


def now(air: AirMotion, R_WT=LEVEL, p_WT=P_WT) -> AirState:
    return air.at(TOW, R_WB, P_WB, R_WT, p_WT)


def parts(state: AirState):
    return (state.tow_W, state.receiver_W, state.receiver_rotation_B)


def test_with_every_source_off_nothing_moves():
    air = motion()
    air.step()
    for part in parts(now(air)):
        assert not part.any()


@pytest.mark.parametrize("off", range(4))
def test_a_source_that_is_off_leaves_what_the_others_do_to_the_bit(off):
    """On and off must differ, and what is left must be the sum of the single ones."""
    sources = [dryden(), single(), WAKE, BOW_WAVE]
    left = [source if i != off else None for i, source in enumerate(sources)]
    without = parts(now(motion(*left)))
    alone = [
        parts(now(motion(*[source if j == i else None for j, source in enumerate(left)]))) for i in range(4) if i != off
    ]
    everything = parts(now(motion(*sources)))
    for i, part in enumerate(without):
        np.testing.assert_allclose(part, sum(single_one[i] for single_one in alone), atol=1e-13)
    assert np.abs(everything[0] - without[0]).max() > 0.01


def test_the_steady_part_is_the_wake_alone_to_the_bit_and_leaves_the_gusts_where_they_are():
    air = motion(dryden(), single(), WAKE, BOW_WAVE)
    before = now(air)
    for steady, alone in zip(parts(now(air.steady())), parts(now(motion(wake=WAKE))), strict=True):
        np.testing.assert_array_equal(steady, alone)
    np.testing.assert_array_equal(now(air).tow_W, before.tow_W)
    assert not now(motion(dryden()).steady()).receiver_W.any()


def test_what_was_told_stays_when_the_air_is_asked_again_with_another_number_of_places():
    air = motion(dryden(), single(), WAKE, BOW_WAVE)
    before, fewer = now(air), air.at(TOW[:4], R_WB, P_WB, LEVEL, P_WT)
    kept = before.tow_W.copy()
    np.testing.assert_array_equal(fewer.tow_W, kept[:4])
    np.testing.assert_array_equal(now(air).tow_W, kept)
    np.testing.assert_array_equal(before.tow_W, kept)


def test_discrete_gusts_alone_are_the_same_however_often_they_are_asked_for():
    air = motion(discrete=single())
    before = now(air).tow_W
    np.testing.assert_array_equal(now(air).tow_W, before)
    assert np.abs(before).max() > 0.1


def test_gusts_alone_reach_the_tow_as_the_field_gives_them_to_the_bit():
    np.testing.assert_array_equal(now(motion(gusts=dryden())).tow_W, dryden().velocity(TOW[:, 0]))
    np.testing.assert_array_equal(now(motion(discrete=single())).tow_W, single().velocity(TOW[:, 0]))


def test_felt_at_the_centre_of_gravity_alone_a_gust_is_that_of_its_place_and_turns_nothing_to_the_bit():
    state = now(motion(discrete=single(), points_B=CENTRE))
    np.testing.assert_array_equal(state.receiver_W, single().velocity(P_WB[:1])[0])
    np.testing.assert_array_equal(state.receiver_rotation_B, np.zeros(3))


def test_the_bow_wave_reaches_the_tow_and_not_the_receiver_that_makes_it():
    state = now(motion(bow_wave=BOW_WAVE))
    expected = bow_wave_velocity((TOW - P_WB) @ R_WB, BOW_WAVE) @ R_WB.T
    np.testing.assert_allclose(state.tow_W, expected, rtol=1e-12, atol=1e-12)
    assert not state.receiver_W.any() and not state.receiver_rotation_B.any()
    assert np.linalg.norm(state.tow_W[-1]) > 10.0 * np.linalg.norm(state.tow_W[0])


def test_the_wake_reaches_the_tow_at_its_places_behind_the_tanker():
    expected = wake_velocity(TOW + EXIT_T, WAKE)
    np.testing.assert_allclose(now(motion(wake=WAKE)).tow_W, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("R", [np.eye(3), R_WB, exp(np.array([0.7, 0.2, -1.0]))])
def test_evenly_growing_gusts_turn_the_receiver_by_their_slope_and_stretching_does_not(R):
    """F-L-U: up-flow that grows forward lifts the nose (negative about y), left-flow that grows forward turns it left.

    v(r) = per_metre (x_0 + r_x): seen along the body's axes, w = (dv_z/dy, -dv_z/dx, dv_y/dx).
    """
    per_metre = np.array([0.03, 0.02, -0.05])
    state = motion(discrete=Ramp(per_metre)).at(TOW, R, P_WB, LEVEL, P_WT)
    slopes_B = R.T @ np.outer(per_metre, [1.0, 0.0, 0.0]) @ R
    expected = [slopes_B[2, 1], -slopes_B[2, 0], slopes_B[1, 0]]
    np.testing.assert_allclose(state.receiver_rotation_B, expected, atol=1e-14)
    np.testing.assert_allclose(state.receiver_W, P_WB[0] * per_metre, atol=1e-13)
    if np.array_equal(R, LEVEL):
        np.testing.assert_allclose(state.receiver_rotation_B, [0.0, 0.05, 0.02], atol=1e-14)


def test_the_wake_rolls_a_receiver_beside_the_axis_by_its_own_gradients():
    """Sample points close together: the fit is the derivative. Left of the axis the downwash grows outward: it rolls
    the left wing down, negative about x."""
    place = np.array([-21.0, 3.0, -3.4])
    close = 1e-3 * POINTS
    state = motion(wake=WAKE, points_B=close).at(TOW, R_WB, place, LEVEL, P_WT)
    step, at = 1e-4 * np.eye(3), place + EXIT_T
    slopes = (wake_velocity(at + step, WAKE) - wake_velocity(at - step, WAKE)).T / 2e-4
    B = R_WB.T @ slopes @ R_WB
    np.testing.assert_allclose(state.receiver_rotation_B, [B[2, 1], -B[2, 0], B[1, 0]], atol=5e-6)
    assert state.receiver_rotation_B[0] < -0.01
    np.testing.assert_allclose(state.receiver_W, wake_velocity((place + EXIT_T)[None], WAKE)[0], rtol=1e-5)


def test_on_the_axis_the_wake_neither_rolls_nor_yaws_a_level_receiver():
    state = motion(wake=WAKE).at(TOW, LEVEL, np.array([-21.0, 0.0, -3.4]), LEVEL, P_WT)
    np.testing.assert_allclose(state.receiver_rotation_B[[0, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(state.receiver_W[1], 0.0, atol=1e-12)


def test_the_rolling_gust_is_taken_at_the_centre_of_gravity_and_turns_about_x_alone():
    rolled = now(motion(gusts=Ramp([0.0, 0.0, 0.0], 0.02))).receiver_rotation_B
    np.testing.assert_allclose(rolled, [0.02 * P_WB[0], 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("z_m", [0.0, 1.0, -40.0])
def test_a_flat_set_of_points_has_no_gradient_across_itself_and_finds_those_within_wherever_it_stands(z_m):
    flat, per_metre = POINTS * [1.0, 1.0, 0.0] + [0.0, 0.0, z_m], np.array([0.0, 0.3, -0.2])
    state = motion(discrete=Ramp(per_metre), points_B=flat).at(TOW, LEVEL, P_WB, LEVEL, P_WT)
    np.testing.assert_allclose(state.receiver_W, P_WB[0] * per_metre, atol=1e-13)
    np.testing.assert_allclose(state.receiver_rotation_B, [0.0, 0.2, 0.3], atol=1e-13)


@pytest.mark.parametrize("spread_m", [0.0, 0.01])
def test_a_plane_that_is_turned_far_off_and_almost_flat_feels_the_whole_gust(spread_m):
    turned = exp(np.array([0.4, -0.3, 0.2]))
    points = (POINTS * [1.0, 1.0, spread_m / np.ptp(POINTS[:, 2])] + [0.0, 0.0, -20.0]) @ turned.T
    uniform = np.array([1.0, -2.0, 10.0])
    state = motion(discrete=Uniform(uniform), points_B=points).at(TOW, LEVEL, P_WB, LEVEL, P_WT)
    np.testing.assert_allclose(state.receiver_W, uniform, atol=1e-6)
    np.testing.assert_allclose(state.receiver_rotation_B, np.zeros(3), atol=1e-6)


ABREAST = [[1.0, 2.0, 0.0], [1.0, -2.0, 0.0], [1.0, 0.0, 0.5]]


@pytest.mark.parametrize(("points_B", "x_m"), [(ABREAST, 1.0), ([[3.0, 0.0, 0.0]], 3.0), (2 * [[0.1, 0.7, 0.3]], 0.1)])
def test_points_that_do_not_spread_forward_feel_the_gust_of_where_they_are_and_no_turning(points_B, x_m):
    per_metre = np.array([0.5, 0.3, -0.2])
    state = motion(discrete=Ramp(per_metre), points_B=points_B).at(TOW, LEVEL, P_WB, LEVEL, P_WT)
    np.testing.assert_allclose(state.receiver_W, (P_WB[0] + x_m) * per_metre, atol=1e-13)
    np.testing.assert_allclose(state.receiver_rotation_B, np.zeros(3), atol=1e-13)


def test_turning_and_shifting_the_whole_scene_turns_what_is_felt():
    """Gusts are level with the tanker's heading, so they turn with it; nothing knows where W's origin is."""
    turn, shift = matrix_from_yaw_pitch_roll(0.8, 0.0, 0.0), np.array([3000.0, -2000.0, 40.0])
    air = motion(dryden(), single(), WAKE, BOW_WAVE)
    before = now(air)
    after = air.at(TOW @ turn.T + shift, turn @ R_WB, turn @ P_WB + shift, turn, turn @ P_WT + shift)
    np.testing.assert_allclose(after.tow_W, before.tow_W @ turn.T, atol=1e-9)
    np.testing.assert_allclose(after.receiver_W, turn @ before.receiver_W, atol=1e-9)
    np.testing.assert_allclose(after.receiver_rotation_B, before.receiver_rotation_B, atol=1e-10)


def test_in_a_banked_turn_the_wake_banks_and_is_as_much_stronger_as_the_lift():
    bank, climb = np.deg2rad(25.0), np.deg2rad(-3.0)
    R_WT = matrix_from_yaw_pitch_roll(0.4, -climb, bank)
    state = motion(wake=WAKE).at(TOW @ R_WT.T + P_WT, R_WB, P_WB, R_WT, P_WT)  # the tow stands at TOW in T
    expected = wake_velocity(TOW, WAKE) @ R_WT.T * np.cos(climb) / np.cos(bank)
    np.testing.assert_allclose(state.tow_W, expected, rtol=1e-12, atol=1e-12)


def test_gusts_stay_level_when_the_tanker_banks():
    R_WT = matrix_from_yaw_pitch_roll(0.0, 0.0, 0.4)
    air = motion(discrete=Ramp([0.0, 0.0, 1.0]))
    p_WT = -R_WT @ EXIT_T  # the exit stays at W's origin
    np.testing.assert_allclose(now(air, R_WT, p_WT).tow_W, np.outer(TOW[:, 0], [0.0, 0.0, 1.0]), atol=1e-12)


def test_gusts_run_along_the_level_heading_of_a_pitched_and_banked_tanker_from_its_hoses_exit():
    """Beside its middle; to the tow, and as rolling at the receiver's centre of gravity."""
    yaw, exit_T, p_WT = 0.5, np.array([-19.5, 9.0, -1.9]), np.array([4.0, -3.0, 2.0])
    R_WT = matrix_from_yaw_pitch_roll(yaw, 0.25, 0.3)
    level = matrix_from_yaw_pitch_roll(yaw, 0.0, 0.0)
    ahead = (np.vstack([TOW, P_WB]) - p_WT - R_WT @ exit_T) @ level[:, 0]
    per_metre = np.array([0.03, 0.02, -0.05])
    slope, rolling = Ramp(per_metre), Ramp(np.zeros(3), 0.02)
    air = AirMotion(rolling, slope, exit_T=exit_T, receiver_points_B=CENTRE)
    state = air.at(TOW, R_WB, P_WB, R_WT, p_WT)
    felt = np.outer(ahead, level @ per_metre)
    np.testing.assert_allclose(state.tow_W, felt[:-1], atol=1e-12)
    np.testing.assert_allclose(state.receiver_W, felt[-1], atol=1e-12)
    np.testing.assert_allclose(state.receiver_rotation_B, [0.02 * ahead[-1], 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("kind", "field_of"), [("gusts", dryden), ("discrete", single)])
def test_a_step_moves_either_kind_of_gust_on_by_a_tick(kind, field_of):
    air, field = motion(**{kind: field_of()}), field_of()
    before = field.velocity(TOW[:, 0])
    for _ in range(40):
        air.step()
        field.step()
    np.testing.assert_array_equal(now(air).tow_W, field.velocity(TOW[:, 0]))
    assert np.abs(now(air).tow_W - before).max() > 0.01


def test_a_step_moves_the_gusts_on_and_a_copy_of_the_air_goes_the_same_way():
    air = motion(dryden(), single(), WAKE, BOW_WAVE)
    twin, before = copy.deepcopy(air), now(air)
    for _ in range(40):
        air.step()
    after = now(air)
    assert np.abs(after.tow_W - before.tow_W).max() > 0.01
    for _ in range(40):
        twin.step()
    for ours, copied in zip(parts(after), parts(now(twin)), strict=True):
        np.testing.assert_array_equal(ours, copied)


@pytest.mark.parametrize("points_B", [np.zeros((0, 3)), np.zeros(3), np.zeros((2, 2))])
def test_sample_points_of_another_shape_are_refused(points_B):
    with pytest.raises(DockairError, match=r"gust_points_m: expected one or more points \(x, y, z\)"):
        motion(points_B=points_B)
