"""The receiver in flight, on a rigid body that this file integrates itself (Runge-Kutta, no MuJoCo)."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numba import njit
from scipy.linalg import expm

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp, skew
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.engine import rotor_moment
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.linear_model import linear_model
from dockair.sim.aircraft.receiver import Receiver
from dockair.sim.aircraft.trim import level_trim, steady_trim

FLIGHTS = [(180.0, 6000.0), (120.0, 3000.0)]
STEP_S = 2e-3
GRAVITY_W = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])
AIRFRAME = load_parameters("airframe", AirframeParameters)
PROBE_B = np.array([6.0, -0.9, 0.6])
ARM = -skew(PROBE_B)
QUIET = dict.fromkeys(
    (
        "attitude_sigma_rad",
        "rate_sigma_rad_s",
        "specific_force_sigma_m_s2",
        "velocity_sigma_m_s",
        "airspeed_sigma_m_s",
    ),
    0.0,
)


def make(
    airspeed_m_s: float = 180.0,
    altitude_m: float = 6000.0,
    step_s: float = STEP_S,
    drift: float = 0.0,
    noise: bool = False,
    seed: int = 21,
) -> Receiver:
    overrides = ({} if noise else QUIET) | {"inertial_velocity_sigma_m_s": drift}
    return Receiver(
        airframe=AIRFRAME,
        flight_control=load_parameters("flight_control", FlightControlParameters, overrides),
        probe_B=PROBE_B,
        airspeed_m_s=airspeed_m_s,
        air=standard_atmosphere(altitude_m),
        step_s=step_s,
        rng=np.random.default_rng(seed),
    )


@dataclass
class Body:
    """A rigid body: R_WB, v_WB, w_WB_B; force and torque in W, held over a step."""

    mass_kg: float
    inertia_B: np.ndarray
    R_WB: np.ndarray
    v_WB: np.ndarray = field(default_factory=lambda: np.zeros(3))
    w_WB_B: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def advance(self, force_W: np.ndarray, torque_W: np.ndarray, step_s: float) -> None:
        self.R_WB, self.w_WB_B = _turned(
            self.R_WB, self.w_WB_B, self.R_WB.T @ torque_W, self.inertia_B, np.linalg.inv(self.inertia_B), step_s
        )
        self.v_WB = self.v_WB + step_s * (force_W / self.mass_kg + GRAVITY_W)


@njit(cache=True)
def _turned(R, w, torque_B, inertia, inverse, h):  # type: ignore[no-untyped-def]
    """Attitude and angular velocity after h: Runge-Kutta for w, the exponential of its mean for R."""
    k, ks = np.zeros(3), np.zeros((4, 3))
    for i, part in enumerate((0.0, 0.5, 0.5, 1.0)):
        u = w + part * h * k
        L = inertia @ u
        gyroscopic = np.array([u[1] * L[2] - u[2] * L[1], u[2] * L[0] - u[0] * L[2], u[0] * L[1] - u[1] * L[0]])
        k = inverse @ (torque_B - gyroscopic)
        ks[i] = k
    after = w + h / 6.0 * (ks[0] + 2.0 * ks[1] + 2.0 * ks[2] + ks[3])
    x, y, z = 0.5 * h * (w + after)
    t = max(np.sqrt(x * x + y * y + z * z), 1e-12)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return R @ (np.eye(3) + np.sin(t) / t * K + (1.0 - np.cos(t)) / (t * t) * (K @ K)), after


def fly(
    receiver: Receiver,
    seconds: float,
    command: Callable[[float], ReceiverCommand],
    *,
    step_s: float = STEP_S,
    gusts: DrydenField | None = None,
    pull_W: Callable[[float], np.ndarray] = lambda t: np.zeros(3),
    body: Body | None = None,
) -> np.ndarray:
    """(n, 13) velocity of the probe's tip in W, surfaces, throttle, left axis of the body in W, the tip's place."""
    body = body or Body(receiver.mass_kg, receiver.inertia_B, receiver.trim_R_WB.copy())
    wind_W = np.array([-receiver.trim.airspeed_m_s, 0.0, 0.0])
    specific_force_B = body.R_WB.T @ -GRAVITY_W
    log, p_WB = np.empty((round(seconds / step_s), 13)), np.zeros(3)
    for k in range(len(log)):
        gust_W, roll_rad_s = np.zeros(3), 0.0
        if gusts is not None:
            gusts.step()
            gust_W = gusts.velocity(np.array([-25.0]))[0]
            roll_rad_s = gusts.rolling(-25.0)
        force_W, torque_W = receiver.step(
            R_WB=body.R_WB,
            v_WB=body.v_WB,
            w_WB_B=body.w_WB_B,
            air_velocity_W=wind_W + gust_W,
            specific_force_B=specific_force_B,
            command=command(k * step_s),
            air_rotation_B=np.array([roll_rad_s, 0.0, 0.0]),
        )
        force_W = force_W + pull_W(k * step_s)
        specific_force_B = body.R_WB.T @ force_W / receiver.mass_kg
        body.advance(force_W, torque_W, step_s)
        p_WB = p_WB + step_s * body.v_WB
        tip_W = body.v_WB + body.R_WB @ ARM @ body.w_WB_B
        p_WP = p_WB + body.R_WB @ PROBE_B
        log[k] = [*tip_W, *receiver.actuators.surfaces_rad, receiver.throttle, *body.R_WB[:, 1], *p_WP]
    return log


def hold(*velocity: float) -> Callable[[float], ReceiverCommand]:
    command = ReceiverCommand(velocity_m_s=np.array(velocity or (0.0, 0.0, 0.0)))
    return lambda t: command


def dryden(sigma_m_s: float, airspeed_m_s: float, seed: int = 1) -> DrydenField:
    parameters = load_parameters("turbulence", TurbulenceParameters, {"sigma_m_s": sigma_m_s})
    return DrydenField(parameters, airspeed_m_s, STEP_S, np.random.default_rng(seed), AIRFRAME.span_m)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_trimmed_receiver_stays_where_it_is_in_still_air(airspeed_m_s: float, altitude_m: float) -> None:
    log = fly(make(airspeed_m_s, altitude_m), 4.0, hold())
    assert np.abs(log[:, :3]).max() < 1e-9


def test_linear_model_predicts_the_free_flight_of_the_airframe() -> None:
    """Surfaces and thrust held at trim: 1.5 s of small motion against the matrix exponential, 2 % of its size."""
    trim = level_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0))
    A, h = linear_model(AIRFRAME, trim).A, 1e-3
    x0 = np.zeros(13)
    x0[:3], x0[3:6], x0[6:9] = [0.1, 0.2, -0.2], [0.002, 0.001, -0.002], [0.005, 0.002, 0.003]
    body = Body(AIRFRAME.mass_kg, AIRFRAME.inertia_B, exp(x0[3:6]) @ trim.R_WB, x0[:3].copy(), x0[6:9].copy())
    for _ in range(1500):
        v_B = body.R_WB.T @ (body.v_WB + np.array([180.0, 0.0, 0.0]))
        force, moment = trim.aerodynamics.force_and_moment(v_B, body.w_WB_B, trim.surfaces_rad)
        force[0] += trim.thrust_n
        moment = moment + rotor_moment(AIRFRAME, body.w_WB_B)
        body.advance(body.R_WB @ force, body.R_WB @ moment, h)
    expected = expm(1.5 * A) @ x0
    np.testing.assert_allclose(body.v_WB, expected[:3], atol=0.02 * np.abs(expected[:3]).max())
    np.testing.assert_allclose(body.w_WB_B, expected[6:9], atol=0.02 * np.abs(x0[6:9]).max())


@pytest.mark.parametrize("axis", range(3), ids=["forward", "left", "up"])
@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_step_of_the_tips_velocity_is_flown_quickly_without_overshoot(
    airspeed_m_s: float, altitude_m: float, axis: int
) -> None:
    """The command is in body axes: its part along W's axis is compared, which leaves cos(alpha) along x and z."""
    receiver, size = make(airspeed_m_s, altitude_m), 1.0
    response = fly(receiver, 6.0, hold(*(size * np.eye(3)[axis])))[:, axis] / (size * receiver.trim_R_WB[axis, axis])
    slow = 1.6 if axis == 0 else 0.8  # 1/e of the way; the reference's gain is 0.9 and 1.6 1/s
    assert np.argmax(response > 1.0 - np.exp(-1.0)) * STEP_S < slow
    assert response.max() < 1.05
    assert response.min() > -0.08
    assert response[-1] == pytest.approx(1.0, abs=0.015)


