"""What one flight, and what a campaign of many, must show for its scenario's claim to hold.

Of a campaign's rows (one a flight: dockair/scenarios/campaign) a flight that crashed counts as flown without success.
Where no rate is asked for, every flight has to show what one flight must.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from dockair.errors import DockairError
from dockair.nav.guidance.phases import REFUELLED
from dockair.scenarios.tables.table import Table

if TYPE_CHECKING:
    from dockair.scenarios.judgement.attempts import RefereeLimits

OutcomeName = Literal["contact", "miss", "rim_strike", "abort", "collision", "timeout", "diverged"]

Row = Mapping[str, Any]
_Rate = Annotated[float | None, Field(ge=0.0, le=1.0)]
_UNTOUCHED = ("abort", "miss")  # outcomes of a flight that ended clear without having touched anything


class Accept(Table):
    """What must be shown for the claim to hold; empty when the scenario claims nothing in figures."""

    outcome: OutcomeName | None = None  #: of one flight
    radial_offset_max_m: float | None = Field(default=None, gt=0.0)  #: of one flight's contact
    closure_speed_min_m_s: float | None = Field(default=None, ge=0.0)  #: of a contact
    closure_speed_max_m_s: float | None = Field(default=None, gt=0.0)  #: of a contact
    #: Part of a campaign's flights whose first attempt ended in a contact inside the limits.
    first_attempt_rate_min: _Rate = None
    success_rate_min: _Rate = None  #: part of the flights with such a contact in any of their attempts
    refuelled_rate_min: _Rate = None  #: part of the flights that held the probe until they had refuelled
    #: Part of the flights that ended in such a contact, or went away without touching, with nothing unsafe.
    clean_rate_min: _Rate = None
    closure_rate_min: _Rate = None  #: part of the contacts whose speed lies between the two closure speeds
    radial_offset_median_max_m: float | None = Field(default=None, gt=0.0)  #: median over a campaign's contacts
    unsafe_max: int = Field(default=0, ge=0)  #: flights of a campaign in which anything was unsafe

    @model_validator(mode="after")
    def _can_be_met(self) -> Self:
        low, high = self.closure_speed_min_m_s, self.closure_speed_max_m_s
        if low is not None and high is not None and low > high:
            where, expected = "accept.closure_speed_max_m_s", f"at least closure_speed_min_m_s = {low:g}"
            raise DockairError(where, expected=expected, got=high)
        if self.closure_rate_min is not None and low is None and high is None:
            expected = "closure_speed_min_m_s or closure_speed_max_m_s beside it: the part of contacts between them"
            raise DockairError("accept.closure_rate_min", expected=expected, got=self.closure_rate_min)
        return self

    @property
    def claims_figures(self) -> bool:
        """Whether anything is asked for."""
        return any(value is not None for key, value in self.model_dump().items() if key != "unsafe_max")

    @property
    def claims_rates(self) -> bool:
        """Whether anything is asked for that only a campaign can show."""
        return any(
            getattr(self, key) is not None for key in (*_RATES, "closure_rate_min", "radial_offset_median_max_m")
        )

    @property
    def in_words(self) -> str:
        """What is asked for, in one line; "" where nothing is."""
        low, high = self.closure_speed_min_m_s, self.closure_speed_max_m_s
        parts = [] if self.outcome is None else [self.outcome.replace("_", " ")]
        parts += [f"{100.0 * rate:g} % {words}" for key, words in _IN_WORDS.items() if (rate := getattr(self, key))]
        if self.radial_offset_max_m is not None:
            parts.append(f"within {self.radial_offset_max_m:g} m")
        if self.radial_offset_median_max_m is not None:
            parts.append(f"median offset {self.radial_offset_median_max_m:g} m")
        if low is not None or high is not None:
            speeds = f"at {low or 0.0:g} to {high:g} m/s" if high is not None else f"from {low:g} m/s on"
            share = "" if self.closure_rate_min is None else f"{100.0 * self.closure_rate_min:g} % "
            parts.append(f"{share}{speeds}")
        if parts and self.unsafe_max:
            parts.append(f"unsafe in at most {self.unsafe_max}")
        return ", ".join(parts)

    def shortfalls(
        self,
        outcome: str,
        radial_offset_m: float | None,
        closure_speed_m_s: float | None,
        unsafe: Sequence[str] = (),
        *,
        angle_deg: float | None = None,
        refuelled: bool = True,
    ) -> list[str]:
        """Return a line for each figure that one flight did not reach; those of a contact are None without one."""
        lines = [f"unsafe: {what}" for what in unsafe]
        if self.outcome is not None and outcome != self.outcome:
            lines.append(f"outcome {outcome}, wanted {self.outcome}")
        if self.refuelled_rate_min and outcome == "contact" and not refuelled:
            lines.append("docked, and has not refuelled")
        offset_max_m, speed_max_m_s = self.radial_offset_max_m, self.closure_speed_max_m_s
        angle_max_deg: float | None = None
        if self.clean_rate_min is not None and self.outcome is None:
            if outcome not in ("contact", *_UNTOUCHED):
                lines.append(f"outcome {outcome}, wanted a contact or a clean departure")
            good = _good_contact()
            offset_max_m = offset_max_m or good.radial_offset_m
            speed_max_m_s = speed_max_m_s or good.closure_speed_m_s
            angle_max_deg = good.angle_deg
        limits = (
            ("radial offset", radial_offset_m, None, offset_max_m, "m"),
            ("closure speed", closure_speed_m_s, self.closure_speed_min_m_s, speed_max_m_s, "m/s"),
            ("angle", angle_deg, None, angle_max_deg, "deg"),
        )
        for label, value, low, high, unit in limits:
            if value is None or (low is None and high is None):
                continue
            low, high = low or 0.0, np.inf if high is None else high
            if not low <= value <= high:  # also when the value is NaN
                lines.append(f"{label} {value:.3f} {unit}, wanted {low:g} to {high:g}")
        return lines

    def judge(self, rows: Sequence[Row]) -> list[str]:
        """Return a line for each figure that a campaign did not reach.

        Args:
            rows: one scenario's flights, one a row.

        Raises:
            DockairError: no rows, or flights with and without a camera mixed.
        """
        _check(rows)
        unsafe = [row["seed"] for row in rows if row["unsafe"]]
        lines = []
        if len(unsafe) > self.unsafe_max:
            lines.append(
                f"unsafe in {len(unsafe)} of {len(rows)} flights, wanted at most {self.unsafe_max}: {_some(unsafe)}"
            )
        if not self.claims_rates:
            return lines + self._each(rows)
        for key, (label, holds) in _RATES.items():
            lines += _rate(label, sum(bool(holds(row)) for row in rows), len(rows), getattr(self, key))
        return lines + self._of_contacts([row for row in rows if row["outcome"] == "contact"])

    def _of_contacts(self, contacts: Sequence[Row]) -> list[str]:
        lines = []
        if self.closure_rate_min is not None:
            low, high = self.closure_speed_min_m_s or 0.0, self.closure_speed_max_m_s or np.inf
            inside = sum(low <= _number(row["closure_speed_m_s"]) <= high for row in contacts)
            lines += _rate(f"contacts at {low:g} to {high:g} m/s", inside, len(contacts), self.closure_rate_min)
        if self.radial_offset_median_max_m is not None:
            median_m = float(np.median([_number(row["radial_offset_m"]) for row in contacts])) if contacts else np.nan
            if not median_m <= self.radial_offset_median_max_m:
                wanted, got = self.radial_offset_median_max_m, f"{median_m:.3f} m" if contacts else "of no contact"
                lines.append(f"median radial offset {got}, wanted at most {wanted:g}")
        return lines

    def _each(self, rows: Sequence[Row]) -> list[str]:
        """Hold every flight against what one flight must show."""
        short = []
        for row in rows:
            offset_m = speed_m_s = None
            if row["outcome"] == "contact":
                offset_m, speed_m_s = _number(row["radial_offset_m"]), _number(row["closure_speed_m_s"])
            if row["error"] or self.shortfalls(row["outcome"], offset_m, speed_m_s):
                short.append(row["seed"])
        return [f"{len(short)} of {len(rows)} flights fall short: {_some(short)}"] if short else []


def is_clean(row: Row) -> bool:
    """Return whether a flight made contact inside the limits or went away without touching, and nothing was unsafe."""
    return not row["error"] and not row["unsafe"] and bool(row["success"] or row["outcome"] in _UNTOUCHED)


def has_refuelled(row: Row) -> bool:
    """Return whether a flight that did not crash has refuelled."""
    reasons = [entry["reason"] for entry in json.loads(row.get("timeline") or "[]") or ()]
    return not row["error"] and was_refuelled(row.get("fuel_kg") or 0.0, reasons)


def was_refuelled(fuel_kg: float, reasons: Sequence[str]) -> bool:
    """Return whether a hold was flown to its end, and fuel came: of a contact that is called back neither is so."""
    return fuel_kg > 0.0 and REFUELLED in reasons


#: Key -> what it counts, and whether a row counts.
_RATES: dict[str, tuple[str, Callable[[Row], bool]]] = {
    "first_attempt_rate_min": ("contacts at the first attempt", lambda row: not row["error"] and row["first_attempt"]),
    "success_rate_min": ("contacts in any attempt", lambda row: not row["error"] and row["success"]),
    "refuelled_rate_min": ("refuelled flights", has_refuelled),
    "clean_rate_min": ("contacts or clean departures", is_clean),
}
_IN_WORDS = {
    "first_attempt_rate_min": "at the first attempt",
    "success_rate_min": "within all",
    "refuelled_rate_min": "refuelled",
    "clean_rate_min": "contact or clean departure",
}


def _good_contact() -> "RefereeLimits":
    # loads an engine, which who reads a scenario does not need
    from dockair.scenarios.judgement.attempts import RefereeLimits

    return RefereeLimits()


def _check(rows: Sequence[Row]) -> None:
    if not rows:
        raise DockairError("rows", expected="at least one flight", got=0)
    kinds = sorted({str(row["sensing"]) for row in rows if not row["error"]})
    if len(kinds) > 1:
        raise DockairError("rows", expected="flights that are comparable: one kind of sensing", got=kinds)


def _rate(label: str, count: int, of: int, wanted: float | None) -> list[str]:
    if wanted is None or (of > 0 and count / of >= wanted):  # wanted * of may round to above a whole number
        return []
    return [f"{label} {count} of {of}, wanted at least {100.0 * wanted:g} %"]


def _number(value: float | None) -> float:
    """A figure of a contact; what could not be measured is inside no limit."""
    return float("nan") if value is None else value


def _some(seeds: Sequence[int]) -> str:
    shown = ", ".join(str(seed) for seed in seeds[:5])
    return f"seeds {shown}" + (", ..." if len(seeds) > 5 else "")
