"""The light of the refuelling pod, which the receiver looks at before it closes and while it takes fuel.

    light(t) = red            where the drum does not answer at t - d,                                      (1)
               amber          else, with less hose wound in than the refuelling range begins at,
               green          within the range: fuel flows into a probe that is held,
               flashing amber beyond its inner limit

d is what the hose unit takes to call the drum dead; it shuts the fuel off at the same time. The rest is told by how far
the drum has turned, at once. Red says that the hose is dead and no contact is to be made, amber that it is ready, green
that fuel flows, flashing amber that the receiver is to ease back [KDC-10 procedures brief].
Not modelled: flashing red; flashing amber ahead of the inner limit, on the way to it; a green that waits for flow; a
light that is out, or not seen.
"""

from collections.abc import Callable
from dataclasses import dataclass

from dockair.messages import Light, PodSignal
from dockair.sim.hose.reel import ReelParameters, reel_light


@dataclass(frozen=True, slots=True, kw_only=True)
class PodLightParameters:
    """assets/parameters/pod_light.toml."""

    delay_s: float  #: d


class PodLight:
    """Eq. (1).

    Args:
        is_dead: whether the drum at a time [s] is dead in a way that can be noticed.
        reel: the reel's sheet.
        parameters: its own sheet.
    """

    def __init__(self, is_dead: Callable[[float], bool], reel: ReelParameters, parameters: PodLightParameters) -> None:
        self._is_dead, self._reel, self._parameters = is_dead, reel, parameters
        self._shown = Light.AMBER

    def is_red(self, time_s: float) -> bool:
        """Whether the hose unit knows at a time that the drum is dead."""
        return self._is_dead(time_s - self._parameters.delay_s)

    def due(self, time_s: float, position_m: float) -> PodSignal | None:
        """Return what the light begins to show now, None while it goes on as before.

        Args:
            time_s: now; asked at increasing times.
            position_m: hose wound in.
        """
        light = reel_light(position_m, self.is_red(time_s), self._reel)
        if light is self._shown:
            return None
        self._shown = light
        return PodSignal(time_stamp_s=time_s, light=light)
