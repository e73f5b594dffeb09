"""The light of the refuelling pod, which the receiver looks at before it closes.

    red(t) = the drum does not answer at t - d                                                              (1)

d is what the hose unit takes to call the drum dead; it shuts the fuel off at the same time. Red says that the hose is
dead and no contact is to be made, amber that it is ready [KDC-10 procedures brief].
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
    """Eq. (1).

    Args:
        is_dead: whether the drum at a time [s] is dead in a way that can be noticed.
        parameters: its sheet.
    """

    def __init__(self, is_dead: Callable[[float], bool], parameters: PodLightParameters) -> None:
        self._is_dead, self._parameters = is_dead, parameters
        self._red = False

    def is_red(self, time_s: float) -> bool:
        """Whether the hose unit knows at a time that the drum is dead."""
        return self._is_dead(time_s - self._parameters.delay_s)

    def due(self, time_s: float) -> PodSignal | None:
        """What the light begins to show now, None while it goes on as before; asked at increasing times."""
        red = self.is_red(time_s)
        if red == self._red:
            return None
        self._red = red
        return PodSignal(time_stamp_s=time_s, red=red)
