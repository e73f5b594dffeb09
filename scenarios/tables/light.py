"""The tables of a scenario that say what the camera looks through and into, and how it is run."""

from typing import Literal

import numpy as np
from pydantic import Field

from dockair.rotations import Array
from dockair.scenarios.tables.table import Table
from dockair.sim.camera.weather import Weather as SeenWeather


class Sun(Table):
    """Where the Sun stands, seen from the receiver in level flight."""

    present: bool = True  #: false: daylight from above, but no disc, glints or stray light; `weather.night` is dark
    azimuth_deg: float = Field(default=180.0, ge=-360.0, le=360.0)  #: 0 straight ahead, positive to the left
    elevation_deg: float = Field(default=35.0, ge=-10.0, le=90.0)  #: above the horizon

    @property
    def direction_W(self) -> Array | None:
        """(3,) unit vector toward the Sun in W, None without Sun."""
        if not self.present:
            return None
        azimuth, elevation = np.radians(self.azimuth_deg), np.radians(self.elevation_deg)
        across = np.cos(elevation)
        return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])

    @property
    def lit_from_W(self) -> Array:
        """(3,) unit vector toward where the scene's sunlight comes from: the Sun, or overhead without its image."""
        sun_W = self.direction_W
        return np.array([0.0, 0.0, 1.0]) if sun_W is None else sun_W


class Weather(Table):
    """What lies between and behind: clouds, haze, night."""

    cloud_cover: float = Field(default=0.0, ge=0.0, le=1.0)  #: part of the sky under the layer of broken cloud
    cloud_optical_depth: float = Field(default=8.0, gt=0.0, le=100.0)  #: mean, where there is cloud
    visibility_m: float = Field(default=100e3, ge=50.0, le=300e3)  #: meteorological optical range
    night: bool = False  #: no Sun, no daylight

    @property
    def as_seen(self) -> SeenWeather:
        """As the camera takes it."""
        return SeenWeather(**self.model_dump())


class CameraOptions(Table):
    """How the camera is run and simulated."""

    sensing: Literal["frames", "measurements"] = "frames"  #: "measurements": no picture, LEDs with fitted errors
    filter: Literal["long_pass", "band_pass"] = "long_pass"  #: before the lens: sheet `filter_<name>`
    exposure: Literal["auto", "fixed"] = "auto"  #: "auto": metered; "fixed": sheet `exposure`, exposure_s
    #: How solids are drawn: "analytic" is quicker and the same on every machine; "auto": MuJoCo's where the machine has
    #: OpenGL.
    background: Literal["auto", "mujoco", "analytic"] = "analytic"
