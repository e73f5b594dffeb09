"""What an LED does that leaves its place more slowly than any frame can see, and what is claimed for contact meanwhile.

Receiver and drogue move as in the made-up approaches (`fusion.flight`), in calm air and 7 m apart for a minute, with
the drogue pitched up, level, and pitched down; the navigation is the one that flies, on the pixels of named LEDs. All
hardware is as its sheets say, but one LED goes outward from the ring's centre by 0.1 mm in a second. The belief learns
that as if it were the LED's place, until frames contradict it although they are tested on what is learnt. By LED: how
far it is off when it is first left out; the worst errors of the belief while contact is claimed, in camera axes as the
protection levels are, and the levels then; how often an error is more than its level, or than an alert limit.

Not modelled: other LEDs that are off their places, too, by their tolerance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.messages import LedObservation
from dockair.nav.fusion import FusionSettings
from dockair.nav.integrity.contact import ContactLimits
from dockair.nav.navigator import Navigator
from dockair.rotations import Array
from dockair.scenarios.reproduce.fusion.flight import Approach, Flown, fly
from dockair.scenarios.reproduce.fusion.follow import true_error
from dockair.scenarios.reproduce.reference import picture_name

ID = "integrity/slow-fault"
TITLE = "an LED that leaves its place more slowly than any frame can see, and what is claimed for contact meanwhile"
PITCHES_RAD = (-0.12, 0.0, 0.12)  # of the drogue, positive nose down: a flight of each, with a seed of its own


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowFault:
    """An LED that goes outward, and the LEDs that are seen after `_SETTLED_S`."""

    led: int
    outward_m_s: float = 1e-4
    begins_s: float = 0.0
    lasts_s: float = 60.0
    seen: tuple[int, ...] = tuple(range(8))


_STATION = Approach(
    duration_s=60.0,
    first_m=4.3,  # tip to ring, and the tip is 2.7 m ahead of the camera
    last_m=4.3,
    gust_m_s2=0.1,
    attitude_rad=0.01,
    drive_factor=0.1,
    turning_factor=0.4,
    belief=FusionSettings(start_velocity_sigma_m_s=0.1),  # joined up: the ring stays on the sensor
)
_SETTLED_S = 2.0  # from the start: before, the belief is that of the start geometry
_OF_EIGHT = {f"LED {led}": SlowFault(led=led) for led in (0, 1, 2, 3)}  # the other four stand opposite them
_OF_FEW = {
    f"LED {seen[0]} of {seen}": SlowFault(led=seen[0], outward_m_s=6e-4, begins_s=_SETTLED_S, lasts_s=20.0, seen=seen)
    for seen in ((0, 2, 5), (5, 0, 2), (1, 3, 6), (4, 5, 6, 7))
}
_SEED = 73
_SIZE_IN, _DPI = (11.0, 4.0), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watched:
    """One flight with one bad LED, frame by frame from `_SETTLED_S` on."""

    outward_m: Array  #: (k,) how far the LED is off its place
    left_out: Array  #: (k,) bool: the LED was left out of the frame
    other_left_out: Array  #: (k,) bool: another was
    claimed: Array  #: (k,) bool: contact may be flown on the belief
    error_m: Array  #: (k, 2) of the ring's centre, along the camera's axis and across it
    level_m: Array  #: (k, 2) protection levels of the claim, likewise


def reproduce(out: Path | None, pitches_rad: Sequence[float] = PITCHES_RAD) -> dict[str, Any]:
    """Fly, and table errors, levels and claims by LED; the first flights' frames in the picture."""
    flights = [fly(replace(_STATION, drogue_pitch_rad=pitch), seed) for seed, pitch in enumerate(pitches_rad)]
    watched = {
        case: [watch(flown, fault, seed) for seed, flown in enumerate(flights)]
        for case, fault in (_OF_EIGHT | _OF_FEW).items()
    }
    rows = [{"case": case, "ours": _figures(of_fault), "reference": {}} for case, of_fault in watched.items()]
    every = [one for case in _OF_EIGHT for one in watched[case]]
    rows.insert(len(_OF_EIGHT), {"case": "all four", "ours": _figures(every), "reference": {}})
    if out is not None:
        _draw({fault.led: watched[case][0] for case, fault in _OF_EIGHT.items()}, out / picture_name(ID))
    return {"id": ID, "source": "made-up flights", "rows": rows}


