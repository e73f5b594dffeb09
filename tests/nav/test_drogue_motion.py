"""Prediction of the drogue's swing."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from dockair.nav.guidance.drogue_motion import DrogueMotion
from dockair.nav.guidance.swing_model import HoseMode, SwingSettings, dynamics

PLACE_ROW = np.array([1.0, 0.0] * 4 + [0.0])
STEP_S, LEAD_S = 0.01, np.array([0.4, 0.17, 0.14])
CALM = STILL = np.zeros(3)
SWING = SwingSettings(  # alone, for what has a closed form for one mode only
    modes=(HoseMode(frequency_hz=(0.44, 0.31, 0.45), damping=(0.5, 0.05, 0.12), gust_density=(0.7, 3.0, 7.0)),),
    gust_time_s=(1.2, 0.7, 1.2),
    rattle_density=(0.0,) * 3,
)


class OneHose:
    """The filter of a single hose."""

    def __init__(self, settings, *rest):
        self._of_hoses = DrogueMotion((settings,), *rest)

    def __getattr__(self, name):
        found = getattr(self._of_hoses, name)
        return found[0] if isinstance(found, np.ndarray) else lambda *given: _first(found(*given))


def _first(of_hoses):
    return None if of_hoses is None else of_hoses[0]


def follow(path, rate, seconds):
    """Feed exact places, and the rate at the start; return time and filter at the end."""
    motion = OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1)
    motion.start(path(0.0), rate(0.0))
    for k in range(1, round(seconds / STEP_S) + 1):
        motion.step(path(k * STEP_S), CALM, STILL)
    return seconds, motion


def test_known_modes_are_continued_by_their_closed_form():
    """s = 0.1 exp(-zeta omega t) cos(omega_d t) of each, the free response of Eq. (1), with its first derivatives."""
    settings, t = SwingSettings(), 0.7
    omega = 2.0 * np.pi * np.array([mode.frequency_hz for mode in settings.modes])
    zeta = np.array([mode.damping for mode in settings.modes])
    pole = -zeta * omega + 1j * omega * np.sqrt(1.0 - zeta**2)
    motion = OneHose(settings, STEP_S, LEAD_S, 0.1)
    for n in (0, 1):
        motion._x[:, 2 + n : -1 : 2] = (0.1 * pole**n * np.exp(pole * t)).real.T
    for n, predicted in enumerate(motion.ahead(CALM, CALM)):
        expected = (0.1 * pole**n * np.exp(pole * (t + LEAD_S))).real.sum(axis=0)
        np.testing.assert_allclose(predicted, expected, atol=1e-11)


def test_the_path_of_known_modes_is_their_sum():
    settings, t, node_s = SwingSettings(), 0.7, 0.1
    omega = 2.0 * np.pi * np.array([mode.frequency_hz for mode in settings.modes])
    zeta = np.array([mode.damping for mode in settings.modes])
    pole = -zeta * omega + 1j * omega * np.sqrt(1.0 - zeta**2)
    motion = OneHose(settings, STEP_S, LEAD_S, node_s)
    for n in (0, 1):
        motion._x[:, 2 + n : -1 : 2] = (0.1 * pole**n * np.exp(pole * t)).real.T
    nodes = t + LEAD_S + node_s * np.arange(1, 6)[:, np.newaxis]
    expected = (0.1 * np.exp(pole[:, np.newaxis] * nodes)).real.sum(axis=0)
    np.testing.assert_allclose(motion.path(np.zeros((7, 3))), expected, atol=1e-11)


def test_what_was_known_of_the_drift_stays_known_where_the_swing_is_begun_anew():
    """At rest for 20 s, then seen again in a swing of 2 m: as a drift that is not known, 0.8 m/s were learnt."""
    omega, up, most = 2.0 * np.pi * SwingSettings().modes[0].frequency_hz[2], np.array([0.0, 0.0, 1.0]), {}
    for sigma_m_s in (SwingSettings().drift_kept_sigma_m_s, SwingSettings().drift_sigma_m_s):
        motion = OneHose(replace(SwingSettings(), drift_kept_sigma_m_s=sigma_m_s), STEP_S, LEAD_S, 0.1)
        motion.start(CALM, CALM)
        for _ in range(2000):
            motion.step(CALM, CALM, STILL)
        motion.resume(CALM)
        drifts = []
        for t in np.arange(200) * STEP_S:
            motion.step(2.0 * np.sin(omega * t) * up, CALM, STILL)
            drifts.append(abs(motion.drift_m_s[2]))
        most[sigma_m_s] = max(drifts)
    kept, unknown = most.values()
    assert kept < 0.1 and unknown > 0.6


def test_begun_anew_at_a_place_nothing_is_left_of_the_swing_and_the_drift_is_as_it_was():
    motion, rng, place = (
        OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1),
        np.random.default_rng(6),
        np.array([4.0, 1.0, -2.0]),
    )
    motion._x[:] = rng.standard_normal(motion._x.shape)
    drift = motion.drift_m_s
    motion.resume(place)
    np.testing.assert_allclose(motion.ahead(CALM, CALM), [place + LEAD_S * drift, drift, np.zeros(3)], atol=1e-12)


def test_a_steady_drift_is_predicted_without_error_and_told_from_the_swing():
    drift = np.array([-0.1, 0.2, -0.1])
    t, motion = follow(lambda t: drift * t, lambda t: drift, 40.0)
    place, velocity, _ = motion.ahead(CALM, CALM)
    np.testing.assert_allclose(place, drift * (t + LEAD_S), atol=2e-3)
    np.testing.assert_allclose(velocity, drift, atol=2e-3)
    np.testing.assert_allclose(motion.drift_m_s, drift, atol=5e-3)


def test_the_middle_of_a_swing_is_where_it_swings_about():
    omega, middle = 2.0 * np.pi * np.array(SwingSettings().modes[0].frequency_hz), np.array([5.0, 1.0, -2.0])
    _, motion = follow(lambda t: middle + 0.3 * np.sin(omega * t), lambda t: 0.3 * omega * np.cos(omega * t), 40.0)
    place, velocity, acceleration = motion.mean_ahead()
    np.testing.assert_allclose(place, middle, atol=0.2)  # of 0.3 m either way, drift and swing being hard to tell apart
    np.testing.assert_allclose(velocity, 0.0, atol=0.25)  # of 0.85 m/s
    assert not acceleration.any()


def test_a_push_that_is_known_is_part_of_the_prediction():
    """From rest, b growing from 1 to 3 m/s^2 over the lead: tau^2 (1/3 + 3/6) of way, tau 2 of velocity."""
    motion = OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1)
    place, velocity, acceleration = motion.ahead(np.full(3, 1.0), np.full(3, 3.0))
    np.testing.assert_allclose(place, LEAD_S**2 * (1.0 / 3.0 + 0.5), rtol=1e-12)
    np.testing.assert_allclose(velocity, 2.0 * LEAD_S, rtol=1e-12)
    np.testing.assert_allclose(acceleration, 3.0, rtol=1e-12)
    node_s = 1e-6  # the path begins there
    pushes = np.repeat([1.0, 3.0, 3.0, 3.0], 3).reshape(-1, 3)
    path = OneHose(SwingSettings(), STEP_S, LEAD_S, node_s).path(pushes)
    np.testing.assert_allclose(path[0], place, rtol=1e-4)
    np.testing.assert_allclose((path[1] - path[0]) / node_s, velocity, rtol=1e-4)


def test_a_steady_push_bends_the_swing_by_its_own_stiffness():
    motion = OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1)
    push = np.array([0.0, 0.5, -0.3])
    for _ in range(12_000):
        motion.step(None, push, STILL)
    omega = 2.0 * np.pi * np.array(SwingSettings().modes[0].frequency_hz)
    np.testing.assert_allclose(motion._x[:, 2], push / omega**2, rtol=1e-3, atol=1e-9)


def test_prediction_is_as_good_as_its_own_covariance_says():
    """Place simulated from Eq. (1) with the settings' densities: the error's variance is the Riccati equation's.

    P over the lead time is e^(A tau) P e^(A' tau) plus what the noise adds; P is computed here by iteration. Errors
    are correlated over about a second: 600 s give some 600 independent ones an axis, 5 sigma of their variance 29 %.
    """
    settings, rng, ticks, states = SwingSettings(), np.random.default_rng(2), 60_000, 9
    place, sigmas = PLACE_ROW, np.array(settings.position_sigma_m)
    lead, F, expected = np.round(LEAD_S / STEP_S).astype(int), [], []
    densities = np.zeros((3, states))
    densities[:, 1], densities[:, 8] = settings.drift_density, 1.0
    densities[:, 3:8:2] = np.array(settings.rattle_density)[:, np.newaxis]
    for axis in range(3):
        F.append(expm(dynamics(settings, axis) * STEP_S))
        Q, P = np.diag(densities[axis] ** 2) * STEP_S, np.eye(states)
        for _ in range(6000):
            P = F[-1] @ P @ F[-1].T + Q
            P = P - np.outer(P @ place, P @ place) / (place @ P @ place + sigmas[axis] ** 2)
        for _ in range(lead[axis]):
            P = F[-1] @ P @ F[-1].T + Q
        expected.append(place @ P @ place)
    x, true, motion, predicted = np.zeros((3, states)), [], OneHose(settings, STEP_S, LEAD_S, 0.1), []
    for _ in range(ticks):
        kick = np.sqrt(STEP_S) * densities * rng.standard_normal((3, states))
        x = np.stack([F[i] @ x[i] for i in range(3)]) + kick
        motion.step(x @ place + rng.standard_normal(3) * sigmas, CALM, STILL)
        true.append(x @ place)
        predicted.append(motion.ahead(CALM, CALM)[0])
    true, predicted = np.array(true), np.array(predicted)
    for axis, n in enumerate(lead):
        error = true[n + 2000 :, axis] - predicted[2000:-n, axis]
        np.testing.assert_allclose(np.mean(error**2), expected[axis], rtol=0.29)
        assert np.std(error) < np.std(true[n:, axis] - true[:-n, axis])


def test_what_the_tip_feels_is_part_of_the_prediction():
    """Up, each mode's rate changes at once by its share of what was felt, and a gust that goes on, by its own."""
    settings, felt = SwingSettings(), np.array([0.3, 0.2, 0.1])
    motion, axis = OneHose(settings, STEP_S, np.full(3, 0.3), 0.1), 2
    motion.step(None, CALM, felt)
    omega = np.array([2.0 * np.pi * mode.frequency_hz[axis] for mode in settings.modes])
    zeta = np.array([mode.damping[axis] for mode in settings.modes])
    share = np.array([mode.felt_share[axis] for mode in settings.modes])
    density = np.array([mode.gust_density[axis] for mode in settings.modes])
    gust, T = settings.gust_felt_share[axis] * felt[axis], settings.gust_time_s[axis]

    def derivative(t, x):
        s, rate = x[:3], x[3:]
        return [*rate, *(density * gust * np.exp(-t / T) - omega**2 * s - 2.0 * zeta * omega * rate)]

    begun = [0.0, 0.0, 0.0, *(share * felt[axis])]
    expected = solve_ivp(derivative, (0.0, STEP_S + 0.3), begun, rtol=1e-11, atol=1e-13).y[:3, -1]
    place, _, _ = motion.ahead(CALM, CALM)
    np.testing.assert_allclose(place, [0.0, 0.0, expected.sum()], atol=1e-11)
    assert abs(expected).max() > 1e-3


def test_a_hose_that_is_stretched_less_swings_more_slowly():
    """Across; forward there is the reel. Nothing changes at the dynamic pressure of 180 m/s and 6000 m."""
    fitted, slow = SwingSettings(), SwingSettings().at(0.5 * 0.9093 * 120.0**2)
    for mode, slower in zip(fitted.modes, slow.modes, strict=True):
        assert slower.frequency_hz[0] == mode.frequency_hz[0]
        np.testing.assert_allclose(slower.frequency_hz[1:], 0.822 * np.array(mode.frequency_hz[1:]), rtol=2e-3)
    np.testing.assert_allclose(
        [mode.frequency_hz for mode in fitted.at(0.5 * 0.6601 * 180.0**2).modes],
        [mode.frequency_hz for mode in fitted.modes],
        rtol=1e-3,
    )


def test_it_learns_a_large_drift_within_two_swings():
    """At the start the filter knows that it does not know the drift yet."""
    omega, drift = 2.0 * np.pi * 0.33, np.array([0.2, -0.3, 0.3])
    t, motion = follow(
        lambda t: drift * t + 0.2 * np.sin(omega * t), lambda t: drift + 0.2 * omega * np.cos(omega * t), 6.0
    )
    np.testing.assert_allclose(motion.drift_m_s, drift, atol=0.12)
    place, _, _ = motion.ahead(CALM, CALM)
    error = place - drift * (t + LEAD_S) - 0.2 * np.sin(omega * (t + LEAD_S))
    assert (np.abs(error) < 0.12 * LEAD_S / LEAD_S[0] + 0.005).all()  # a third of the drift's share left would be more


def test_unseen_it_goes_on_by_the_model():
    motion = OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1)
    motion._x[:, 0], motion._x[:, 1] = 1.0, 0.1
    for _ in range(100):
        motion.step(None, CALM, STILL)
    for place, velocity, _ in (motion.ahead(CALM, CALM), motion.mean_ahead()):
        np.testing.assert_allclose(place, 1.0 + 0.1 * (1.0 + LEAD_S), atol=1e-9)
        np.testing.assert_allclose(velocity, 0.1, atol=1e-9)


