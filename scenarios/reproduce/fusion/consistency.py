"""Errors of the relative filter on made-up approaches, and whether its covariance knows them.

Hardware as its sheets say: NEES and NIS averaged over the approaches, inside their 95 % bands or not, frame by frame;
coupled tightly and loosely. Hardware as built, all of it and part by part: what each part costs, with the calibration's
errors carried as considered states, and once without. Then a world that moves otherwise than is believed.

The reference holds what is wanted: range within 50 mm at 10 m and 10 mm inside 5 m, bias within 20 mm; across, in
camera axes, 5 mm inside 5 m; attitude within 0.5 degrees inside 10 m; the wrong one of two minima in less than 0.1 % of
the frames.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.fusion import FusionSettings
from dockair.scenarios.reproduce.fusion.cases import Case, Consistency, consistency, figures, tracks
from dockair.scenarios.reproduce.fusion.flight import Approach
from dockair.scenarios.reproduce.fusion.follow import Track, Watching, calibrated
from dockair.scenarios.reproduce.fusion.wanted import WANTED
from dockair.scenarios.reproduce.reference import picture_name

ID = "fusion/consistency"
TITLE = "errors of the relative filter on made-up approaches, and whether its covariance knows them"
_SOURCE = "Bar-Shalom, Li & Kirubarajan 2001, ch. 5.4 (NEES, NIS); Schmidt 1966 (considered states)"
_TRIALS, _FEW = 100, 4  # approaches of the main cases; of the others a fourth
_PARTS = ("camera axes", "camera place", "lens", "ring", "imu")
_SIZE_IN, _DPI = (11.0, 7.4), 110
NOMINAL, BUILT = "as its sheets say, tight", "as built, tight"


def cases() -> list[Case]:
    """Return the main cases first, each with the number of its approaches left open."""
    belief = FusionSettings()
    loose, exact = replace(belief, coupling="loose"), calibrated(belief)
    plain, built = Approach(), Approach(imu="mti", as_built=_PARTS)

    def case(name: str, approach: Approach, settings: FusionSettings) -> Case:
        return Case(name=name, approach=approach, watching=Watching(settings=settings, sigma_px=approach.sigma_px))

    parts = [case(f"{part} as built", Approach(imu="mti", as_built=(part,)), belief) for part in _PARTS]
    return [
        case(NOMINAL, plain, exact),
        case("as its sheets say, loose", plain, calibrated(loose)),
        case(BUILT, built, belief),
        case("as built, loose", built, loose),
        case("as built, its errors not carried", built, exact),
        *parts,
        case("consumer IMU", Approach(imu="consumer", as_built=_PARTS), belief),
        case("swings 1.3 times as fast", replace(plain, swing_frequency_factor=1.3), exact),
        case("gusts on the drogue doubled", replace(plain, drive_factor=2.0), exact),
        case("drogue turns twice as much", replace(plain, turning_factor=2.0), exact),
        case("attitude of rest 2 degrees off, as built", replace(built, rest_pitch_rad=np.deg2rad(2.0)), belief),
        case("LEDs' places considered, not estimated, as built", built, replace(belief, led_place_share=0.0)),
        case("gusts on the receiver tripled", replace(plain, gust_m_s2=0.9), exact),
    ]


def reproduce(out: Path | None, trials: int = _TRIALS) -> dict[str, Any]:
    """Run all cases; averages against time and the errors of as-built approaches in `out`."""
    rows, shown = [], {}
    for k, case in enumerate(cases()):
        count = trials if k < 3 else max(trials // _FEW, 2)
        flown = tracks(case, count)
        ours = figures(flown) | {"approaches": count}
        rows.append({"case": case.name, "ours": ours, "reference": dict(WANTED) | {"nees_over_n": 1.0}})
        if k < 3:
            shown[case.name] = (consistency(flown), flown)
    if out is not None:
        _draw(shown, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _draw(shown: dict[str, tuple[Consistency, list[Track]]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(2, 2)
    for axes, what in zip(panels[0], ("nees", "nis"), strict=True):
        for name, (found, _) in shown.items():
            axes.plot(found.time_s, getattr(found, what), lw=0.8, label=name)
        low, high = getattr(next(iter(shown.values()))[0], f"{what}_band")
        axes.axhspan(low, high, color="0.85", zorder=0, label="95 % band")
        axes.set(ylim=(0.0, 2.0), xlabel="time [s]", ylabel="mean per degree of freedom", title=what.upper())
    panels[0, 0].legend(frameon=False, fontsize=8)
    _, flown = shown[BUILT]
    for axes, (name, rows, scale) in zip(
        panels[1], (("range", (3,), 1e3), ("across, camera axes", (4, 5), 1e3)), strict=True
    ):
        for track in flown[:25]:
            size = np.sqrt((track.error_C[:, rows] ** 2).sum(axis=1))
            axes.plot(track.range_m, scale * size, lw=0.5, alpha=0.6, color="C2")
        limits = ((9.0, 11.0, 50.0), (2.0, 5.0, 10.0)) if name == "range" else ((2.0, 5.0, 5.0),)
        for first, last, limit in limits:
            axes.plot((first, last), (limit, limit), color="black", lw=1.5)
        axes.set(
            yscale="log", ylim=(0.05, 200.0), xlabel="range from the camera [m]", ylabel="error [mm]",
            title=f"{name}: as built; black: rmse wanted",
        )  # fmt: skip
        axes.invert_xaxis()
    figure.savefig(path)