def swing(receiver: Receiver, axis: int, w: float, size: float, share: float = 1.0) -> complex:
    """The tip's velocity over a command of one frequency, whose rate is given by that share."""
    e = np.eye(3)[axis]
    log = fly(
        receiver,
        4.0 * np.pi / w,
        lambda t: ReceiverCommand(
            velocity_m_s=size * np.sin(w * t) * e, acceleration_m_s2=share * size * w * np.cos(w * t) * e
        ),
    )
    t = np.arange(1, len(log) + 1) * STEP_S
    last = t > 2.0 * np.pi / w
    basis = np.column_stack([np.sin(w * t), np.cos(w * t)])[last]
    sine, cosine = np.linalg.lstsq(basis, log[last, axis], rcond=None)[0]
    return complex(sine, cosine) / size


@pytest.mark.parametrize("axis", [1, 2], ids=["left", "up"])
@pytest.mark.parametrize(("hertz", "size"), [(0.2, 1.0), (0.35, 1.0), (0.5, 0.4), (0.8, 0.3)])
def test_tip_swings_with_a_drogue(hertz: float, size: float, axis: int) -> None:
    """Within 12 % of its velocity and later by 0.065 to 0.1 s at each frequency: a delay that guidance can predict."""
    w = 2.0 * np.pi * hertz
    response = swing(make(), axis, w, size)
    assert abs(response) == pytest.approx(1.0, abs=0.12)
    assert 0.065 < -np.angle(response) / w < 0.1