def test_the_path_goes_on_from_the_prediction_by_the_swing_s_own_equation():
    """Against scipy's integration of Eq. (1) with a push that changes steadily between the nodes."""
    settings, node_s, axis = SWING, 0.1, 1
    motion = OneHose(settings, STEP_S, LEAD_S, node_s)
    motion.start(np.array([4.0, 0.1, -0.2]), np.array([0.0, 0.4, 0.3]))
    for k in range(300):
        t = k * STEP_S
        motion.step(np.array([4.0, 0.2 * np.sin(2.0 * t), 0.0]), CALM, STILL)
    push = np.zeros((12, 3))
    push[1:, axis] = np.linspace(0.0, 3.0, 11)
    swing, T = settings.modes[0], settings.gust_time_s[axis]
    omega, zeta, q = 2 * np.pi * swing.frequency_hz[axis], swing.damping[axis], swing.gust_density[axis]

    def derivative(t, x):
        b = np.interp(t, LEAD_S[axis] + node_s * np.arange(11), push[1:, axis])
        return [x[1], 0.0, x[3], -(omega**2) * x[2] - 2 * zeta * omega * x[3] + q * x[4] + b, -x[4] / T]

    times = LEAD_S[axis] + node_s * np.arange(1, 11)
    exact = solve_ivp(
        derivative, (0.0, times[-1]), motion._x[axis], t_eval=times, rtol=1e-10, atol=1e-12, max_step=0.02
    ).y
    assert np.allclose(motion.path(push)[:, axis], exact[0] + exact[2], atol=2e-3)  # the mean of a node is held


