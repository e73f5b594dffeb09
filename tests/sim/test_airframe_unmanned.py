"""The second airframe: its derivatives, its modes, its flight control."""

from collections.abc import Callable

import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters, flow_angles
from dockair.sim.aircraft.derivatives import DerivativeAirframe
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.linear_model import linear_model
from dockair.sim.aircraft.receiver import Receiver
from dockair.sim.aircraft.trim import level_trim

AIRFRAME = load_parameters("airframe_unmanned", DerivativeAirframe)
RHO, V = 0.909, 120.0
Command = Callable[[float, np.ndarray], ReceiverCommand]  # at a time, in an attitude
MODEL = AIRFRAME.aerodynamics(RHO)
QBAR_S = 0.5 * RHO * V * V * AIRFRAME.wing_area_m2


def in_stability_axes(
    alpha: float = 0.0,
    beta: float = 0.0,
    rates_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
    surfaces: tuple[float, float, float] = (0.0, 0.0, 0.0),
    air_rotation_B: np.ndarray | None = None,
) -> np.ndarray:
    """(6,) drag, side force, lift, Cl, Cm, Cn about stability axes, right and down; rates P b/2V, Q c/2V, R b/2V."""
    b, c = AIRFRAME.span_m, AIRFRAME.chord_m
    from_body = np.array([[np.cos(alpha), 0, np.sin(alpha)], [0, 1, 0], [-np.sin(alpha), 0, np.cos(alpha)]])
    flip = np.array([1.0, -1.0, -1.0])
    w_B = flip * (from_body.T @ (np.array(rates_s) * 2.0 * V / np.array([b, c, b])))
    v_B = flip * V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    air = np.zeros(3) if air_rotation_B is None else air_rotation_B
    force, moment = MODEL.force_and_moment(v_B, w_B, np.array(surfaces), air)
    force, moment = from_body @ (flip * force) / QBAR_S, from_body @ (flip * moment) / QBAR_S / np.array([b, c, b])
    return np.array([-force[0], force[1], -force[2], *moment])


def test_motions_in_rows_make_the_wrenches_that_each_alone_makes() -> None:
    """To the bit, each row on its own."""
    motions = np.random.default_rng(7).normal(size=(3, 12)) * np.repeat([10.0, 0.3, 0.1, 0.1], 3)
    motions[:, 0] += V
    wrenches = np.empty((3, 6))
    MODEL.write_wrenches(motions, wrenches)
    for motion, wrench in zip(motions, wrenches, strict=True):
        np.testing.assert_array_equal(wrench, np.concatenate(MODEL.force_and_moment(*np.split(motion, 4))))


def test_lift_drag_and_pitching_moment_are_the_sheets() -> None:
    for alpha, q, elevator in ((0.0, 0.0, 0.0), (0.08, 0.0, 0.0), (-0.03, 0.004, 0.05)):
        CD, CY, CL, Cl, Cm, Cn = in_stability_axes(alpha, 0.0, (0.0, q, 0.0), (elevator, 0.0, 0.0))
        lift = 0.2 + 5.15 * alpha + 6.1 * q + 0.5 * elevator
        assert CL == pytest.approx(lift, abs=1e-12)
        assert CD == pytest.approx(0.02 + 0.0642 * lift**2, abs=1e-12)
        assert Cm == pytest.approx(0.025 - 0.7 * alpha - 21.85 * q - 1.12 * elevator, abs=1e-12)
        np.testing.assert_allclose([CY, Cl, Cn], 0.0, atol=1e-14)


@pytest.mark.parametrize("alpha", [0.0, 0.1])
def test_lateral_derivatives_are_the_sheets_about_stability_axes(alpha: float) -> None:
    """Roskam's values; ailerons are positive to the left here and to the right there."""
    printed = {
        "beta": (-0.346, -0.0944, 0.1106),
        "P": (-0.0827, -0.442, -0.0243),
        "R": (0.3, 0.0926, -0.139),
        "aileron": (0.0, -0.181, 0.0254),
        "rudder": (0.2, 0.015, -0.0365),
    }
    h = 1e-3
    changes = {
        "beta": in_stability_axes(alpha, beta=h),
        "P": in_stability_axes(alpha, rates_s=(h, 0.0, 0.0)),
        "R": in_stability_axes(alpha, rates_s=(0.0, 0.0, h)),
        "aileron": in_stability_axes(alpha, surfaces=(0.0, h, 0.0)),
        "rudder": in_stability_axes(alpha, surfaces=(0.0, 0.0, h)),
    }
    still = in_stability_axes(alpha)
    for name, C in changes.items():
        np.testing.assert_allclose((C - still)[[1, 3, 5]] / h, printed[name], atol=1e-6, err_msg=name)