def test_bank_of_a_swing_to_the_side_does_not_heave_the_tip() -> None:
    """1 m/s at 0.35 Hz takes 18 degrees of bank, and leaves less than 0.15 m/s upward."""
    w, receiver = 2.0 * np.pi * 0.35, make()
    left = np.array([0.0, 1.0, 0.0])
    body = Body(receiver.mass_kg, receiver.inertia_B, receiver.trim_R_WB.copy())

    def command(t: float) -> ReceiverCommand:
        to_body = body.R_WB.T
        return ReceiverCommand(
            velocity_m_s=np.sin(w * t) * to_body @ left, acceleration_m_s2=w * np.cos(w * t) * to_body @ left
        )

    log = fly(receiver, 8.0, command, body=body)[1500:]
    assert np.abs(np.degrees(np.arcsin(log[:, 9]))).max() == pytest.approx(19.0, abs=4.0)
    assert np.abs(log[:, 2]).max() < 0.15


@pytest.mark.parametrize("hertz", [0.42, 0.5, 0.65])
@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_swings_beyond_the_limits_are_cut_and_not_lost(airspeed_m_s: float, altitude_m: float, hertz: float) -> None:
    """2 m/s to the side, five times the limit's: bank within 40 degrees, and calm within 5 s after it."""
    w, e = 2.0 * np.pi * hertz, np.array([0.0, 1.0, 0.0])

    def command(t: float) -> ReceiverCommand:
        if t > 6.0:
            return ReceiverCommand()
        return ReceiverCommand(velocity_m_s=2.0 * np.sin(w * t) * e, acceleration_m_s2=2.0 * w * np.cos(w * t) * e)

    log = fly(make(airspeed_m_s, altitude_m), 11.0, command)
    assert log[:, 8].min() > np.cos(np.radians(40.0))
    assert np.abs(log[-1, :3]).max() < 0.1


@pytest.mark.parametrize(("axis", "late_deg"), [(0, 20.0), (1, 9.0), (2, 7.0)], ids=["forward", "left", "up"])
def test_feed_forward_takes_the_lag_out(axis: int, late_deg: float) -> None:
    """At 1 rad/s: gain within 8 % and so much late, against 35 degrees or more on velocity alone."""
    with_it, without = swing(make(), axis, 1.0, 0.3), swing(make(), axis, 1.0, 0.3, share=0.0)
    assert abs(with_it) == pytest.approx(1.0, abs=0.08)
    assert np.degrees(np.angle(with_it)) > -late_deg
    assert np.degrees(np.angle(without)) < -35.0


def test_tip_stays_within_a_centimetre_in_still_air_with_all_noise_on() -> None:
    """8 s without drift: no limit cycle; a minute of it is among the slow tests."""
    log = fly(make(noise=True), 8.0, hold())
    place = log[500:, 10:]
    assert np.all(place.std(axis=0) < 0.01)
    assert np.abs(log[:, :3]).max() < 0.02
    assert np.abs(np.diff(log[:, 3:6], axis=0)).max() / STEP_S < 0.2  # rad/s; the limits are 1 to 2


