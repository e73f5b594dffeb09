"""Dryden gusts against their closed forms. Every statistical bound fails by luck less than once in 10^5 runs."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2, norm

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters, gust_sigma

L, V, SIGMA = 533.4, 180.0, 1.3
FALSE_ALARM = 1e-5


def parameters(sigma_m_s: float = SIGMA, extent_m: float = 60.0) -> TurbulenceParameters:
    return TurbulenceParameters(sigma_m_s=sigma_m_s, length_scale_m=L, front_m=40.0, extent_m=extent_m)


def correlation(distance_m: np.ndarray, axis: int) -> np.ndarray:
    """Eq. (3), with distance instead of delay."""
    d = np.asarray(distance_m) / L
    return np.exp(-d) * (1.0 if axis == 0 else 1.0 - 0.5 * d)


def ensemble(count: int, x_W: np.ndarray, steps: int, step_s: float = 0.1, extent_m: float = 60.0) -> np.ndarray:
    """(count, n, 3) gusts of as many independent fields; the discretisation is exact, so a tick may be long."""
    gusts = np.empty((count, len(x_W), 3))
    for i in range(count):
        field = DrydenField(parameters(extent_m=extent_m), V, step_s, np.random.default_rng((5, i)))
        for _ in range(steps):
            field.step()
        gusts[i] = field.velocity(x_W)
    return gusts


@pytest.mark.parametrize("steps", [0, 7])
def test_every_component_has_the_variance_of_the_sheet_from_the_first_tick_on(steps: int) -> None:
    """N independent fields: N s^2 / sigma^2 is chi2(N). In feet it would be ten times as much."""
    count = 800
    squares = np.sum(ensemble(count, np.array([40.0]), steps)[:, 0] ** 2, axis=0) / SIGMA**2
    low, high = chi2.ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2], count)
    assert np.all((low < squares) & (squares < high))


def test_gusts_a_distance_apart_correlate_as_the_dryden_form_says_and_the_axes_not_at_all() -> None:
    """For Gaussian a, b the mean of N products has the variance (R_aa R_bb + R_ab^2) / N; 63 comparisons."""
    count, step_s = 1200, 0.25
    x_W = 40.0 - V * step_s * np.array([0, 1, 2, 4, 8, 12, 16])
    gusts = ensemble(count, x_W, 0, step_s, extent_m=800.0) / SIGMA
    bound = norm.ppf(1.0 - FALSE_ALARM / 2 / 63)
    for a in range(3):
        for b in range(3):
            expected = correlation(x_W[0] - x_W, a) if a == b else np.zeros(len(x_W))
            measured = np.mean(gusts[:, :1, a] * gusts[:, :, b], axis=0)
            sigma = np.sqrt((1.0 + expected**2) / count)
            assert np.all(np.abs(measured - expected) < bound * sigma), (a, b)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_power_in_bands_is_the_integral_of_the_published_spectrum(axis: int) -> None:
    """MIL-F-8785C in spatial frequency W, one-sided:  u: s^2 (2L/pi) / (1 + (LW)^2),
    v, w: s^2 (L/pi) (1 + 3 (LW)^2) / (1 + (LW)^2)^2.

    Periodograms with a Hann window (2/3 of the bins count as independent); the bands stay away from the resolution
    (0.08 rad/s) and from the Nyquist frequency (157 rad/s), so leakage and aliases are below 1 %.
    """
    step_s, size, segments = 0.02, 4096, 24
    field = DrydenField(parameters(extent_m=4.0), V, step_s, np.random.default_rng(17))
    window = np.hanning(size)
    power = np.zeros(size // 2 + 1)
    for _ in range(segments):
        gusts = np.empty(size)
        for k in range(size):
            field.step()
            gusts[k] = field.velocity(np.array([40.0]))[0, axis]
        power += np.abs(np.fft.rfft(gusts * window)) ** 2 / segments
    omega = 2.0 * np.pi * np.fft.rfftfreq(size, step_s)
    per_bin = 2.0 * power / (size * np.sum(window**2))  # part of the variance

    def spectrum(W: float) -> float:
        y = (L * W) ** 2
        form = 2.0 / (1.0 + y) if axis == 0 else (1.0 + 3.0 * y) / (1.0 + y) ** 2
        return SIGMA**2 * L / np.pi * form

    edges = omega[1] * (np.array([6, 16, 46, 136, 400]) - 0.5)
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = (omega > low) & (omega < high)
        expected = quad(spectrum, low / V, high / V)[0]
        freedom = 2.0 * segments * np.sum(inside) * 2.0 / 3.0 / 2.0  # half again: the spectrum falls inside the band
        bounds = chi2.ppf([FALSE_ALARM / 8, 1.0 - FALSE_ALARM / 8], freedom) / freedom
        assert bounds[0] < np.sum(per_bin[inside]) / expected < bounds[1]


def test_field_is_frozen_the_gust_of_the_front_arrives_later() -> None:
    step_s, ticks = 1e-3, 150
    field = DrydenField(parameters(), V, step_s, np.random.default_rng(3))
    x_W = 40.0 - V * step_s * np.array([0.0, 60.0, 100.0])
    before = []
    for _ in range(ticks):
        field.step()
        before.append(field.velocity(x_W))
    now = np.array(before)
    np.testing.assert_allclose(now[60:, 1], now[:-60, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(now[100:, 2], now[:-100, 0], rtol=0, atol=1e-9)
    assert np.ptp(now[:, 0, 0]) > 0.01


def test_gust_is_continuous_in_place_and_time() -> None:
    field = DrydenField(parameters(extent_m=20.0), V, 1e-3, np.random.default_rng(4))
    x_W = np.linspace(45.0, 15.0, 3001)  # beyond both ends, 1 cm apart
    along = field.velocity(x_W)
    jumps = np.abs(np.diff(along, axis=0))
    assert jumps.max() < 0.02  # largest step from tick to tick (18 cm) is 0.05 sigma sqrt(3); 1 cm is a share of it
    np.testing.assert_array_equal(along[x_W > 40.0], np.broadcast_to(along[0], along[x_W > 40.0].shape))
    np.testing.assert_array_equal(along[x_W < 20.0 - 0.5], np.broadcast_to(along[-1], along[x_W < 19.5].shape))
    field.step()
    assert np.abs(field.velocity(x_W) - along).max() < 0.2


def test_same_seed_same_gusts_and_no_strength_no_gust() -> None:
    x_W = np.array([0.0, -10.0])
    one, two = (DrydenField(parameters(), V, 1e-3, np.random.default_rng(9)) for _ in range(2))
    still = DrydenField(parameters(sigma_m_s=0.0), V, 1e-3, np.random.default_rng(9))
    for _ in range(20):
        for field in (one, two, still):
            field.step()
    np.testing.assert_array_equal(one.velocity(x_W), two.velocity(x_W))
    np.testing.assert_array_equal(still.velocity(x_W), np.zeros((2, 3)))


def test_strengths_at_20000_feet_are_those_of_the_specification() -> None:
    """Half way between the 15000 and the 25000 ft columns: (4.6 + 2.7) / 2 ft/s = 1.11 m/s, and so on."""
    ours = [gust_sigma(intensity, 6096.0) for intensity in ("light", "moderate", "severe")]
    assert ours == pytest.approx([1.11, 2.23, 6.42], abs=0.005)
    assert gust_sigma("light", 7500.0 * 0.3048) == pytest.approx(6.7 * 0.3048, rel=1e-12)


def test_wrong_strengths_altitudes_and_speeds_are_refused() -> None:
    with pytest.raises(DockairError, match="exists: light, moderate, severe"):
        gust_sigma("mild", 6000.0)
    with pytest.raises(DockairError, match="from 610 to 24384 m"):
        gust_sigma("light", 300.0)
    with pytest.raises(DockairError, match="a speed > 0"):
        DrydenField(parameters(), 0.0, 1e-3, np.random.default_rng(0))


def test_the_sheet_fills_the_parameters() -> None:
    assert load_parameters("turbulence", TurbulenceParameters).length_scale_m == pytest.approx(1750.0 * 0.3048)