def test_air_that_turns_with_the_aircraft_is_not_felt() -> None:
    rates = (0.01, 0.0, -0.01)  # a pitch rate is, as a rate of alpha
    b, c = AIRFRAME.span_m, AIRFRAME.chord_m
    w_B = np.array([1.0, -1.0, -1.0]) * np.array(rates) * 2.0 * V / np.array([b, c, b])
    np.testing.assert_allclose(in_stability_axes(rates_s=rates, air_rotation_B=w_B), in_stability_axes(), atol=1e-15)
    assert in_stability_axes(air_rotation_B=np.array([0.1, 0.0, 0.0]))[3] > 1e-4  # rolls to the right with the air


def test_gradient_of_the_air_pitches_it_by_what_the_tail_feels_and_not_by_the_downwashs_lag() -> None:
    """Upwash that grows forward is air that pitches up: felt as a nose that pitches down, without a rate of alpha."""
    c, q = AIRFRAME.chord_m, 0.004
    air = np.array([0.0, -q * 2.0 * V / c, 0.0])  # nose up is about -y
    felt = in_stability_axes(air_rotation_B=air) - in_stability_axes()
    assert felt[[2, 4]] == pytest.approx([-4.1 * q, 14.9 * q], abs=1e-12)


def test_beyond_its_range_the_flow_angles_hold() -> None:
    """At both ends of either."""
    for end, beyond in zip(AIRFRAME.angle_of_attack_ends_rad, (-0.2, 0.2), strict=True):
        held, at_end = in_stability_axes(end + beyond), in_stability_axes(end)
        np.testing.assert_allclose(held[[0, 2, 4]], at_end[[0, 2, 4]], atol=1e-12)
    for side in (-AIRFRAME.sideslip_end_rad, AIRFRAME.sideslip_end_rad):
        held, at_end = in_stability_axes(0.0, np.sign(side) * 0.5), in_stability_axes(0.0, side)
        np.testing.assert_allclose(held[[1, 3, 5]], at_end[[1, 3, 5]])


def test_at_rest_there_is_no_force_to_speak_of_and_no_division_by_the_airspeed() -> None:
    """What is left is that of 1 mm/s."""
    still = np.zeros(3)
    np.testing.assert_allclose(MODEL.force_and_moment(still, still, still), 0.0, atol=1e-3)


def test_it_is_the_smaller_the_lighter_and_the_slower_one() -> None:
    fighter = load_parameters("airframe", AirframeParameters)
    assert AIRFRAME.mass_kg < 0.5 * fighter.mass_kg
    assert AIRFRAME.wing_area_m2 < fighter.wing_area_m2
    air = standard_atmosphere(3000.0)
    slow = level_trim(AIRFRAME, 80.0, air)  # where the other one is near its stall, with 20 degrees
    assert np.degrees(slow.alpha_rad) < 8.0 < np.degrees(level_trim(fighter, 80.0, air).alpha_rad)


def test_trim_at_its_flight_condition_is_the_polars() -> None:
    """120 m/s at 3000 m: CL from the weight, drag from the polar, both to first order in the small thrust's lift."""
    air = standard_atmosphere(3000.0)
    trim = level_trim(AIRFRAME, 120.0, air)
    qbar_S = 0.5 * air.density_kg_m3 * 120.0**2 * AIRFRAME.wing_area_m2
    lift = AIRFRAME.mass_kg * STANDARD_GRAVITY_M_S2 / qbar_S
    assert trim.thrust_n == pytest.approx(qbar_S * (0.02 + 0.0642 * lift**2), rel=2e-3)
    # Cm = 0 and CL = lift solved by hand for alpha and elevator
    alpha, elevator = np.linalg.solve([[5.15, 0.5], [-0.7, -1.12]], [lift - 0.2, -0.025])
    assert (trim.alpha_rad, trim.elevator_rad) == pytest.approx((alpha, elevator), abs=2e-4)
    assert flow_angles(trim.R_WB.T @ [120.0, 0.0, 0.0])[1] == pytest.approx(trim.alpha_rad)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), [(120.0, 3000.0), (180.0, 6000.0)])
def test_its_modes_are_those_of_the_textbooks_approximations(airspeed_m_s: float, altitude_m: float) -> None:
    """Short period from M_alpha and M_q, roll from L_p, Dutch roll from N_beta, phugoid from Lanchester.

    The pitch damping slows the phugoid down as much as it quickens the short period.
    """
    air = standard_atmosphere(altitude_m)
    trim = level_trim(AIRFRAME, airspeed_m_s, air)
    model = linear_model(AIRFRAME, trim)
    Ixx, Iyy, Izz, _ = AIRFRAME.inertia_kg_m2
    q, S, b, c = 0.5 * air.density_kg_m3 * airspeed_m_s**2, AIRFRAME.wing_area_m2, AIRFRAME.span_m, AIRFRAME.chord_m
    M_alpha, M_q = -0.7 * q * S * c / Iyy, -21.85 * q * S * c * c / (2.0 * airspeed_m_s * Iyy)
    Z_alpha = -5.15 * q * S / (AIRFRAME.mass_kg * airspeed_m_s)
    short, slow = model.longitudinal_roots[0], model.longitudinal_roots[3]
    assert abs(short) == pytest.approx(np.sqrt(Z_alpha * M_q - M_alpha), rel=0.05)
    assert -2.0 * short.real == pytest.approx(-(Z_alpha + M_q), rel=0.05)
    stiff = np.sqrt(-M_alpha / (Z_alpha * M_q - M_alpha))
    assert abs(slow) == pytest.approx(stiff * np.sqrt(2.0) * 9.80665 / airspeed_m_s, rel=0.05)
    L_p = -0.442 * q * S * b * b / (2.0 * airspeed_m_s * Ixx)
    real = np.sort([root.real for root in model.lateral_roots if root.imag == 0.0])
    assert real[0] == pytest.approx(L_p, rel=0.1)
    dutch = next(root for root in model.lateral_roots if root.imag > 0.0)
    assert abs(dutch) == pytest.approx(np.sqrt(0.1106 * q * S * b / Izz), rel=0.1)
    assert np.all(model.lateral_roots.real < 1e-9) and np.all(model.longitudinal_roots.real < 0.0)


