"""One flight in figures: `result.json`."""

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dockair.calibration import Mounting
from dockair.scenarios.accept import Accept, was_refuelled
from dockair.scenarios.judgement.attempts import Attempt, first_attempt_succeeded, succeeded
from dockair.scenarios.judgement.causes import Flown, cause_of_flight, with_cause
from dockair.scenarios.judgement.flight_profile import PhaseEntry, RangeBin, navigation_by_range, timeline
from dockair.scenarios.judgement.hold import Disconnect, Hold, hold_of
from dockair.scenarios.judgement.metrics import HeadingFigures, NavigationFigures, heading_figures, navigation_figures
from dockair.scenarios.judgement.referee import Contact, Outcome, Referee

SCHEMA_VERSION = 1
_PACKAGES = ("dockair", "mujoco", "numpy", "scipy", "opencv-python-headless", "numba", "filterpy")


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One flight; the fields are the keys of `result.json`."""

    schema_version: int = SCHEMA_VERSION
    scenario: str
    seed: int
    outcome: str
    success: bool  #: contact inside the limits in some attempt
    first_attempt: bool  #: in the first
    cause: str  #: of the last attempt that failed; "" if none did
    unsafe: tuple[str, ...]  #: what was unsafe; empty when all was safe
    attempts: int
    attempt_log: tuple[Attempt, ...]
    contact: Contact | None
    hold: Hold | None
    disconnect: Disconnect | None
    fuel_kg: float  #: that was taken on
    collided_with: str
    sensing: str  #: what the navigation saw: "camera", "measurements" or "truth"
    truth_navigation: bool
    background: str  #: who drew what the camera saw, "mujoco" or "analytic"; "" without a camera
    nav: NavigationFigures
    heading: HeadingFigures | None = None  #: None where none was kept
    frames: int
    duration_s: float
    real_time_factor: float
    wall_time_s: float
    versions: Mapping[str, str]
    timeline: tuple[PhaseEntry, ...]
    nav_by_range: tuple[RangeBin, ...]
    shortfalls: tuple[str, ...] | None = None  #: what the scenario asks for and the flight did not show; None: nothing
    out_dir: str | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: NaN and infinity become None."""
        return {key: _plain(value) for key, value in asdict(self).items()}

    def to_json(self) -> str:
        """Return one JSON object, keys in the order of the fields."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def write(self, out_dir: str | Path) -> Path:
        """Write `result.json` into a folder and return its path."""
        path = Path(out_dir) / "result.json"
        path.write_text(self.to_json() + "\n", encoding="utf-8")
        return path


def held_to(accept: Accept, result: Result) -> Result:
    """Return a flight's result with what it did not show of what its scenario asks for.

    Args:
        accept: the scenario's.
        result: of the flight.
    """
    contact = result.contact
    lines = accept.shortfalls(
        result.outcome,
        contact.radial_offset_m if contact else None,
        contact.closure_speed_m_s if contact else None,
        result.unsafe,
        angle_deg=contact.angle_deg if contact else None,
        refuelled=was_refuelled(result.fuel_kg, [entry.reason for entry in result.timeline]),
    )
    return replace(result, shortfalls=tuple(lines) if lines or accept.claims_figures else None)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def versions() -> dict[str, str]:
    """Return the versions that decide a flight's bits."""
    return {"python": platform.python_version()} | {package: version(package) for package in _PACKAGES}


def summarise(
    *,
    scenario: str,
    seed: int,
    outcome: str,
    referee: Referee,
    flown: Flown,
    frames: int,
    mounting: Mounting,
    sensing: str,
    background: str,
    wall_time_s: float,
    out_dir: str | Path | None,
) -> Result:
    """Return a flight's result.

    Args:
        scenario: its name.
        seed: that was flown.
        outcome: of the referee.
        referee: that watched the flight.
        flown: truth and belief, one a control tick.
        frames: that were delivered to the navigation.
        mounting: where the navigation believes its camera to be.
        sensing: what the navigation saw: "camera", "measurements", or "truth" in place of `nav`.
        background: who drew what the camera saw, "" without a camera.
        wall_time_s: that the flight took.
        out_dir: where the flight was written.
    """
    truths = flown.truths
    hold, disconnect = hold_of(truths, referee.pull_max_n)
    duration_s = truths[-1].time_s if truths else 0.0
    log = referee.attempt_log(duration_s, Outcome(outcome))
    attempts = tuple(with_cause(attempt, flown) for attempt in log)
    return Result(
        scenario=scenario,
        seed=seed,
        outcome=outcome,
        success=succeeded(attempts),
        first_attempt=first_attempt_succeeded(attempts),
        cause=cause_of_flight(attempts, flown, outcome),
        unsafe=referee.unsafe,
        attempts=len(attempts),
        attempt_log=attempts,
        contact=referee.contact,
        hold=hold,
        disconnect=disconnect,
        fuel_kg=truths[-1].fuel_kg if truths else 0.0,
        collided_with=referee.collided_with,
        sensing=sensing,
        truth_navigation=sensing == "truth",
        background=background,
        nav=navigation_figures(flown.solutions, truths, mounting),
        heading=heading_figures(flown.solutions, truths),
        frames=frames,
        duration_s=duration_s,
        real_time_factor=duration_s / wall_time_s if wall_time_s > 0.0 else float("nan"),
        wall_time_s=wall_time_s,
        versions=versions(),
        timeline=timeline(flown.solutions),
        nav_by_range=() if sensing == "truth" else navigation_by_range(flown.solutions, truths, mounting),
        out_dir=None if out_dir is None else str(out_dir),
    )
