"""The measurement model's numbers from what the camera chain measured; symbols of `measured_leds`.

w_0, c            the brightest pixel of unclipped spots, by the place of their centre in the pixel
s_0, a, N_b, T_0, q   the sigma that the image stages state of unclipped spots, its logarithm, robustly
s_c               median of the stated variance of clipped spots over the model's number of full pixels
e_u, e_c          RMS of error over stated sigma, strays apart
y_0, y_T, y_s     likelihood of being seen, over peak and exposure
lasting share     mean autocorrelation of the texture's part, at lags of 0.1 to 1 s
shares            counts, of names and rings over the texture
window            a straight line through the rows read over the height of the ring's image
"""

from collections.abc import Mapping

import numpy as np
from scipy.optimize import least_squares, minimize
from scipy.stats import norm

from dockair.rotations import Array
from dockair.scenarios.measured_leds import MeasurementParameters, above_dark_dn
from dockair.scenarios.reproduce.measurement_model.frames import Mask, Seen

STRAY_SIGMAS = 6.0  # one normal number in 5e8
_PLAIN_S = 50e-6  # exposures up to here show nothing but the spot
_BRIGHT_E = 15000.0  # a peak that noise hardly moves
_LAGS = (5, 10, 25, 50)  # frames
_FLOOR = 2e-3  # of a probability: something else may always go wrong
_DARK_DN = 1e-3  # so that it has a logarithm
_SOFT = 0.1  # of the logarithm of a sigma: beyond, residuals count linearly

Fitted = dict[str, float]


def fit(seen: Seen, sheet: MeasurementParameters, gain_dn_e: float, black_dn: float) -> Fitted:
    """Return every number of the sheet but those that it defines itself.

    These are t_0, n_c, the lasting part's time and the LEDs of a ring.

    Args:
        seen: what was measured.
        sheet: that the material was taken with.
        gain_dn_e: of the camera's output.
        black_dn: its level without light.
    """
    out = _spot(seen, sheet, gain_dn_e, black_dn)
    wider_px2 = (seen.width_px**2 - sheet.spot_sigma_px**2) / sheet.widening_share
    width_px = np.sqrt(out["spot_sigma_px"] ** 2 + out["widening_share"] * wider_px2)
    out |= _stated(seen, width_px, sheet.texture_exposure_s)
    texture_e = out["texture_e"] * (seen.exposure_s / sheet.texture_exposure_s) ** out["texture_exponent"]
    out |= _clipped(seen, sheet) | _errors(seen)
    out |= _seen(seen, texture_e, black_dn)
    out["texture_lasting_share"] = _lasting_share(seen, _part(seen, width_px * texture_e))
    return out | _frames(seen, texture_e / out["texture_e"], sheet.ring_least) | _window(seen)


def _spot(seen: Seen, sheet: MeasurementParameters, gain_dn_e: float, black_dn: float) -> Fitted:
    use = seen.found & ~seen.clipped & (seen.electrons > _BRIGHT_E) & (seen.exposure_s < _PLAIN_S)
    one = seen.select(use)
    wider_px2 = (one.width_px**2 - sheet.spot_sigma_px**2) / sheet.widening_share
    share = (one.peak_dn - black_dn + 0.5) / (gain_dn_e * one.electrons)  # half a level: output is cut, not rounded

    def residuals(x: Array) -> Array:
        w2 = x[0] ** 2 + x[1] * wider_px2
        return np.asarray(np.exp(-0.5 * one.off_px2 / w2) / (2.0 * np.pi * w2) - share)

    x = least_squares(residuals, [sheet.spot_sigma_px, sheet.widening_share], bounds=([0.2, 0.0], [5.0, 2.0])).x
    return {"spot_sigma_px": float(x[0]), "widening_share": float(x[1])}


def _stated(seen: Seen, width_px: Array, texture_exposure_s: float) -> Fitted:
    use = seen.found & ~seen.clipped
    n, w, sigma = seen.electrons[use], width_px[use], seen.sigma_px[use]
    t = seen.exposure_s[use] / texture_exposure_s

    def residuals(x: Array) -> Array:
        floor, factor, background, texture, exponent = *np.exp(x[:4]), x[4]
        variance = floor**2 + (factor * w) ** 2 * (n + background) / n**2 + (w * texture * t**exponent / n) ** 2
        return np.asarray(0.5 * np.log(variance) - np.log(sigma))

    start = np.array([*np.log([5e-3, 1.0, 3000.0, 500.0]), 1.0])
    x = least_squares(residuals, start, loss="soft_l1", f_scale=_SOFT).x
    names = ("sigma_floor_px", "photon_factor", "background_e", "texture_e")
    return dict(zip(names, np.exp(x[:4]).tolist(), strict=True)) | {"texture_exponent": float(x[4])}