def test_the_mean_path_is_the_drift_alone():
    motion = OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1)
    motion.start(np.array([4.0, 0.0, 0.0]), np.zeros(3))
    for k in range(3000):
        motion.step(np.array([4.0, 0.2 * k * STEP_S, 0.0]), CALM, STILL)
    expected = 0.2 * (2999 * STEP_S + LEAD_S[1] + 0.1 * np.arange(1, 6))
    assert np.allclose(motion.mean_path(5)[:, 1], expected, atol=5e-3)


def test_the_middle_of_the_swing_is_told_from_the_place():
    """A swing of 0.4 m across about 1.0 m: within half a minute the middle is known to a third of it."""
    omega = 2 * np.pi * np.array(SwingSettings().modes[0].frequency_hz)
    for seconds in np.arange(30.0, 34.0, 0.4):  # at any moment of the swing
        _, motion = follow(lambda t: 1.0 + 0.4 * np.sin(omega * t), lambda t: 0.4 * omega * np.cos(omega * t), seconds)
        assert np.abs(motion.middle_m - 1.0)[1:].max() < 0.4 / 3.0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_filter_answers_as_fast_at_another_control_rate(axis):
    """Poles of its error, (I - K H) F, as rates [1/s]: the noise of what is seen is white, not one of ticks."""

    def poles_1_s(hz):
        motion = OneHose(SwingSettings(), 1.0 / hz, LEAD_S, 0.1)
        for _ in range(60 * hz):
            motion.step(CALM, CALM, STILL)
        P = motion._P[axis]
        K = P @ PLACE_ROW / (PLACE_ROW @ P @ PLACE_ROW + motion._R[axis])
        error = (np.eye(9) - np.outer(K, PLACE_ROW)) @ motion._F[axis]
        return np.sort(np.abs(np.log(np.linalg.eigvals(error)) * hz))

    for hz in (50, 180):
        np.testing.assert_allclose(poles_1_s(hz), poles_1_s(100), rtol=0.01)


