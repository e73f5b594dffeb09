"""A vertical swing of metres, and why it dies so slowly: the steady air gives back what resistance takes.

Hose and drogue are let go in the shape of their first vertical mode, their end so many metres up or down. From one
upper turning point to the next, at which nothing moves, the stored energy falls by what the air's resistance to the
motion takes, less what is given back:

    k/2 (z_1^2 - z_2^2) = D - G,          k = |lambda|^2 a' M a                                           (1)

with z the end's height over its rest; lambda the mode's eigenvalue and a its shape, the end 1 m up; M the chain's mass
matrix. D is found as the work of the air's loads less that of its loads on a chain at rest in the same shapes. G is
then what those loads at rest give back around the loop: they follow the links' directions and have no potential. In a
small swing G is 0, as far as its shape is real; it is not quite.

Not in it: the reel, which is held (`tests/sim/test_hose_swing.py` has it work), gusts; a stiffness k that changes with
the swing, as the period does by 4 per cent.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world.hose_cases import HoseCase
from dockair.sim.hose.swing import LinearSwing

ID = "world/large-swing"
TITLE = "what a large vertical swing of the hose loses in a period, and what the steady air gives back"
_SOURCE = "a small swing: eigenvalue of the linearised chain, nothing given back, dockair.sim.hose.swing"
_CASE = HoseCase.of(150.0, 6096.0)
_RELEASED_M = (0.3, 1.0, 1.8, 2.6, 3.4, -3.0, -3.4)
_RUN_S, _RATE_HZ = 14.0, 1000
_LOOP = (
    1  # the loop that is weighed: from the second upper turning point on, when the shape of the release is forgotten
)
_SIZE_IN, _DPI = (10.0, 4.0), 110


class Swing(NamedTuple):
    """One run, a row a step."""

    released_m: float
    height_m: Array  #: (n,) of the hose's end over its rest
    resistance_w: Array  #: (n,) power of the air's resistance to the motion, negative

    @property
    def tops(self) -> NDArray[np.intp]:
        """Rows of the upper turning points."""
        z = self.height_m
        return np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1


def let_go(released_m: float, duration_s: float = _RUN_S, case: HoseCase = _CASE) -> Swing:
    """Let the hose go in the shape of its first vertical mode."""
    linear = LinearSwing(case.hose, case.drogue, case.wind_W, case.air, "vertical")
    rig, count = case.rig(1.0 / _RATE_HZ), round(duration_s * _RATE_HZ)
    rest_z = float(rig.hose_end()[2])
    rig.put(linear.directions(linear.modes()[0], released_m, 0.0))
    height, resistance = np.empty(count), np.empty(count)
    for k in range(count):
        rig.step()
        resistance[k] = rig.air_powers_w()[1]
        height[k] = rig.hose_end()[2] - rest_z
    return Swing(released_m, height, resistance)


def stiffness_n_m(case: HoseCase = _CASE) -> float:
    """Stiffness k of Eq. (1) [N/m]."""
    linear = LinearSwing(case.hose, case.drogue, case.wind_W, case.air, "vertical")
    mode = linear.modes()[0]
    return float(abs(mode.eigenvalue_1_s) ** 2 * np.real(mode.shape.conj() @ linear.M @ mode.shape))


def weigh(swing: Swing, stiffness: float, loop: int = _LOOP) -> dict[str, float]:
    """Figures of Eq. (1) of one loop."""
    first, second = swing.tops[loop : loop + 2]
    z_1, z_2 = float(swing.height_m[first]), float(swing.height_m[second])
    amplitude = 0.5 * (z_1 - float(swing.height_m[first:second].min()))
    taken = -float(np.sum(swing.resistance_w[first:second])) / _RATE_HZ
    return {
        "amplitude_m": amplitude,
        "period_s": float(second - first) / _RATE_HZ,
        "lost_in_a_period": 1.0 - z_2 / z_1,
        "taken_j_per_m2": taken / amplitude**2,
        "given_back": 1.0 - 0.5 * stiffness * (z_1**2 - z_2**2) / taken,
    }


def reproduce(out: Path | None) -> dict[str, Any]:
    """Let swings of 0.3 to 3.4 m go; height and energy in `out`."""
    linear = LinearSwing(_CASE.hose, _CASE.drogue, _CASE.wind_W, _CASE.air, "vertical")
    value = linear.modes()[0].eigenvalue_1_s
    small = {"lost_in_a_period": float(-np.expm1(2.0 * np.pi * value.real / value.imag)), "given_back": 0.0}
    stiffness = stiffness_n_m()
    swings = [let_go(released) for released in _RELEASED_M]
    rows = [
        {"case": _name(swing.released_m), "ours": weigh(swing, stiffness), "reference": {} if k else small}
        for k, swing in enumerate(swings)
    ]
    if out is not None:
        _draw(swings, stiffness, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _name(released_m: float) -> str:
    return f"let go {abs(released_m):g} m {'up' if released_m > 0.0 else 'down'}"


def _draw(swings: list[Swing], stiffness: float, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    left, right = figure.subplots(1, 2)
    for swing in swings:
        time_s = np.arange(len(swing.height_m)) / _RATE_HZ
        (line,) = left.plot(time_s, swing.height_m, lw=0.9, label=_name(swing.released_m))
        loops = [weigh(swing, stiffness, loop) for loop in range(1, len(swing.tops) - 1)]
        over = [one["amplitude_m"] for one in loops]
        right.plot(over, [one["taken_j_per_m2"] for one in loops], "o-", color=line.get_color(), lw=0.8, ms=3)
        kept = [one["taken_j_per_m2"] * one["given_back"] for one in loops]
        right.plot(over, kept, "s--", color=line.get_color(), lw=0.8, ms=3)
    left.set(xlabel="time [s]", ylabel="hose's end over its rest [m]")
    left.legend(frameon=False, fontsize=7, ncols=2)
    right.set(xlabel="amplitude [m]", ylabel="energy of a loop over amplitude² [J/m²]", ylim=(0.0, None))
    right.set_title("circles: taken by resistance; squares: given back by the steady air", fontsize=8)
    figure.savefig(path)
