"""Allan deviation of 2 h of standing still, by `allantools`, against the sheets.

The closed forms are those of IEEE Std 952-1997, annex C: white noise N^2/t, random walk K^2 t/3, Gauss-Markov as in
`_gauss_markov`. Both slow terms grow as sqrt(t) below the correlation time T, so one record of 2 h cannot tell them
apart for T = 300 s (a fit of both scatters by 40 %): each is recovered from one unit with the other switched off, and
both together from 40 units that stand side by side. False alarms are those of the fits' scatter over 40 seeds.
"""

from dataclasses import replace

import allantools
import numpy as np
import pytest
from scipy.optimize import minimize_scalar, nnls

from dockair.parameters import load_parameters
from dockair.sim.imu import Imu, ImuParameters

pytestmark = pytest.mark.slow

HOURS_2 = 7200.0
GRADES = {grade: load_parameters(f"imu_{grade}", ImuParameters) for grade in ("tactical", "mti", "consumer")}
SLOW_RATE = 10.0  # of the records that slow terms are fitted to


def _coefficients(p: ImuParameters, sensors: str) -> tuple[float, float, float, float]:
    """N, B, K, T."""
    if sensors == "gyro":
        return (
            p.gyro_noise_density_rad_s_rthz,
            p.gyro_bias_instability_rad_s,
            p.gyro_rate_random_walk_rad_s_rts,
            p.gyro_bias_correlation_s,
        )
    return (
        p.accelerometer_noise_density_m_s2_rthz,
        p.accelerometer_bias_instability_m_s2,
        p.accelerometer_random_walk_m_s2_rts,
        p.accelerometer_bias_correlation_s,
    )


def _without(p: ImuParameters, word: str) -> ImuParameters:
    return replace(p, **{name: 0.0 for name in ImuParameters.__slots__ if word in name})


def _allan_variances(p: ImuParameters, rate: float, taus: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """(3, taus) overlapping Allan variances of both triads over 2 h of standing still."""
    streams = (np.random.default_rng((seed, i)) for i in range(3))
    record = Imu(p, rate, *streams, np.eye(3), np.zeros(3)).record(round(HOURS_2 * rate))
    return {
        sensors: np.array([allantools.oadev(y, rate=rate, data_type="freq", taus=taus)[1] ** 2 for y in samples.T])
        for sensors, samples in (("gyro", record.angular_rate_rad_s), ("accelerometer", record.specific_force_m_s2))
    }


def _whole_steps(taus: np.ndarray, rate: float) -> np.ndarray:
    return np.unique(np.round(taus * rate)) / rate


def _gauss_markov(tau: np.ndarray, T: float) -> np.ndarray:
    """Allan variance of a first-order Gauss-Markov process of unit variance."""
    x = tau / T
    return 2.0 / x * (1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x))


def _floor(T: float = 1.0) -> tuple[float, float]:
    """Where the Allan variance of the unit process is highest, and how high."""
    best = minimize_scalar(lambda tau: -_gauss_markov(tau, T), bracket=(0.5 * T, 2.0 * T, 6.0 * T))
    return float(best.x), float(-best.fun)


def _fit(taus: np.ndarray, variance: np.ndarray, T: float, terms: str) -> dict[str, float]:
    """N, B, K of a measured Allan variance by least squares, each tau weighted by its number of intervals."""
    columns = {"N": 1.0 / taus, "B": _gauss_markov(taus, T) / _floor(T)[1], "K": taus / 3.0}
    A, model = np.column_stack([columns[term] for term in terms]), variance
    for _ in range(5):
        weight = np.sqrt(HOURS_2 / taus - 1.0) / model
        squares, _ = nnls(A * weight[:, None], variance * weight)
        model = A @ squares
    return dict(zip(terms, np.sqrt(squares), strict=True))


