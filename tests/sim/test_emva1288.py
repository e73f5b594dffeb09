"""Photon transfer: flat fields give back the sheet's figures, by our own estimate and by the package of the standard.

Our estimate: K is the slope of temporal variance over mean, read noise the dark's variance less 1/12, PRNU and DSNU
the spatial deviations of averaged frames less what is left of the temporal noise.
The bound of 2 % is the claim. The statistical error of the fields used here is 0.1 % for K, the read noise and
PRNU, 0.4 % for the overall DSNU (a quarter of whose variance is 2048 columns) and 1.6 % for the columns alone.
`emva1288` 1.0 calls `np.asfarray`, which NumPy 2 does not have; the tests lend it one.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from emva1288.camera import Camera
from emva1288.camera.routines import Qe, get_radiance
from emva1288.process.data import Data1288
from emva1288.process.results import Results1288
from emva1288.process.routines import get_int_imgs

from dockair.parameters import load_parameters
from dockair.sim.camera.electronics import dark_current_e_s, digitise, output_black, output_gain
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.sheets import SensorParameters

TEN = load_parameters("sensor", SensorParameters)
TWELVE = replace(TEN, converter_bits=12, outputs=4, clock_hz=40e6)
SHAPE = (300, 2048)
EXPOSURE_S = 100e-6
PHOTONS_PER_ELECTRON = 3.0
LEVELS_E = np.linspace(0.0, 13600.0, 33)  # the last is clipped: the package finds saturation from above
FRAMES = 16  # averaged for the spatial figures

Grab = Callable[[float], np.ndarray]


def _grabber(sensor: SensorParameters, key: int) -> Grab:
    pattern = FixedPattern(sensor, key + 1, *SHAPE)
    count = iter(range(10**6))

    def grab(electrons: float) -> np.ndarray:
        flat = np.full(SHAPE, electrons, dtype=np.float32)
        return digitise(flat, sensor, pattern, key, next(count), (0, 0), EXPOSURE_S, sensor.converter_bits)

    return grab


def _pixel_dsnu_e(mean_frame: np.ndarray, temporal_variance: float, gain: float) -> tuple[float, float]:
    """Deviations of the pixels and of the columns [e-] of an average of FRAMES."""
    of_columns = mean_frame.mean(axis=0)
    residual = mean_frame - of_columns
    pixels = residual.var() * SHAPE[0] / (SHAPE[0] - 1) - temporal_variance / FRAMES
    columns = of_columns.var() - (pixels + temporal_variance / FRAMES) / SHAPE[0]
    return float(np.sqrt(pixels)) / gain, float(np.sqrt(columns)) / gain


@pytest.mark.parametrize("sensor", [TEN, TWELVE], ids=["10 bit", "12 bit"])
def test_our_photon_transfer_gives_back_gain_dark_noise_prnu_and_dsnu(sensor: SensorParameters) -> None:
    grab = _grabber(sensor, 41)
    means, variances = [], []
    for electrons in LEVELS_E[LEVELS_E < 9000.0]:
        a, b = (grab(electrons).astype(float) for _ in range(2))
        means.append(0.5 * (a + b).mean())
        variances.append(0.5 * np.var(a - b))
    gain = np.polyfit(np.array(means) - means[0], variances, 1, w=1.0 / np.array(variances))[0]
    dark, bright = (np.mean([grab(e) for _ in range(FRAMES)], axis=0) for e in (0.0, 6500.0))
    bright_variance = np.interp(6500.0, LEVELS_E[: len(variances)], variances)
    spatial = dark.var() - variances[0] / FRAMES, bright.var() - bright_variance / FRAMES
    pixels_e, columns_e = _pixel_dsnu_e(dark, variances[0], gain)

    assert gain == pytest.approx(output_gain(sensor, sensor.converter_bits), rel=0.02)
    assert np.sqrt(variances[0] - 1.0 / 12.0) / gain == pytest.approx(sensor.read_noise_e, rel=0.02)
    assert means[0] == pytest.approx(output_black(sensor, sensor.converter_bits), abs=0.05)
    prnu = np.sqrt(spatial[1] - spatial[0]) / (bright.mean() - dark.mean())
    assert prnu == pytest.approx(sensor.photo_response_nonuniformity, rel=0.02)
    assert pixels_e == pytest.approx(sensor.dark_signal_nonuniformity_e, rel=0.02)
    assert columns_e == pytest.approx(sensor.column_pattern_e, rel=0.08)  # 4.5 standard errors and what the gain adds


def _emva_results(grab: Grab) -> Results1288:
    """The package's figures, its data dictionary filled as its own loader fills it."""

    def temporal(images: list[np.ndarray]) -> dict[str, float]:
        d = get_int_imgs(images)
        return {"sum": np.sum(d["sum"]), "pvar": np.sum(d["pvar"]), "dmean": d["dmean"]}

    exposure_ns = EXPOSURE_S * 1e9
    data = {
        "height": SHAPE[0],
        "width": SHAPE[1],
        "temporal": {
            exposure_ns: {PHOTONS_PER_ELECTRON * float(e): temporal([grab(e), grab(e)]) for e in LEVELS_E},
        },
        "spatial": {
            exposure_ns: {
                PHOTONS_PER_ELECTRON * e: get_int_imgs([grab(e) for _ in range(FRAMES)]) for e in (0.0, 6500.0)
            },
        },
    }
    return Results1288(Data1288(data, loglevel=30).data, loglevel=30)


