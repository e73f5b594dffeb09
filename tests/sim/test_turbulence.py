"""Dryden gusts against their closed forms. Every statistical test fails by luck less than once in 10^5 runs."""

import copy

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.stats import chi2, norm

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters, gust_sigma, rolling_sigma

L, V, SIGMA, SPAN = 533.4, 180.0, 1.3, 9.144
FALSE_ALARM = 1e-5
STREAM = 5


def parameters(**changed: float) -> TurbulenceParameters:
    values = {"sigma_m_s": SIGMA, "length_scale_m": L, "knot_spacing_m": 0.05, "front_m": 40.0, "extent_m": 60.0}
    return TurbulenceParameters(**{**values, **changed})


def field_of(
    seed: int | tuple[int, ...],
    *,
    step_s: float = 1e-3,
    airspeed_m_s: float = V,
    span_m: float | None = SPAN,
    **changed: float,
) -> DrydenField:
    return DrydenField(parameters(**changed), airspeed_m_s, step_s, np.random.default_rng(seed), span_m)


def correlation(distance_m: np.ndarray, axis: int) -> np.ndarray:
    """Of u, v, w, p with itself a distance away."""
    d = np.asarray(distance_m) / L
    if axis == 3:
        return np.asarray(np.exp(-np.asarray(distance_m) * np.pi / (4.0 * SPAN)))
    return np.asarray(np.exp(-d) * (1.0 if axis == 0 else 1.0 - 0.5 * d))


def spectrum(axis: int, W: np.ndarray) -> np.ndarray:
    """MIL-F-8785C, one-sided over the spatial frequency W [rad/m], for a sigma of 1 m/s."""
    y = (L * np.asarray(W)) ** 2
    if axis == 0:
        return np.asarray(2.0 * L / np.pi / (1.0 + y))
    if axis == 3:
        form = 0.8 * (np.pi * L / (4.0 * SPAN)) ** (1.0 / 3.0) / (1.0 + (4.0 * SPAN * np.asarray(W) / np.pi) ** 2)
        return np.asarray(form / L)
    return np.asarray(L / np.pi * (1.0 + 3.0 * y) / (1.0 + y) ** 2)


def record(field: DrydenField, spacing_m: float, count: int) -> np.ndarray:
    """(count, 4) u, v, w, p side by side, at places of one moment; the field must be that long."""
    x = 40.0 - spacing_m * np.arange(count)
    return np.column_stack([field.velocity(x), [field.rolling(place) for place in x]])


def ensemble(count: int, x: np.ndarray, steps: int = 0, **changed: float) -> np.ndarray:
    """(count, n, 4) gusts of as many independent fields."""
    gusts = np.empty((count, len(x), 4))
    for i in range(count):
        field = field_of((STREAM, i), step_s=0.1, **changed)
        for _ in range(steps):
            field.step()
        gusts[i, :, :3], gusts[i, :, 3] = field.velocity(x), [field.rolling(place) for place in x]
    return gusts


@pytest.mark.parametrize("steps", [0, 7])
def test_every_component_has_its_variance_from_the_first_tick_on(steps: int) -> None:
    """N independent fields: N s^2 / sigma^2 is chi2(N). In feet it would be ten times as much."""
    count = 800
    scale = np.array([SIGMA, SIGMA, SIGMA, rolling_sigma(SIGMA, L, SPAN)])
    squares = np.sum((ensemble(count, np.array([40.0]), steps)[:, 0] / scale) ** 2, axis=0)
    low, high = chi2.ppf([FALSE_ALARM / 16, 1.0 - FALSE_ALARM / 16], count)
    assert np.all((low < squares) & (squares < high))