STEP_S = 2e-3


def flown(sheet: str, airspeed_m_s: float, altitude_m: float, command: Command, seconds: float) -> np.ndarray:
    """(n, 3) velocity of the probe's tip, flown as a free rigid body in still air."""
    probe_B = np.array(read_sheet("mounting_unmanned")["probe_tip_m"].value)
    receiver = Receiver(
        airframe=AIRFRAME,
        flight_control=load_parameters(sheet, FlightControlParameters, {"inertial_velocity_sigma_m_s": 0.0}),
        probe_B=probe_B,
        airspeed_m_s=airspeed_m_s,
        air=standard_atmosphere(altitude_m),
        step_s=STEP_S,
        rng=np.random.default_rng(3),
    )
    R, v, w = receiver.trim_R_WB.copy(), np.zeros(3), np.zeros(3)
    felt = R.T @ [0.0, 0.0, STANDARD_GRAVITY_M_S2]
    log = np.empty((round(seconds / STEP_S), 3))
    for k in range(len(log)):
        force, torque = receiver.step(
            R_WB=R,
            v_WB=v,
            w_WB_B=w,
            air_velocity_W=np.array([-airspeed_m_s, 0.0, 0.0]),
            specific_force_B=felt,
            command=command(k * STEP_S, R),
        )
        felt = R.T @ force / receiver.mass_kg
        v = v + STEP_S * (force / receiver.mass_kg - [0.0, 0.0, STANDARD_GRAVITY_M_S2])
        w = w + STEP_S * np.linalg.solve(receiver.inertia_B, R.T @ torque - np.cross(w, receiver.inertia_B @ w))
        R = np.ascontiguousarray(R @ exp(w * STEP_S))
        log[k] = v + R @ np.cross(w, probe_B)
    return log


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), [(120.0, 3000.0), (180.0, 6000.0)])
def test_the_flight_control_of_the_fighter_flies_it_too(airspeed_m_s: float, altitude_m: float) -> None:
    """Its gains are designed on the airframe that flies: steps of the probe's tip by 1 m/s to the left and up."""
    step = ReceiverCommand(velocity_m_s=np.array([0.0, 1.0, 1.0]))
    log = flown("flight_control", airspeed_m_s, altitude_m, lambda t, R: step, 8.0)
    assert np.all(log[:, 1:].max(axis=0) < 1.1)
    np.testing.assert_allclose(log[-1], [0.0, 1.0, 1.0], atol=0.05)


@pytest.mark.parametrize(("hertz", "size_m_s", "least"), [(0.35, 0.6, 0.9), (0.5, 0.4, 0.85)])
def test_its_own_flight_control_swings_the_tip_with_a_drogue_and_no_wider(
    hertz: float, size_m_s: float, least: float
) -> None:
    """To the left in level axes, a third of a second late and nearly a pure swing.

    A response wider than its command, as of weights that ask for more haste than the ailerons have, makes it and a
    guidance that reckons with a delay alone sway about the drogue.
    """
    w = 2.0 * np.pi * hertz

    def command(t: float, R_WB: np.ndarray) -> ReceiverCommand:
        velocity = R_WB.T @ [0.0, size_m_s * np.sin(w * t), 0.0]
        rate = R_WB.T @ [0.0, size_m_s * w * np.cos(w * t), 0.0]
        return ReceiverCommand(velocity_m_s=velocity, acceleration_m_s2=rate)

    settled_s = 2.0 / hertz
    left = flown("flight_control_unmanned", 120.0, 3000.0, command, settled_s + 1.0 / hertz)[:, 1]
    phase = w * STEP_S * np.arange(1, len(left) + 1)
    last = phase > w * settled_s
    waves = np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(phase)])[last]
    sine, cosine, _ = found = np.linalg.lstsq(waves, left[last], rcond=None)[0]
    assert least < np.hypot(sine, cosine) / size_m_s < 1.02
    assert -np.arctan2(cosine, sine) / w == pytest.approx(0.32, abs=0.04)
    assert np.std(left[last] - waves @ found) < 0.05 * size_m_s
