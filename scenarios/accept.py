"""What a flight must show for its scenario's claim to hold."""

from typing import Literal

import numpy as np
from pydantic import Field

from dockair.scenarios.table import Table

OutcomeName = Literal["contact", "miss", "rim_strike", "abort", "collision", "timeout", "diverged"]


class Accept(Table):
    """What a flight must show for its claim to hold; empty when the scenario claims nothing in figures."""

    outcome: OutcomeName | None = None
    radial_offset_max_m: float | None = Field(default=None, gt=0.0)
    closure_speed_min_m_s: float | None = Field(default=None, ge=0.0)
    closure_speed_max_m_s: float | None = Field(default=None, gt=0.0)

    @property
    def claims_figures(self) -> bool:
        """Whether anything is asked for."""
        return any(value is not None for value in self.model_dump().values())

    def shortfalls(self, outcome: str, radial_offset_m: float | None, closure_speed_m_s: float | None) -> list[str]:
        """Return a line for each figure that the flight did not reach; the two figures are None without contact."""
        lines = []
        if self.outcome is not None and outcome != self.outcome:
            lines.append(f"outcome {outcome}, wanted {self.outcome}")
        limits = (
            ("radial offset", radial_offset_m, 0.0, self.radial_offset_max_m, "m"),
            ("closure speed", closure_speed_m_s, self.closure_speed_min_m_s, self.closure_speed_max_m_s, "m/s"),
        )
        for label, value, low, high, unit in limits:
            if value is None:
                continue
            low, high = low or 0.0, np.inf if high is None else high
            if not low <= value <= high:  # also when the value is NaN
                lines.append(f"{label} {value:.3f} {unit}, wanted {low:g} to {high:g}")
        return lines
