"""Time as an integer count of physics ticks.

Rates that do not divide the physics rate are refused, so that no sensor ever falls between two ticks.
"""

from dataclasses import dataclass

from dockair.errors import DockairError


@dataclass(frozen=True, slots=True)
class Clock:
    """The physics rate and what follows from it.

    Args:
        physics_rate_hz: ticks per second of simulated time.
    """

    physics_rate_hz: int

    def __post_init__(self) -> None:
        if self.physics_rate_hz <= 0:
            raise DockairError("physics_rate_hz", expected="a positive integer", got=self.physics_rate_hz)

    @property
    def step_s(self) -> float:
        """Length of one tick [s]."""
        return 1.0 / self.physics_rate_hz

    def seconds(self, tick: int) -> float:
        """Time of a tick [s]."""
        return tick / self.physics_rate_hz

    def ticks_per(self, rate_hz: int, where: str) -> int:
        """Ticks between two samples at a rate.

        Args:
            rate_hz: rate of a sensor or of the controller [Hz].
            where: its key, for the error.

        Raises:
            DockairError: the rate does not divide the physics rate.
        """
        if rate_hz <= 0 or self.physics_rate_hz % rate_hz:
            divisors = [str(d) for d in range(1, self.physics_rate_hz + 1) if self.physics_rate_hz % d == 0]
            raise DockairError(
                where,
                expected=f"a rate that divides the physics rate {self.physics_rate_hz} Hz",
                got=rate_hz,
                exists=divisors,
            )
        return self.physics_rate_hz // rate_hz