def watch(flown: Flown, fault: SlowFault, seed: int) -> Watched:
    """Run the navigation along a flight on whose ring one LED goes outward; the seed is that of the pixels' noise."""
    sheets, rng, rows = flown.sheets, np.random.default_rng((_SEED, seed)), []
    navigator, samples = Navigator(sheets), sheets.gyro.rate_hz // sheets.camera_rate_hz
    seen, others = np.sort(fault.seen), np.setdiff1d(fault.seen, fault.led)
    for tick in range(0, len(flown.imu), samples):
        time_s = float(flown.time_s[tick])
        if time_s > fault.begins_s + fault.lasts_s:
            break
        outward_m = fault.outward_m_s * max(time_s - fault.begins_s, 0.0)
        shown = _observed(_with_outward(flown, fault.led, outward_m), tick, rng)
        if time_s >= _SETTLED_S:
            shown = replace(
                shown, led_numbers=seen, centroids_px=shown.centroids_px[seen], sigma_px=shown.sigma_px[seen]
            )
        solution = navigator.step(flown.imu[max(tick - samples + 1, 0) : tick + 1], shown)
        claim = navigator.contact_claim()
        if claim is None or time_s < _SETTLED_S:
            continue
        without = ~np.isfinite(solution.led_pixels_px[:, 0])
        error_C = sheets.mounting.R_BC.T @ true_error(flown, tick, solution)[3:6]
        errors_m = abs(float(error_C[0])), float(np.hypot(error_C[1], error_C[2]))
        levels_m = claim.levels.range_m, claim.levels.lateral_m
        rows.append((outward_m, without[fault.led], without[others].any(), solution.contact_usable, errors_m, levels_m))
    return Watched(**dict(zip(_names(), map(np.array, zip(*rows, strict=True)), strict=True)))


def _names() -> tuple[str, ...]:
    return tuple(field.name for field in fields(Watched))


def _with_outward(flown: Flown, led: int, outward_m: float) -> Flown:
    """Return the flight on a ring one of whose LEDs is so much farther from the centre than the sheet says."""
    places_D = flown.sheets.ring.positions_D
    places_D[led] *= 1.0 + outward_m / np.linalg.norm(places_D[led])
    return replace(flown, built=replace(flown.built, ring_positions_D=places_D))


def _observed(flown: Flown, tick: int, rng: np.random.Generator) -> LedObservation:
    """Return all LEDs as the camera sees them at a tick of the IMU."""
    pixels, sigma_px = flown.pixels(tick, _STATION.sigma_px, rng), np.full(flown.sheets.ring.count, _STATION.sigma_px)
    return LedObservation(
        time_stamp_s=float(flown.time_s[tick]),
        led_numbers=np.arange(len(pixels)),
        centroids_px=pixels,
        sigma_px=sigma_px,
    )


def _figures(flights: Sequence[Watched]) -> dict[str, float]:
    every = Watched(**{name: np.concatenate([getattr(flight, name) for flight in flights]) for name in _names()})
    limits_m = np.array([ContactLimits().range_m, ContactLimits().lateral_m])
    over_level, over_limit = (
        (every.error_m / bound_m).max(axis=1)[every.claimed] for bound_m in (every.level_m, limits_m)
    )
    return {
        "flights": len(flights),
        **_first_left_out(flights),
        "frames": len(every.claimed),
        "frames_without_it": int(every.left_out.sum()),
        "frames_without_another": int(every.other_left_out.sum()),
        "frames_claimed": int(every.claimed.sum()),
        **_worst(every),
        "claimed_beyond_a_level": int((over_level > 1.0).sum()),
        "error_over_level_most": float(over_level.max(initial=0.0)),
        "claimed_beyond_a_limit": int((over_limit > 1.0).sum()),
    }


def _first_left_out(flights: Sequence[Watched]) -> dict[str, float]:
    """In how many flights the LED was left out, and how far it was off its place at the first frame without it."""
    first_mm = [1e3 * float(flight.outward_m[flight.left_out.argmax()]) for flight in flights if flight.left_out.any()]
    found: dict[str, float] = {"flights_that_left_it_out": len(first_mm)}
    if first_mm:
        found |= {"first_left_out_at_mm_least": min(first_mm), "first_left_out_at_mm_most": max(first_mm)}
    return found


def _worst(watched: Watched) -> dict[str, float]:
    """The largest errors while contact is claimed, and the level in the same frame."""
    worst = {}
    for axis, name in enumerate(("along", "across")):
        k = int(np.where(watched.claimed, watched.error_m[:, axis], 0.0).argmax())
        worst[f"error_{name}_mm_most"] = 1e3 * float(watched.error_m[k, axis])
        worst[f"level_{name}_mm_then"] = 1e3 * float(watched.level_m[k, axis])
    return worst


def _draw(watched: Mapping[int, Watched], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for axis, (axes, name) in enumerate(zip(figure.subplots(1, 2), ("along", "across"), strict=True)):
        for led, one in watched.items():
            outward_mm = 1e3 * one.outward_m
            axes.plot(outward_mm, 1e3 * one.error_m[:, axis], lw=1.0, color=f"C{led}", label=f"LED {led}")
            axes.plot(outward_mm, 1e3 * one.level_m[:, axis], lw=0.3, ls=":", color=f"C{led}")
        axes.set(
            xlabel="LED outward of its place [mm]", ylabel="[mm]", title=f"error {name} (dotted: protection level)",
            ylim=(0.0, None),
        )  # fmt: skip
    figure.axes[0].legend(frameon=False, fontsize=8)
    figure.savefig(path)
