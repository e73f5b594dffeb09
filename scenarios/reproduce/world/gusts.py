"""The Dryden field against MIL-F-8785C: strength, spectrum, correlation, and the delay along the hose.

    u:     Phi(W) = sigma^2 (2 L/pi) / (1 + (L W)^2)                                                      (1)
    v, w:  Phi(W) = sigma^2 (L/pi) (1 + 3 (L W)^2) / (1 + (L W)^2)^2                                      (2)
    p:     Phi(W) = sigma^2 / L  0.8 (pi L/(4 b))^(1/3) / (1 + (4 b W/pi)^2)                              (3)

one-sided over the spatial frequency W [rad/m]. The spectra are of a record with the sheet's own knots, read every
metre; reading folds the form about multiples of 2 pi rad/m, which is added to it. Strengths take 64 000 km of air,
whose knots are put 20 m apart: they are exact at any distance. The second reference is another program, JSBSim.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import coherence
from scipy.stats import chi2

from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name, read_reference
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters, gust_sigma, rolling_sigma

ID = "world/gusts"
TITLE = "Dryden gusts: strength, spectra inside chi2 bounds, correlation, delay along the hose"
_SOURCE = "MIL-F-8785C, section 3.7 and figure 7; JSBSim 1.3.3"
LEVELS = ("light", "moderate", "severe")
COMPONENTS = ("u", "v", "w", "p")
_AIRSPEED_M_S, _ALTITUDE_M = 150.0, 6096.0  # of the other program's run
_SPAN_M = 9.144  # of the fighter
_LONG_SPACING_M, _LONG_KNOTS, _LONG_CHUNKS = 20.0, 20_000, 160  # standard error of the variance 0.4 %
_ROLLING_PLACES = 1250  # of each chunk, 20 m apart: nearly independent
_READ_EVERY_M, _SIZE, _SEGMENTS = 1.0, 32_768, 24
_BANDS, _FIRST_BIN = 9, 3
_FALSE_ALARM = 1e-3  # of the chi2 bounds of all bands of one component
_FOLDS = 60  # beyond them 0.3 % of the highest band's power is left
_HOSE_M = 14.7  # a whole number of ticks, so that the other record can be put back exactly
_STEP_S, _TICKS, _HIGHEST_HZ = 2e-3, 30_000, 50.0
_SEED = 85
_SIZE_IN, _DPI = (11.0, 8.4), 110
_DRAWN_ALTITUDES_M, _APART_M, _SHOWN_S = (700.0, 12_000.0), 300.0, 3.0
_Row = dict[str, Any]


def spectrum(component: str, W: Array, sigma_m_s: float, length_m: float, span_m: float) -> Array:
    """One-sided spectrum over the spatial frequency W [rad/m], Eqs. (1)-(3)."""
    y = (length_m * W) ** 2
    if component == "u":
        form = 2.0 * length_m / np.pi / (1.0 + y)
    elif component == "p":
        shape = 0.8 * (np.pi * length_m / (4.0 * span_m)) ** (1.0 / 3.0) / length_m
        form = shape / (1.0 + (4.0 * span_m * W / np.pi) ** 2)
    else:
        form = length_m / np.pi * (1.0 + 3.0 * y) / (1.0 + y) ** 2
    return np.asarray(sigma_m_s**2 * form)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Compare; in `out` the spectra with their bounds, the correlation, and a gust on its way along the hose."""
    sheet = load_parameters("turbulence", TurbulenceParameters)
    others = {row["intensity"]: row for row in read_reference("jsbsim_dryden")}
    spectra = _spectra(sheet)
    along = _along_hose(sheet)
    strengths = [row for level in LEVELS for row in _strength(sheet, level, others[level])]
    rows = strengths + [_spectrum_row(component, *spectra[component]) for component in COMPONENTS]
    rows.append(_delay_row(*along))
    if out is not None:
        _draw(sheet, spectra, strengths, along, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _field(
    sheet: TurbulenceParameters, stream: int, *, extent_m: float, step_s: float, spacing_m: float, sigma_m_s: float
) -> DrydenField:
    parameters = TurbulenceParameters(
        sigma_m_s=sigma_m_s,
        length_scale_m=sheet.length_scale_m,
        knot_spacing_m=spacing_m,
        front_m=0.0,
        extent_m=extent_m,
    )
    return DrydenField(parameters, _AIRSPEED_M_S, step_s, np.random.default_rng((_SEED, stream)), _SPAN_M)


def _strength(sheet: TurbulenceParameters, level: str, other: dict[str, str]) -> list[_Row]:
    """Two rows, beside the specification and beside the other program."""
    extent_m, sigma = _LONG_SPACING_M * _LONG_KNOTS, gust_sigma(level, _ALTITUDE_M)
    step_s = extent_m / _AIRSPEED_M_S
    stream = LEVELS.index(level)
    field = _field(sheet, stream, extent_m=extent_m, step_s=step_s, spacing_m=_LONG_SPACING_M, sigma_m_s=sigma)
    x, squares, rolling, products = -_LONG_SPACING_M * np.arange(_LONG_KNOTS), np.zeros(3), 0.0, np.zeros(3)
    later = x - _AIRSPEED_M_S  # one second
    for _ in range(_LONG_CHUNKS):
        field.step()
        gusts = field.velocity(x)
        inside = later >= -extent_m
        squares += np.mean(gusts**2, axis=0) / _LONG_CHUNKS
        products += np.mean(gusts[inside] * field.velocity(later[inside]), axis=0) / _LONG_CHUNKS
        rolling += sum(field.rolling(place) ** 2 for place in x[:_ROLLING_PLACES]) / (_LONG_CHUNKS * _ROLLING_PLACES)
    ours = {f"sigma_{name}_m_s": float(np.sqrt(square)) for name, square in zip("uvw", squares, strict=True)}
    rolling_rad_s = rolling_sigma(sigma, sheet.length_scale_m, _SPAN_M)
    published = {**dict.fromkeys(ours, sigma), "sigma_p_rad_s": rolling_rad_s}
    correlation = {f"correlation_{name}_1_s": float(c) for name, c in zip("uvw", products / squares, strict=True)}
    return [
        {
            "case": f"strength, {level}",
            "ours": {**ours, "sigma_p_rad_s": float(np.sqrt(rolling))},
            "reference": published,
        },
        {
            "case": f"JSBSim, {level}",
            "ours": {**ours, **correlation},
            "reference": {key: float(other[key]) for key in (*ours, *correlation)},
        },
    ]


def _spectra(sheet: TurbulenceParameters) -> dict[str, tuple[Array, Array, Array]]:
    """Of each component: edges of the bands [rad/m], measured over published power in them, bounds (2, bands)."""
    count = _SIZE * _SEGMENTS
    field = _field(sheet, 10, extent_m=count * _READ_EVERY_M, step_s=1.0, spacing_m=sheet.knot_spacing_m, sigma_m_s=1.0)
    x = -_READ_EVERY_M * np.arange(count)
    gusts = np.column_stack([field.velocity(x), [field.rolling(place) for place in x]])
    window = np.hanning(_SIZE)
    W = 2.0 * np.pi * np.fft.rfftfreq(_SIZE, _READ_EVERY_M)
    images = np.abs(W + 2.0 * np.pi / _READ_EVERY_M * np.arange(-_FOLDS, _FOLDS + 1)[:, None])
    bins = np.geomspace(_FIRST_BIN, _SIZE // 2, _BANDS + 1).astype(int)
    result = {}
    for component, record in zip(COMPONENTS, gusts.T, strict=True):
        power = np.mean(np.abs(np.fft.rfft(record.reshape(_SEGMENTS, _SIZE) * window, axis=1)) ** 2, axis=0)
        power *= _READ_EVERY_M / (np.pi * np.sum(window**2))
        form = spectrum(component, images, 1.0, sheet.length_scale_m, _SPAN_M).sum(axis=0)
        bands = [slice(low, high) for low, high in zip(bins[:-1], bins[1:], strict=True)]
        ratio = np.array([power[band].sum() / form[band].sum() for band in bands])
        bounds = np.array([_bounds(form[band]) for band in bands]).T
        result[component] = W[bins], ratio, bounds
    return result


def _bounds(form: Array) -> tuple[float, float]:
    """chi2 bounds of a band: neighbouring bins of Hann periodograms correlate by (2/3)^2 and (1/6)^2 in power."""
    variance = np.sum(form**2)
    for apart, correlated in ((1, 4.0 / 9.0), (2, 1.0 / 36.0)):
        variance += 2.0 * correlated * np.sum(form[apart:] * form[:-apart])
    freedom = 2.0 * _SEGMENTS * np.sum(form) ** 2 / variance
    tail = 0.5 * _FALSE_ALARM / _BANDS
    low, high = chi2.ppf([tail, 1.0 - tail], freedom) / freedom
    return float(low), float(high)


def _spectrum_row(component: str, edges: Array, ratio: Array, bounds: Array) -> _Row:
    worst = int(np.argmax(np.abs(np.log(ratio)) / np.log(bounds[1])))
    ours = {
        "bands": len(ratio),
        "bands_inside_chi2": int(np.sum((bounds[0] < ratio) & (ratio < bounds[1]))),
        "lowest_rad_m": float(edges[0]),
        "highest_rad_m": float(edges[-1]),
        "worst_power_over_published": float(ratio[worst]),
        "its_chi2_low": float(bounds[0, worst]),
        "its_chi2_high": float(bounds[1, worst]),
    }
    return {"case": f"spectrum of {component}", "ours": ours, "reference": {"bands_inside_chi2": len(ratio)}}


def _along_hose(sheet: TurbulenceParameters) -> tuple[Array, Array]:
    """(n, 3) gusts at the hose's exit and at the drogue, tick by tick."""
    field = _field(sheet, 20, extent_m=30.0, step_s=_STEP_S, spacing_m=sheet.knot_spacing_m, sigma_m_s=1.0)
    gusts, x = np.empty((_TICKS, 2, 3)), np.array([0.0, -_HOSE_M])
    for tick in range(_TICKS):
        field.step()
        gusts[tick] = field.velocity(x)
    return gusts[:, 0], gusts[:, 1]


def _delay_row(exit_: Array, drogue: Array) -> _Row:
    """Delay where the sum over u, v, w of the cross-correlations peaks; coherence with that delay taken out."""
    size = 2 * len(exit_)
    crossed = np.fft.irfft(
        np.sum(np.conj(np.fft.rfft(exit_, size, axis=0)) * np.fft.rfft(drogue, size, axis=0), axis=1), size
    )
    delay = int(np.argmax(crossed))
    hz, lowest = np.zeros(0), 1.0
    for axis in range(3):
        hz, c = coherence(exit_[: len(exit_) - delay, axis], drogue[delay:, axis], 1.0 / _STEP_S, nperseg=2048)
        lowest = min(lowest, float(c[(hz > 0.0) & (hz < _HIGHEST_HZ)].min()))
    return {
        "case": f"delay along {_HOSE_M} m of hose",
        "ours": {"delay_ms": 1e3 * delay * _STEP_S, "lowest_coherence": lowest, "coherence_up_to_hz": _HIGHEST_HZ},
        "reference": {"delay_ms": 1e3 * _HOSE_M / _AIRSPEED_M_S, "lowest_coherence": 1.0},
    }


def _draw(
    sheet: TurbulenceParameters,
    spectra: dict[str, tuple[Array, Array, Array]],
    rows: list[_Row],
    along: tuple[Array, Array],
    path: Path,
) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    ((form, ratio), (strength, delay)) = figure.subplots(2, 2)
    for component, colour in zip(COMPONENTS, ("tab:blue", "tab:orange", "tab:green", "tab:red"), strict=True):
        edges, measured, bounds = spectra[component]
        middle = np.sqrt(edges[:-1] * edges[1:])
        W = np.geomspace(edges[0], edges[-1], 200)
        published = spectrum(component, W, 1.0, sheet.length_scale_m, _SPAN_M)
        at = spectrum(component, middle, 1.0, sheet.length_scale_m, _SPAN_M)
        if component != "w":  # its form is that of v
            form.loglog(W, published, color="black", lw=0.9)
        form.loglog(middle, measured * at, "o", ms=4, mfc="none", color=colour, label=component)
        ratio.semilogx(middle, measured, "o-", ms=4, lw=0.7, color=colour, label=component)
        if component == "v":
            ratio.fill_between(middle, *bounds, color="black", alpha=0.12, lw=0.0, label="χ² bounds of v")
    form.set(xlabel="spatial frequency [rad/m]", title="spectra for σ = 1 m/s; lines: MIL-F-8785C",
             ylabel="[m²/s² per rad/m], p: [rad²/s² per rad/m]")  # fmt: skip
    ratio.set(xlabel="spatial frequency [rad/m]", ylim=(0.5, 1.6), title="measured over published power, by bands")
    _draw_strength(strength, rows)
    _draw_delay(delay, *along)
    for panel in (form, ratio, strength, delay):
        panel.legend(frameon=False, fontsize=8)
        panel.grid(alpha=0.25)
    figure.savefig(path)


def _draw_strength(panel: Any, rows: list[_Row]) -> None:
    altitude_m = np.linspace(*_DRAWN_ALTITUDES_M, 200)
    for level, style in zip(LEVELS, (":", "--", "-"), strict=True):
        sigmas = [gust_sigma(level, altitude) for altitude in altitude_m]
        panel.plot(sigmas, 1e-3 * altitude_m, color="black", ls=style, lw=1.0, label=f"figure 7, {level}")
    for row in rows:
        other = row["case"].startswith("JSBSim")
        values = row["reference"] if other else row["ours"]
        label = ("JSBSim: u, v, w" if other else "field: u, v, w") if "light" in row["case"] else None
        panel.plot(
            [values[f"sigma_{name}_m_s"] for name in "uvw"],
            np.full(3, 1e-3 * (_ALTITUDE_M + (_APART_M if other else 0.0))),
            "x" if other else "o",
            ms=5,
            mfc="none",
            color="tab:red" if other else "tab:blue",
            label=label,
        )
    panel.set(xlabel="σ [m/s]", ylabel="altitude [km]", title="strength (JSBSim drawn 0.3 km higher)", xlim=(0.0, None))


def _draw_delay(panel: Any, exit_: Array, drogue: Array) -> None:
    time_s = _STEP_S * np.arange(len(exit_))
    shown = time_s < _SHOWN_S
    panel.plot(time_s[shown], exit_[shown, 1], lw=1.0, color="tab:blue", label="v at the hose's exit")
    panel.plot(time_s[shown], drogue[shown, 1], lw=1.0, color="tab:orange", label="v at the drogue")
    panel.set(
        xlabel="time [s]", ylabel="m/s", title=f"one field: {1e3 * _HOSE_M / _AIRSPEED_M_S:.0f} ms along the hose"
    )
