"""How well the flights of a group kept the receiver's own heading, against the truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.report.groups import Row


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Headings:
    """Of the flights that kept one [deg]."""

    at_end_deg: Array  #: (n,) believed less true at a flight's end; NaN where the heading was lost
    sigma_deg: Array  #: (n,) what the navigation expected of it
    rms_deg: Array  #: (n,) over each flight
    largest_deg: Array  #: (n,) in each flight
    beyond_3_sigma: Array  #: (n,) part of each flight

    @property
    def flights(self) -> int:
        """That kept a heading."""
        return len(self.at_end_deg)

    @property
    def lost(self) -> int:
        """Flights that had none at their end."""
        return int(np.isnan(self.at_end_deg).sum())


def headings_of(rows: Sequence[Row]) -> Headings | None:
    """Return the headings of flights, None where none was kept, or rows are of before there was a column for it."""
    kept = [row for row in rows if row.get("heading_error_rms_deg") is not None]
    if not kept:
        return None

    def column(name: str) -> Array:
        return np.array([math.nan if row[name] is None else row[name] for row in kept], dtype=float)

    return Headings(
        at_end_deg=column("heading_error_deg"),
        sigma_deg=column("heading_sigma_deg"),
        rms_deg=column("heading_error_rms_deg"),
        largest_deg=column("heading_error_max_deg"),
        beyond_3_sigma=column("heading_beyond_3_sigma"),
    )


def rms(values: Array) -> float:
    """Return the root mean square of the values that there are; NaN of none."""
    there = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else math.nan
