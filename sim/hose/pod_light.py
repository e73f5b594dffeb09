"""The light of the refuelling pod, which the receiver looks at before it closes.

    red(t) = the drum is known to be dead at t - d                                                          (1)

Red says that the hose is dead and no contact is to be made, amber that it is ready [KDC-10 procedures brief].
Not modelled: green while fuel flows, flashing amber near the inner limit, flashing red; a light that is out, or not
seen.
"""

from collections.abc import Callable
from dataclasses import dataclass

from dockair.messages import PodSignal


@dataclass(frozen=True, slots=True, kw_only=True)
class PodLightParameters:
    """assets/parameters/pod_light.toml."""

    delay_s: float  #: d


class PodLight:
    """Eq. (1), asked at increasing times.

    Args:
        is_dead: whether the drum is known to be dead at a time [s].
        parameters: its sheet.
    """

    def __init__(self, is_dead: Callable[[float], bool], parameters: PodLightParameters) -> None:
        self._is_dead, self._parameters = is_dead, parameters
        self._red = False

    def due(self, time_s: float) -> PodSignal | None:
        """What the light begins to show now, None while it goes on as before."""
        red = self._is_dead(time_s - self._parameters.delay_s)
        if red == self._red:
            return None
        self._red = red
        return PodSignal(time_stamp_s=time_s, red=red)