def test_the_highest_allan_deviation_of_gauss_markov_is_0_617_sigma_at_1_89_correlation_times() -> None:
    tau, variance = _floor()
    assert tau == pytest.approx(1.893, abs=5e-4)
    assert np.sqrt(variance) == pytest.approx(0.617364, abs=1e-6)


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_white_noise_of_the_whole_model_is_the_sheets_within_3_percent(grade: str, rate: float) -> None:
    """Each axis at 0.1 to 1 s: standard error 1.0 % at 1 s, 0.3 % at 0.1 s; quantum and slow terms add up to 1 %."""
    p, taus = GRADES[grade], np.array([0.1, 0.2, 0.5, 1.0])
    for sensors, variances in _allan_variances(p, rate, taus).items():
        N = _coefficients(p, sensors)[0]
        measured = np.sqrt(np.average(variances * taus, axis=1, weights=1.0 / taus))
        np.testing.assert_allclose(measured / N, 1.0, atol=0.03, err_msg=sensors)


@pytest.mark.parametrize("grade", GRADES)
def test_rate_random_walk_beside_white_noise_is_the_sheets_within_20_percent(grade: str) -> None:
    """One unit, three axes, standard error 4 to 6 %: a false alarm in 400 at worst."""
    p, taus = _without(GRADES[grade], "instability"), _whole_steps(np.geomspace(0.1, 1800.0, 20), SLOW_RATE)
    for sensors, variances in _allan_variances(p, SLOW_RATE, taus, seed=1).items():
        _, _, K, T = _coefficients(p, sensors)
        assert _fit(taus, variances.mean(0), T, "NK")["K"] == pytest.approx(K, rel=0.2), sensors


@pytest.mark.parametrize("grade", GRADES)
def test_bias_instability_beside_white_noise_is_the_sheets_within_20_percent(grade: str) -> None:
    """One unit, three axes, standard error 3 to 8 %: a false alarm in 100 at worst."""
    p, taus = _without(GRADES[grade], "walk"), _whole_steps(np.geomspace(0.1, 1800.0, 20), SLOW_RATE)
    for sensors, variances in _allan_variances(p, SLOW_RATE, taus, seed=2).items():
        _, B, _, T = _coefficients(p, sensors)
        assert _fit(taus, variances.mean(0), T, "NB")["B"] == pytest.approx(B, rel=0.2), sensors


def test_the_floor_of_the_measured_curve_is_the_bias_instability_itself() -> None:
    """No fit: T = 10 s leaves 380 intervals of 1.89 T an axis, 2 % in deviation over three axes; bound 5 of these."""
    p = _without(_without(GRADES["mti"], "walk"), "noise")
    p = replace(p, gyro_bias_correlation_s=10.0, accelerometer_bias_correlation_s=10.0)
    p = replace(p, gyro_quantum_rad_s=1e-12)  # without noise to carry it, a drift below the quantum would not be seen
    taus = _whole_steps(np.geomspace(2.0, 100.0, 40), SLOW_RATE)
    for sensors, variances in _allan_variances(p, SLOW_RATE, taus).items():
        deviation = np.sqrt(variances.mean(0))
        assert deviation.max() == pytest.approx(_coefficients(p, sensors)[1], rel=0.1), sensors
        assert taus[deviation.argmax()] == pytest.approx(18.93, rel=0.35), sensors


def test_all_three_terms_of_the_whole_model_come_back_from_forty_units() -> None:
    """N within 3 %, B and K within 20 %: standard errors 0.1 %, 5.6 % and 4 %, a false alarm in 2500."""
    p, taus = GRADES["mti"], _whole_steps(np.geomspace(0.1, 1800.0, 20), SLOW_RATE)
    units = [_allan_variances(p, SLOW_RATE, taus, seed=100 + unit) for unit in range(40)]
    for sensors in ("gyro", "accelerometer"):
        N, B, K, T = _coefficients(p, sensors)
        fit = _fit(taus, np.mean([unit[sensors] for unit in units], axis=(0, 1)), T, "NBK")
        assert fit["N"] == pytest.approx(N, rel=0.03), sensors
        assert fit["B"] == pytest.approx(B, rel=0.2), sensors
        assert fit["K"] == pytest.approx(K, rel=0.2), sensors