@pytest.mark.parametrize("intensity", ["light", "moderate", "severe"])
def test_variance_of_a_long_record_is_that_of_the_specification_within_two_per_cent(intensity: str) -> None:
    """120 000 lengths L of air: the variance's standard error is sqrt(2 L / X) = 0.41 % for u, 0.32 % for v and w, and
    0.32 % for p over 200 000 places; twelve comparisons within 2 %, 4.9 standard errors, fail once in 10^6 runs.
    The knots are exact at any distance, so they may be 20 m apart."""
    sigma_m_s, spacing_m, chunk = gust_sigma(intensity, 6096.0), 20.0, 20_000
    field = field_of(
        (7, len(intensity)), step_s=chunk * spacing_m / V, sigma_m_s=sigma_m_s, knot_spacing_m=spacing_m,
        extent_m=chunk * spacing_m,
    )  # fmt: skip
    x, squares, rolling = 40.0 - spacing_m * np.arange(chunk), np.zeros(3), 0.0
    places, chunks = x[:1250], 160
    for _ in range(chunks):
        field.step()
        squares += np.sum(field.velocity(x) ** 2, axis=0) / (chunk * chunks)
        rolling += sum(field.rolling(place) ** 2 for place in places) / (len(places) * chunks)
    np.testing.assert_allclose(squares, sigma_m_s**2, rtol=0.02)
    assert rolling == pytest.approx(rolling_sigma(sigma_m_s, L, SPAN) ** 2, rel=0.02)


def test_gusts_a_distance_apart_correlate_as_the_dryden_form_says_and_the_components_not_at_all() -> None:
    """For Gaussian a, b the mean of N products has the variance (R_aa R_bb + R_ab^2) / N; 112 comparisons."""
    count = 1200
    x = 40.0 - np.array([0.0, 3.0, 12.0, 45.0, 180.0, 540.0, 720.0])
    scale = np.array([SIGMA, SIGMA, SIGMA, rolling_sigma(SIGMA, L, SPAN)])
    gusts = ensemble(count, x, extent_m=800.0, knot_spacing_m=1.0) / scale
    bound = norm.ppf(1.0 - FALSE_ALARM / 2 / 112)
    for a in range(4):
        for b in range(4):
            expected = correlation(x[0] - x, a) if a == b else np.zeros(len(x))
            measured = np.mean(gusts[:, :1, a] * gusts[:, :, b], axis=0)
            sigma = np.sqrt((1.0 + expected**2) / count)
            assert np.all(np.abs(measured - expected) < bound * sigma), (a, b)


def freedom(expected: np.ndarray, segments: int) -> float:
    """Degrees of freedom of a sum of Hann periodograms' neighbouring bins: their power correlates by (2/3)^2, 1/6^2."""
    variance = np.sum(expected**2)
    for apart, correlated in ((1, (2.0 / 3.0) ** 2), (2, (1.0 / 6.0) ** 2)):
        variance += 2.0 * correlated * np.sum(expected[apart:] * expected[:-apart])
    return float(2.0 * segments * np.sum(expected) ** 2 / variance)