def test_with_gaps_it_is_the_kalman_filter_of_another_program():
    """filterpy's, over 20 s of which a third is seen, in glimpses of any length, with a push and with what is felt.

    Of places that scatter by 0.1 m and are told to be known to 1 mm both lose digits, filterpy's more: 2 and 20 mm.
    """
    settings, rng = replace(SwingSettings(), position_sigma_m=(0.02, 0.002, 0.002)), np.random.default_rng(4)
    motion, others = OneHose(settings, STEP_S, LEAD_S, 0.1), []
    motion.start(np.array([4.0, 0.1, -0.2]), np.array([0.0, 0.4, 0.3]))
    for axis in range(3):
        other = KalmanFilter(dim_x=9, dim_z=1, dim_u=1)
        other.F, other.Q, other.B = motion._F[axis], motion._Q[axis], motion._pushed[axis][:, np.newaxis]
        other.H, other.R = PLACE_ROW[np.newaxis], motion._R[axis]
        other.x, other.P = motion._x[axis][:, np.newaxis].copy(), motion._P[axis].copy()
        others.append(other)
    seen = False
    for k in range(2000):
        seen = rng.random() < 0.1 if not seen else rng.random() < 0.8
        place, push, felt = rng.standard_normal((3, 3)) * [[0.1], [0.5], [0.02]]
        motion.step(place if seen else None, push, felt)
        for axis, other in enumerate(others):
            other.x[3:8:2, 0] += [mode.felt_share[axis] * felt[axis] for mode in settings.modes]
            other.x[8, 0] += settings.gust_felt_share[axis] * felt[axis]
            if k > 0:
                other.P = other.F @ other.P @ other.F.T + other.Q
            other.x = other.F @ other.x + other.B * push[axis]
            if seen:
                other.update(place[axis])
        np.testing.assert_allclose(motion._x, [other.x[:, 0] for other in others], rtol=1e-7, atol=1e-9)


def test_a_drogue_that_whips_about_and_is_seen_in_glimpses_does_not_lead_it_far_away():
    """Places a metre about that no model foresees, in glimpses: gains of steady sight made 250 km of them."""
    rng = np.random.default_rng(5)
    motion, farthest = OneHose(SwingSettings(), STEP_S, LEAD_S, 0.1), 0.0
    motion.start(np.array([4.0, 0.0, 0.0]), np.zeros(3))
    for _ in range(100):
        place = [4.0, 0.0, 0.0] + rng.uniform(-1.0, 1.0, 3)
        for k in range(40):
            glimpsed = k < rng.integers(1, 4)
            motion.step(place if glimpsed else None, CALM, STILL)
        farthest = max(farthest, float(np.abs(motion.middle_m - [4.0, 0.0, 0.0]).max()))
    assert farthest < 10.0