def _clipped(seen: Seen, sheet: MeasurementParameters) -> Fitted:
    use = seen.found & seen.clipped
    full = np.clip(seen.full_pixels[use], 1, sheet.clipped_most)
    return {"clipped_sigma_px": float(np.sqrt(np.median(seen.sigma_px[use] ** 2 / full)))}


def _errors(seen: Seen) -> Fitted:
    z = seen.error_px / seen.sigma_px[:, None]
    with np.errstate(invalid="ignore"):
        stray = seen.found & (np.abs(z).max(axis=1) > STRAY_SIGMAS)
    out = {}
    for name, which in (("error_over_sigma", ~seen.clipped), ("clipped_error_over_sigma", seen.clipped)):
        out[name] = float(np.sqrt(np.mean(z[seen.found & which & ~stray] ** 2)))
    named = seen.found & seen.named
    share = float(stray[named].mean())
    wrong = seen.error_px[named & stray]
    return out | {"stray_share": share, "stray_px": float(np.sqrt(np.mean(wrong**2))) if len(wrong) else 0.0}


def _seen(seen: Seen, texture_e: Array, black_dn: float) -> Fitted:
    peak = np.maximum(above_dark_dn(seen.spot_peak_dn, black_dn), _DARK_DN)

    def unlikely(x: Array) -> float:
        level = np.exp(x[0]) + np.exp(x[1]) * texture_e
        p = norm.cdf(np.log(peak / level) / np.exp(x[2]))
        p = _FLOOR + (1.0 - 2.0 * _FLOOR) * p
        return -float(np.sum(np.log(np.where(seen.found, p, 1.0 - p))))

    x = minimize(unlikely, np.log([2.0, 0.02, 0.3]), method="Nelder-Mead", options={"maxiter": 600}).x
    names = ("faintest_dn", "faintest_dn_per_e", "faintest_spread")
    return dict(zip(names, np.exp(x).tolist(), strict=True))


def _part(seen: Seen, moment_px_e: Array) -> Array:
    """(n,) share of the stated variance that the texture makes; NaN where nothing is stated."""
    return (moment_px_e / np.maximum(seen.electrons, 1.0) / seen.sigma_px) ** 2


def _lasting_share(seen: Seen, texture_part: Array) -> float:
    """Autocorrelation of normalised errors where the texture makes most of them, over the texture's part."""
    z = seen.error_px / seen.sigma_px[:, None]
    with np.errstate(invalid="ignore"):
        use = seen.found & seen.named & (texture_part > 0.5) & (np.abs(z).max(axis=1) < STRAY_SIGMAS)
    product = square = 0.0
    for flight in np.unique(seen.flight[use]):
        for led in np.unique(seen.led[use]):
            one = use & (seen.flight == flight) & (seen.led == led)
            if not one.any():
                continue
            series = np.full((int(seen.frame.max()) + 1, 2), np.nan)
            series[seen.frame[one]] = z[one]
            part = float(texture_part[one].mean())
            for lag in _LAGS:
                pairs = series[:-lag] * series[lag:]
                product += float(np.nansum(pairs))
                square += part * float(np.nansum(np.where(np.isnan(pairs), np.nan, series[:-lag] ** 2)))
    return float(np.clip(product / square, 0.0, 1.0)) if square > 0.0 else 0.0


def _frames(seen: Seen, texture: Array, ring_least: int) -> Fitted:
    """Shares in proportion to the texture (n,), in units of T_0: events over the sum of that."""
    could = seen.found & seen.ring
    numbers, first, inverse = np.unique(
        np.column_stack([seen.flight, seen.frame]), axis=0, return_index=True, return_inverse=True
    )
    leds = np.bincount(inverse.ravel(), weights=seen.found, minlength=len(numbers))
    ring, enough = seen.ring[first], leds >= ring_least
    return {
        "unnamed_share": float((~seen.named[could]).sum() / texture[could].sum()),
        "no_ring_share": float((~ring[enough]).sum() / texture[first][enough].sum()),
    }


def _window(seen: Seen) -> Fitted:
    whole: Mask = seen.rows == seen.rows.max()
    use = ~whole & (seen.led == seen.led.min())
    columns = np.column_stack([seen.height_px[use], np.ones(int(use.sum()))])
    heights, margin = np.linalg.lstsq(columns, seen.rows[use].astype(float))[0]
    return {"window_heights": float(heights), "window_margin_px": float(margin)}


def rounded(fitted: Mapping[str, float], digits: int = 3) -> Fitted:
    """Return the numbers as a sheet has them."""
    return {name: float(f"{value:.{digits}g}") for name, value in fitted.items()}
