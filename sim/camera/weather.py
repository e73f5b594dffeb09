"""The weather of a flight, as far as the camera sees it."""

import math
from dataclasses import dataclass

from dockair.errors import DockairError


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """The flight's weather, as the scenario says."""

    cloud_cover: float = 0.0  #: share of the layer above that is cloud, 0 to 1
    cloud_optical_depth: float = 8.0  #: mean where there is cloud, straight through
    visibility_m: float = 100e3  #: at flight level
    night: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.cloud_cover <= 1.0:
            raise DockairError("weather.cloud_cover", expected="0 to 1", got=self.cloud_cover)
        if not 0.0 <= self.cloud_optical_depth < math.inf:
            raise DockairError("weather.cloud_optical_depth", expected="a depth >= 0", got=self.cloud_optical_depth)
        if not self.visibility_m > 0.0:
            raise DockairError("weather.visibility_m", expected="a distance > 0 m", got=self.visibility_m)