@pytest.mark.parametrize("sensor", [TEN, TWELVE], ids=["10 bit", "12 bit"])
def test_the_standards_own_package_gives_back_the_same_figures(
    sensor: SensorParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(np, "asfarray", lambda x: np.asarray(x, dtype=float), raising=False)
    found = _emva_results(_grabber(sensor, 43))
    dsnu_e = np.hypot(sensor.dark_signal_nonuniformity_e, sensor.column_pattern_e)
    assert found.K == pytest.approx(output_gain(sensor, sensor.converter_bits), rel=0.02)
    assert found.sigma_d == pytest.approx(sensor.read_noise_e, rel=0.02)
    assert found.PRNU1288 == pytest.approx(100.0 * sensor.photo_response_nonuniformity, rel=0.02)
    assert found.DSNU1288 == pytest.approx(dsnu_e, rel=0.02)
    assert found.DSNU1288_pixel == pytest.approx(sensor.dark_signal_nonuniformity_e, rel=0.02)
    assert found.QE == pytest.approx(100.0 / PHOTONS_PER_ELECTRON, rel=0.02)
    # The variance peaks where the most sensitive pixels begin to clip, 3 % below the well, to one of levels 3 % apart.
    assert 0.94 * sensor.full_well_e < found.u_e_sat < sensor.full_well_e
    assert max(-found.LE_min, found.LE_max) < 1.0


def _emva_camera(sensor: SensorParameters, exposure_s: float) -> tuple[Camera, np.ndarray]:
    """The package's camera with our sensor's figures, and the radiance that makes 1e6 electrons a second."""
    height, width = 200, 250
    quantum_efficiency = Qe(
        qe=np.full((height, width, 1), 0.5), wavelength=np.array([850.0]), width=width, height=height
    )
    gain, black = (f(sensor, sensor.converter_bits) for f in (output_gain, output_black))
    camera = Camera(
        f_number=8, pixel_area=5.5**2, bit_depth=sensor.converter_bits, width=width, height=height,
        temperature=sensor.temperature_c, temperature_ref=sensor.dark_reference_c,
        temperature_doubling=sensor.dark_doubling_k, qe=quantum_efficiency, exposure=exposure_s * 1e9,
        K=gain, K_min=gain, K_max=gain, blackoffset=black, blackoffset_min=black, blackoffset_max=black,
        dark_current_ref=sensor.dark_current_e_s, dark_signal_0=0.0, sigma2_dark_0=sensor.read_noise_e**2,
        u_esat=sensor.full_well_e, seed=5,
    )  # fmt: skip
    photons = np.full((height, width, 1), 1e6 / 0.5)
    return camera, get_radiance(1e9, photons, 5.5**2, 8, np.array([850.0]))


@pytest.mark.parametrize("sensor", [TEN, TWELVE], ids=["10 bit", "12 bit"])
def test_our_camera_and_the_packages_agree_on_mean_and_variance_against_exposure(sensor: SensorParameters) -> None:
    """Without a pattern, at 45 degC and 1000 e-/s, to 4.5 standard errors: 30 comparisons, 2e-4 of a false alarm.

    The package adds half a level of uniform noise before it rounds: its variance has 1/12 too much, taken off here.
    Where the well or the converter clips, the package clips the read noise as well: not compared.
    """
    sensor = replace(
        sensor, temperature_c=45.0, dark_current_e_s=1000.0, parasitic_light_sensitivity=0.0,
        photo_response_nonuniformity=0.0, dark_signal_nonuniformity_e=0.0, column_pattern_e=0.0,
    )  # fmt: skip
    for exposure_s in (0.1e-3, 0.5e-3, 2e-3, 5e-3, 12e-3):
        camera, radiance = _emva_camera(sensor, exposure_s)
        theirs = camera.grab(radiance).astype(float)
        pattern = FixedPattern(sensor, 0, *theirs.shape)
        light = np.full(theirs.shape, 1e6 * exposure_s, dtype=np.float32)
        ours = digitise(light, sensor, pattern, 47, 0, (0, 0), exposure_s, sensor.converter_bits).astype(float)
        standard_error = np.sqrt((ours.var() + theirs.var()) / ours.size)
        assert ours.mean() == pytest.approx(theirs.mean(), abs=4.5 * standard_error)
        assert ours.var() == pytest.approx(theirs.var() - 1.0 / 12.0, rel=4.5 * 2.0 / np.sqrt(ours.size))
        electrons = (1e6 + dark_current_e_s(sensor)) * exposure_s
        predicted = output_black(sensor, sensor.converter_bits) + output_gain(sensor, sensor.converter_bits) * electrons
        assert ours.mean() == pytest.approx(predicted, abs=4.5 * standard_error)
