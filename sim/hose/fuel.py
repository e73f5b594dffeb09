"""Fuel that flows through the hose into the held probe.

The pod's valve is open while the coupling holds the probe and the pod's light is green: the reel stands in its
refuelling range, not known to be dead.
The flow follows with a first-order lag, of its own for opening and for closing:

    tau dQ/dt = Q_v - Q,          Q_v = Q_0 with the valve open, 0 with it shut                           (1)
    m' = Q                                                                                                (2)

both solved exactly over a tick. Coupling and nozzle have valves of their own, which shut when they part: Q = 0 at once.

Not modelled: the hose's pressure, surge, the momentum of what flows, fuel left in hose and nozzle; the receiver's mass,
inertia and trim, which do not change (at 20 kg/s a hold of 10 s brings 2 per cent of a fighter's mass); the hose's,
which is full all the time; a receiver whose tanks are full.
Source of the flow: assets/parameters/fuel.toml.
"""

from dataclasses import dataclass

import numpy as np

from dockair.messages import Light


@dataclass(frozen=True, slots=True, kw_only=True)
class FuelParameters:
    """assets/parameters/fuel.toml."""

    flow_kg_s: float
    opening_time_s: float
    closing_time_s: float


class Fuel:
    """What has flowed, Eqs. (1) and (2).

    Args:
        parameters: sheet.
        step_s: physics step.

    Attributes:
        flow_kg_s: Q.
        given_kg: m.
    """

    def __init__(self, parameters: FuelParameters, step_s: float) -> None:
        p = parameters
        self._full_kg_s, self._step_s = p.flow_kg_s, step_s
        self._opening, self._closing = (
            (tau, float(-np.expm1(-step_s / tau))) for tau in (p.opening_time_s, p.closing_time_s)
        )
        self.flow_kg_s, self.given_kg = 0.0, 0.0

    def step(self, light: Light, latched: bool) -> None:
        """Advance by one tick.

        Args:
            light: of the pod.
            latched: the coupling holds the probe.
        """
        if not latched:
            self.flow_kg_s = 0.0
            return
        is_open = light is Light.GREEN
        wanted, (tau, blend) = (self._full_kg_s, self._opening) if is_open else (0.0, self._closing)
        lag = wanted - self.flow_kg_s
        self.given_kg += wanted * self._step_s - lag * tau * blend
        self.flow_kg_s += blend * lag