@pytest.mark.slow
def test_tip_stays_within_a_centimetre_for_a_minute() -> None:
    place = fly(make(noise=True), 60.0, hold())[500:, 10:]
    assert np.all(place.std(axis=0) < 0.01)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_velocity_holds_in_gusts(airspeed_m_s: float, altitude_m: float) -> None:
    """Gusts of 0.5 m/s, rolling ones too, all noise on: below 0.02 m/s rms is left of the tip's velocity across."""
    log = fly(make(airspeed_m_s, altitude_m, noise=True), 10.0, hold(), gusts=dryden(0.5, airspeed_m_s))
    rms = np.sqrt(np.mean(log[:, :3] ** 2, axis=0))
    assert np.all(rms < [0.02, 0.02, 0.02])


def test_accelerometers_buy_most_of_the_calm_in_gusts() -> None:
    """Without the gust's estimate the tip heaves and sways more than three times as much."""
    with_it = fly(make(), 10.0, hold(), gusts=dryden(2.2, 180.0))[:, 10:].std(axis=0)
    deaf = make()
    deaf.flight_control.schedule.at(0.0).gust_from_residual[:] = 0.0
    without = fly(deaf, 10.0, hold(), gusts=dryden(2.2, 180.0))[:, 10:].std(axis=0)
    assert np.all(without[1:] > 3.0 * with_it[1:])