@pytest.mark.parametrize(("axis", "spacing_m"), [(0, 4.0), (1, 4.0), (2, 4.0), (3, 0.5)])
def test_power_in_bands_is_that_of_the_published_spectrum_inside_chi2_bounds(axis: int, spacing_m: float) -> None:
    """Periodograms with a Hann window; sampling folds the published spectrum about multiples of its frequency, which
    is added up to the point where 0.1 % is left. Eight bands, from five bins to the Nyquist frequency."""
    size, segments = 4096, 24
    changed = {"knot_spacing_m": spacing_m, "sigma_m_s": 1.0, "extent_m": spacing_m * size * segments}
    gusts = record(field_of(17, **changed), spacing_m, size * segments)[:, axis].reshape(segments, size)
    window = np.hanning(size)
    power = np.mean(np.abs(np.fft.rfft(gusts * window, axis=1)) ** 2, axis=0)
    power *= spacing_m / (np.pi * np.sum(window**2))  # one-sided density over rad/m
    W = 2.0 * np.pi * np.fft.rfftfreq(size, spacing_m)
    images = np.abs(W + 2.0 * np.pi / spacing_m * np.arange(-400, 401)[:, None])
    folded = spectrum(axis, images).sum(axis=0)
    edges = np.unique(np.geomspace(5, size // 2, 9).astype(int))
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        expected = folded[low:high]
        n = freedom(expected, segments)
        bounds = chi2.ppf([FALSE_ALARM / 16, 1.0 - FALSE_ALARM / 16], n) / n
        assert bounds[0] < np.sum(power[low:high]) / np.sum(expected) < bounds[1], (low, high)


@pytest.mark.parametrize("axis", [0, 1, 2, 3])
def test_strength_is_the_integral_of_the_published_spectrum(axis: int) -> None:
    published = quad(lambda log: float(spectrum(axis, np.exp(log)) * np.exp(log)), -25.0, 25.0, limit=400)[0]
    ours = rolling_sigma(1.0, L, SPAN) if axis == 3 else 1.0
    assert ours**2 == pytest.approx(published, rel=1e-8)


@pytest.mark.parametrize("distance", [1e-5, 9.4e-5, 0.01, 0.7, 5.0])
def test_step_from_knot_to_knot_keeps_the_stationary_covariance_of_the_forming_filter(distance: float) -> None:
    """Phi by expm, P by Lyapunov's equation: two other programs. A difference of nearly equal matrices, hence atol."""
    from dockair.sim.air import turbulence

    k = turbulence._knot_coefficients(parameters(knot_spacing_m=distance * L), None)
    A, B = np.array([[0.0, 1.0], [-1.0, -2.0]]), np.array([[0.0], [1.0]])
    P, Phi = solve_continuous_lyapunov(A, -B @ B.T), expm(A * distance)
    G = np.array([[k[turbulence._G_11], 0.0], [k[turbulence._G_21], k[turbulence._G_22]]])
    ours = k[turbulence._V_11 : turbulence._V_22 + 1].reshape(2, 2)
    np.testing.assert_allclose(ours, Phi, rtol=1e-12)
    np.testing.assert_allclose(G @ G.T, P - Phi @ P @ Phi.T, rtol=1e-9, atol=2e-16)
    if distance < 1e-3:  # leading terms of the integrals of Eq. (5)
        small = [[distance**3 / 3.0, distance**2 / 2.0], [distance**2 / 2.0, distance]]
        np.testing.assert_allclose(G @ G.T, small, rtol=4.0 * distance)


class OneNoise:
    """Draws nothing but one of the six noises between the first two knots."""

    def __init__(self, which: int) -> None:
        self._which, self._drawn = which, 0

    def standard_normal(self, size: int | tuple[int, int]) -> np.ndarray:
        drawn, self._drawn = np.zeros(size), self._drawn + 1
        if self._drawn == 2:  # the first are those of the start
            drawn[0, self._which] = 1.0
        return drawn


def test_noise_between_two_knots_runs_on_through_the_forming_filters_and_through_no_others() -> None:
    """Products of what all six noises leave at all knots after: Phi by expm, P by Lyapunov's equation."""
    count, span, d = 12, 200.0, 0.3
    x, dp = d * L * (np.arange(count + 1) - count), d * L * np.pi / (4.0 * span)
    size = parameters(knot_spacing_m=d * L, front_m=0.0, extent_m=count * d * L)
    made = np.empty((6, count + 1, 4))
    for which in range(6):
        field = DrydenField(size, V, 1e-3, OneNoise(which), span)  # type: ignore[arg-type]
        made[which, :, :3], made[which, :, 3] = field.velocity(x), [field.rolling(place) for place in x]
    A, B = np.array([[0.0, 1.0], [-1.0, -2.0]]), np.array([[0.0], [1.0]])
    P, Phi = solve_continuous_lyapunov(A, -B @ B.T), expm(A * d)
    G, out, k = np.linalg.cholesky(P - Phi @ P @ Phi.T), SIGMA * np.array([1.0, np.sqrt(3.0)]), np.arange(count)
    v = np.array([out @ np.linalg.matrix_power(Phi, n) @ G for n in k])
    u = SIGMA * np.sqrt(1.0 - np.exp(-2.0 * d)) * np.exp(-d * k)[:, None]
    p = rolling_sigma(SIGMA, L, span) * np.sqrt(1.0 - np.exp(-2.0 * dp)) * np.exp(-dp * k)[:, None]
    expected = np.zeros((count + 1, 4, count + 1, 4))
    for axis, left in enumerate((u, v, v, p)):
        expected[1:, axis, 1:, axis] = left @ left.T
    np.testing.assert_allclose(np.einsum("nka,nlb->kalb", made, made), expected, rtol=0.0, atol=1e-12)


def test_straight_lines_between_knots_lose_what_the_page_says_and_less_than_three_per_mille_with_the_sheet() -> None:
    """At a share s of the way the variance is (1-s)^2 + s^2 + 2 s (1-s) R(h) of the knots'."""
    h = load_parameters("turbulence", TurbulenceParameters).knot_spacing_m
    for axis, stated in ((0, h / (3.0 * L)), (1, h / (2.0 * L)), (3, h * np.pi / (12.0 * SPAN))):
        R = float(correlation(np.array(h), axis))
        loss = quad(lambda s, R=R: 2.0 * s * (1.0 - s) * (1.0 - R), 0.0, 1.0)[0]
        assert loss == pytest.approx(stated, rel=0.005)
        assert loss < 0.003


def test_gust_between_two_knots_is_on_the_straight_line() -> None:
    x = 40.0 - np.array([0.0, 2.0, 5.0, 8.0, 10.0])
    field = field_of(2, knot_spacing_m=10.0)
    gusts = field.velocity(x)
    share = np.array([0.0, 0.2, 0.5, 0.8, 1.0])
    np.testing.assert_allclose(gusts, gusts[0] + share[:, None] * (gusts[-1] - gusts[0]), rtol=0, atol=1e-12)
    rolling = np.array([field.rolling(place) for place in x])
    np.testing.assert_allclose(rolling, rolling[0] + share * (rolling[-1] - rolling[0]), rtol=0, atol=1e-12)


def test_field_is_frozen_what_meets_the_exit_meets_the_drogue_a_distance_over_airspeed_later() -> None:
    """14.76 m are 82 ticks: the two records are the same to rounding, so their coherence is 1 at every frequency."""
    ticks, delay = 400, 82
    field, distance_m = field_of(3), V * 1e-3 * 82
    exit_, drogue, rolling = np.empty((ticks, 3)), np.empty((ticks, 3)), np.empty((ticks, 2))
    for k in range(ticks):
        field.step()
        exit_[k], drogue[k] = field.velocity(np.array([0.0, -distance_m]))
        rolling[k] = field.rolling(0.0), field.rolling(-distance_m)
    np.testing.assert_allclose(drogue[delay:], exit_[:-delay], rtol=0, atol=1e-11)
    np.testing.assert_allclose(rolling[delay:, 1], rolling[:-delay, 0], rtol=0, atol=1e-12)
    assert np.ptp(exit_[:, 0]) > 0.01


def test_another_physics_rate_and_another_airspeed_meet_the_same_air() -> None:
    x = np.linspace(38.0, -18.0, 23)
    slow, fast, slower = field_of(8, step_s=4e-3), field_of(8, step_s=1e-3), field_of(8, airspeed_m_s=0.5 * V)
    for k in range(2000):
        fast.step()
        slower.step()
        slower.step()
        if k % 4 == 3:
            slow.step()
            np.testing.assert_allclose(slow.velocity(x), fast.velocity(x), rtol=0, atol=1e-9)
            np.testing.assert_allclose(slower.velocity(x), fast.velocity(x), rtol=0, atol=1e-9)
            assert slow.rolling(x[0]) == pytest.approx(fast.rolling(x[0]), abs=1e-9)


def test_gust_is_continuous_in_place_and_time_and_held_beyond_both_ends() -> None:
    field = field_of(4, extent_m=20.0)
    x = np.linspace(45.0, 15.0, 3001)  # 1 cm apart
    for _ in range(300):  # past the end of a block of knots
        along = field.velocity(x)
        field.step()
    assert np.abs(np.diff(along, axis=0)).max() < 0.2 * 8.0 * SIGMA * np.sqrt(3.0 * 0.05 / L)  # a fifth of a cell
    np.testing.assert_array_equal(along[x > 40.0], np.broadcast_to(along[0], along[x > 40.0].shape))
    np.testing.assert_array_equal(along[x < 20.0], np.broadcast_to(along[-1], along[x < 20.0].shape))
    moved = field.velocity(x) - along
    assert 0.0 < np.abs(moved).max() < 8.0 * SIGMA * np.sqrt(3.0 * (V * 1e-3 + 0.05) / L)
    assert field.rolling(50.0) == field.rolling(40.0) != field.rolling(39.0)


def test_a_field_that_reaches_farther_ahead_has_the_same_air_where_both_reach() -> None:
    """Over several blocks of knots, up to the shorter one's front: nothing is read before it is drawn."""
    x = np.array([-20.0, 3.0, 39.99, 40.0])
    short, long = field_of(12), field_of(12, front_m=90.0, extent_m=110.0)
    for _ in range(300):
        np.testing.assert_allclose(short.velocity(x), long.velocity(x), rtol=0, atol=1e-12)
        short.step()
        long.step()


def test_the_fields_end_between_two_knots_has_drawn_knots_on_either_side() -> None:
    """The line from x = -10 to the end at -17 leads on to a knot at -20 that is not 0."""
    field = field_of(13, knot_spacing_m=10.0, extent_m=57.0)
    inner, end = field.velocity(np.array([-10.0, -17.0]))
    knot = inner + (end - inner) / 0.7
    assert np.all(np.abs(knot) > 1e-6)


def test_same_seed_same_gusts_and_no_strength_no_gust() -> None:
    x = np.array([0.0, -10.0])
    one, two, still = field_of(9), field_of(9), field_of(9, sigma_m_s=0.0)
    for _ in range(20):
        for field in (one, two, still):
            field.step()
    np.testing.assert_array_equal(one.velocity(x), two.velocity(x))
    np.testing.assert_array_equal(still.velocity(x), np.zeros((2, 3)))
    assert still.rolling(0.0) == 0.0


def test_span_changes_the_rolling_gust_only_and_without_one_there_is_none() -> None:
    wide, narrow, none = field_of(9), field_of(9, span_m=4.0), field_of(9, span_m=None)
    x = np.array([0.0, -10.0])
    for _ in range(3000):
        for field in (wide, narrow, none):
            field.step()
    np.testing.assert_array_equal(wide.velocity(x), narrow.velocity(x))
    np.testing.assert_array_equal(wide.velocity(x), none.velocity(x))
    assert none.rolling(0.0) == 0.0
    assert wide.rolling(0.0) != narrow.rolling(0.0) != 0.0


def test_copy_goes_on_as_the_original_does_to_the_bit() -> None:
    x = np.linspace(40.0, -20.0, 7)
    one = field_of(10)
    for _ in range(50):
        one.step()
    two = copy.deepcopy(one)
    for _ in range(500):
        one.step()
    assert not np.array_equal(one.velocity(x), two.velocity(x))
    for _ in range(500):
        two.step()
    np.testing.assert_array_equal(one.velocity(x), two.velocity(x))


def test_wrong_strengths_altitudes_speeds_and_spans_are_refused() -> None:
    with pytest.raises(DockairError, match="exists: light, moderate, severe"):
        gust_sigma("mild", 6000.0)
    with pytest.raises(DockairError, match="from 610 to 24384 m"):
        gust_sigma("light", 300.0)
    with pytest.raises(DockairError, match="a speed > 0"):
        field_of(0, airspeed_m_s=0.0)
    with pytest.raises(DockairError, match="a span > 0"):
        field_of(0, span_m=-1.0)


def test_the_sheet_fills_the_parameters() -> None:
    assert load_parameters("turbulence", TurbulenceParameters).length_scale_m == pytest.approx(1750.0 * 0.3048)