def eased(t: float, start: float, length: float) -> float:
    """From 0 to 1 without a jump in the second derivative, as a tanker rolls into a turn."""
    u = min(max((t - start) / length, 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


def test_turn_of_25_degrees_is_entered_flown_and_left_without_losing_the_path() -> None:
    """Rolled in and out at 5 degrees/s: the path's velocity, turned about the vertical with the tip, within 0.3 m/s."""
    V, bank = 180.0, np.radians(25.0)
    rate, length = STANDARD_GRAVITY_M_S2 * np.tan(bank) / V, 15.0 / 8.0 * np.tan(bank) / np.radians(5.0)

    def turn_rate(t: float) -> float:
        return float(rate * (eased(t, 1.0, length) - eased(t, 18.0, length)))

    log = fly(make(), 34.0, lambda t: ReceiverCommand(turn_rate_rad_s=turn_rate(t)))
    t = np.arange(1, len(log) + 1) * STEP_S
    rates = np.array([turn_rate(time) for time in t])
    heading = np.cumsum(rates) * STEP_S
    c, s = np.cos(heading), np.sin(heading)
    trim = make().trim
    arm = (trim.R_WB @ PROBE_B)[0]  # the tip is ahead and so flies to the side in a turn
    expected = np.column_stack([V * c - V - rates * arm * s, V * s + rates * arm * c, np.zeros(len(t))])
    error = log[:, :3] - expected
    assert np.abs(error).max() < 0.3
    settled = ((t > 1.0 + length + 3.0) & (t < 18.0)) | (t > 18.0 + length + 3.0)
    assert np.abs(error[settled]).max() < 0.05
    assert np.degrees(np.arcsin(log[(t > 10.0) & (t < 18.0), 9])).mean() == pytest.approx(-25.0, abs=0.3)
    assert log[-1, 9] == pytest.approx(0.0, abs=2e-3)  # wings level again


def test_toboggan_of_3_degrees_is_entered_and_flown() -> None:
    """Pulled over at 0.57 degrees/s at most: within 0.3 m/s of the path, of which 0.05 m/s is left 8 s later."""
    V, slope = 180.0, np.radians(3.0)
    length = 15.0 / 8.0 * slope / 0.01

    def climb(t: float) -> float:
        return float(-slope * eased(t, 1.0, length))

    log = fly(make(), 24.0, lambda t: ReceiverCommand(climb_rad=climb(t)))
    t = np.arange(1, len(log) + 1) * STEP_S
    angle = np.array([climb(time) for time in t])
    error = log[:, :3] - V * np.column_stack([np.cos(angle) - 1.0, np.zeros(len(t)), np.sin(angle)])
    assert np.abs(error).max() < 0.3
    assert np.abs(error[t > length + 9.0]).max() < 0.05


def test_turn_that_the_airframe_cannot_fly_is_cut_to_the_largest_bank() -> None:
    receiver = make()
    fly(receiver, 12.0, lambda t: ReceiverCommand(turn_rate_rad_s=1.0))
    bank = np.arctan(receiver.flight_control.path.turn_rate_rad_s * 180.0 / STANDARD_GRAVITY_M_S2)
    assert bank == pytest.approx(load_parameters("flight_control", FlightControlParameters).bank_limit_rad, abs=0.01)


def test_velocity_follows_the_drift_of_the_inertial_navigation() -> None:
    """It flies what it measures: its true velocity settles at minus the drift, and no knowledge of W corrects that."""
    receiver = make(drift=0.2)
    log = fly(receiver, 12.0, hold())
    drift = receiver.inertial_velocity.drift_m_s
    assert np.abs(drift).max() > 0.1
    np.testing.assert_allclose(log[-1, :3], -drift, atol=0.01)


def test_pull_of_the_hose_is_held() -> None:
    """1.7 kN aft and 0.3 kN down, at once: below 0.2 m/s lost, all back after 8 s, less than a metre gone."""

    def pull_W(t: float) -> np.ndarray:
        return np.array([-1700.0, 0.0, -300.0]) if t > 1.0 else np.zeros(3)

    velocity = fly(make(), 12.0, hold(), pull_W=pull_W)[:, :3]
    assert np.abs(velocity).max() < 0.2
    assert np.abs(velocity[-1]).max() < 0.01
    assert np.linalg.norm(np.sum(velocity, axis=0) * STEP_S) < 1.0


def test_limits_of_the_actuators_hold_and_the_integrals_do_not_wind_up() -> None:
    """Rolled by 60 degrees and yawed by 10 the actuators meet their limits; the upset is over within 10 s."""
    receiver = make()
    R_WB = exp(np.array([1.05, 0.0, 0.17])) @ receiver.trim_R_WB
    body = Body(receiver.mass_kg, receiver.inertia_B, R_WB, np.array([-2.0, 3.0, -2.0]))
    log = fly(receiver, 14.0, hold(), body=body)
    surfaces = np.vstack([receiver.trim.surfaces_rad, log[:, 3:6]])
    rates = np.abs(np.diff(surfaces, axis=0)) / STEP_S
    assert np.all(np.abs(surfaces) <= AIRFRAME.surface_limits_rad)
    assert np.all(rates <= AIRFRAME.surface_rate_limits_rad_s * (1.0 + 1e-9))
    assert np.any(rates >= AIRFRAME.surface_rate_limits_rad_s * (1.0 - 1e-9))
    assert np.all((log[:, 6] >= 0.0) & (log[:, 6] <= 1.0))
    assert np.abs(log[-1, :3]).max() < 0.1
    assert log[-1, 8] == pytest.approx(1.0, abs=1e-3)  # wings level


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_severe_gusts_and_bang_bang_commands_do_not_unsettle_it(airspeed_m_s: float, altitude_m: float) -> None:
    def command(t: float) -> ReceiverCommand:
        return ReceiverCommand(velocity_m_s=2.0 * np.sign(np.sin(np.array([1.0, 2.0, 3.0]) * (t + 0.1))))

    log = fly(make(airspeed_m_s, altitude_m), 12.0, command, gusts=dryden(6.4, airspeed_m_s))
    assert np.abs(log[:, :3]).max() < 5.0
    assert log[:, 8].min() > np.cos(np.radians(40.0))
    after = fly(make(airspeed_m_s, altitude_m), 14.0, lambda t: command(t) if t < 6.0 else hold()(t))
    assert np.abs(after[-1, :3]).max() < 0.05


@pytest.mark.parametrize("scale", [0.75, 1.3])
def test_flight_control_tolerates_an_airframe_other_than_its_own_model(scale: float) -> None:
    """Moments and damping of the on-board model wrong by a quarter and more: steps stay damped."""
    wrong = {
        name: (np.array(getattr(AIRFRAME, name)) * scale).tolist()
        for name in ("yawing_moment", "rolling_moment", "rolling_moment_aileron", "yawing_moment_rudder")
    }
    wrong["damping"] = (np.array(AIRFRAME.damping) * scale).tolist()
    airframe = load_parameters("airframe", AirframeParameters, wrong)
    receiver = make()
    trim = level_trim(airframe, 180.0, standard_atmosphere(6000.0))
    parameters = load_parameters("flight_control", FlightControlParameters)
    receiver.flight_control = FlightControl(
        parameters, airframe, trim=trim, air=standard_atmosphere(6000.0), probe_B=PROBE_B, step_s=STEP_S
    )
    log = fly(receiver, 8.0, hold(0.0, 1.0, 1.0))
    assert log[:, 1].max() < 1.2 and log[:, 2].max() < 1.2
    np.testing.assert_allclose(log[-1, 1:3], [1.0, 1.0], atol=0.05)


def test_half_the_step_flies_the_same_flight() -> None:
    command = hold(0.8, -1.0, 0.6)
    coarse = fly(make(step_s=STEP_S), 4.0, command)
    fine = fly(make(step_s=STEP_S / 2), 4.0, command, step_s=STEP_S / 2)
    # a tick more of delay in a loop of 9 rad/s moves the response by about 1 ms of its slope, 1.6 m/s^2
    np.testing.assert_allclose(coarse[:, :3], fine[1::2, :3], atol=0.005)


def test_same_seed_same_bits_also_from_a_copy_in_flight() -> None:
    one, two = make(drift=0.2), make(drift=0.2)
    body = Body(one.mass_kg, one.inertia_B, one.trim_R_WB.copy())
    np.testing.assert_array_equal(fly(one, 1.0, hold(0.5, 0.5, 0.0), body=body), fly(two, 1.0, hold(0.5, 0.5, 0.0)))
    saved = copy.deepcopy((one, body))
    onward = fly(one, 0.5, hold(0.5, 0.5, 0.0), body=body)
    np.testing.assert_array_equal(fly(saved[0], 0.5, hold(0.5, 0.5, 0.0), body=saved[1]), onward)


def test_what_it_measures_of_the_air_is_reported_after_the_step() -> None:
    receiver = make()
    v_W = np.array([190.0, -6.0, -8.0])  # to the right and sinking: air from the right and from below
    receiver.step(
        R_WB=np.eye(3),
        v_WB=v_W - np.array([180.0, 0.0, 0.0]),
        w_WB_B=np.zeros(3),
        air_velocity_W=np.array([-180.0, 0.0, 0.0]),
        specific_force_B=-GRAVITY_W,
        command=ReceiverCommand(),
    )
    size = np.linalg.norm(v_W)
    ours = (receiver.airspeed_m_s, receiver.angle_of_attack_rad, receiver.sideslip_rad)
    assert ours == pytest.approx((size, np.arctan2(8.0, 190.0), np.arcsin(6.0 / size)))


def test_trimmed_anew_in_sinking_air_it_begins_in_that_trim_and_reports_it_before_the_first_step() -> None:
    receiver = make()
    receiver.trim_in(3.0, 0.02)
    air = standard_atmosphere(6000.0)
    trim = steady_trim(AIRFRAME, 180.0, air, downwash_m_s=3.0, pitching_air_rad_s=0.02)
    assert receiver.throttle == receiver.actuators.throttle == trim.thrust_range.throttle(trim.thrust_n)
    assert receiver.angle_of_attack_rad == trim.alpha_rad and receiver.actuators.thrust_n == trim.thrust_n
    np.testing.assert_array_equal(receiver.actuators.surfaces_rad, trim.surfaces_rad)
    np.testing.assert_array_equal(receiver.trim_R_WB, trim.R_WB)
    still = make()
    assert abs(still.throttle - receiver.throttle) > 0.01
    assert abs(still.angle_of_attack_rad - receiver.angle_of_attack_rad) > 1e-3


def test_force_and_torque_are_those_of_air_engine_and_rotor_along_the_axes_of_the_world() -> None:
    receiver, R_WB = make(), exp(np.array([0.3, -0.1, 0.2]))
    v_WB, w_WB_B, air_W, turning_air = np.array([2.0, 3.0, -1.0]), np.array([0.2, -0.1, 0.3]), [-179.0, 2.0, 0.5], 0.04
    force_W, torque_W = receiver.step(
        R_WB=R_WB,
        v_WB=v_WB,
        w_WB_B=w_WB_B,
        air_velocity_W=np.array(air_W),
        specific_force_B=-R_WB.T @ GRAVITY_W,
        command=ReceiverCommand(),
        air_rotation_B=np.array([turning_air, 0.0, 0.0]),
    )
    force_B, moment_B = receiver.trim.aerodynamics.force_and_moment(
        R_WB.T @ (v_WB - air_W), w_WB_B - [turning_air, 0.0, 0.0], receiver.actuators.surfaces_rad
    )
    force_B = force_B + [receiver.actuators.thrust_n, 0.0, 0.0]
    np.testing.assert_allclose(force_W, R_WB @ force_B, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(torque_W, R_WB @ (moment_B + rotor_moment(AIRFRAME, w_WB_B)), rtol=1e-9, atol=1e-6)
    assert np.linalg.norm(rotor_moment(AIRFRAME, w_WB_B)) > 10.0


def test_flight_that_no_receiver_can_trim_is_refused() -> None:
    with pytest.raises(DockairError, match="airspeed_m_s: expected an airspeed at which the receiver can fly level"):
        make(airspeed_m_s=55.0)
