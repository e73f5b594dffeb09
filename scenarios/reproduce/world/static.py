"""The hose at rest: MuJoCo's chain, let go straight and braked until it hangs still, against three other solutions.

`reference` is the published-parameter solution of assets/reference/hose_static.csv; `ours` also has the shape at rest
link by link (`rest_...`, what a flight starts from) and a continuous cable integrated here (`cable_...`).
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name, read_reference
from dockair.scenarios.reproduce.world.hose_cases import HoseCase, continuous_cable

ID = "world/static"
TITLE = "hose and drogue at rest in six conditions: MuJoCo's chain, rigid links, continuous cable"
_SOURCE = "assets/reference/hose_static.csv, parameters of RflySim/RflySimAAR"
_SETTLING_S, _BRAKE_1_S = 14.0, 1.0  # the slowest swing, of 3.3 s, is then within 0.1 mm of its rest
_STEP_S = 2e-3  # rest does not depend on it
_POINTS = 60
_SIZE_IN, _DPI = (11.0, 3.8), 110


def reproduce(out: Path | None) -> dict[str, Any]:
    """Settle the six; shapes in `out`."""
    rows, drawn = [], []
    for printed in read_reference("hose_static"):
        value = {key: float(text) for key, text in printed.items()}
        case = HoseCase.of(
            value["airspeed_m_s"],
            value["altitude_m"],
            {"length_m": value["length_m"]},
            {"drag_diameter_m": value["drogue_diameter_m"], "mass_kg": value["drogue_mass_kg"]},
        )
        name = f"{case.name}, {value['length_m']:g} m of hose, {value['drogue_diameter_m']:.2f} m drogue"
        ours, shape = _settled(case)
        reference = {key: value[key] for key in ("aft_m", "below_m", "root_tension_n", "drogue_tension_n")}
        rows.append({"case": name, "ours": ours, "reference": reference})
        drawn.append((name, shape, continuous_cable(case, _POINTS)[0]))
    if out is not None:
        _draw(drawn, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _settled(case: HoseCase) -> tuple[dict[str, float], Array]:
    """Where the hose's end hangs and both tensions; and (links + 1, 2) joints, aft and below."""
    rig = case.rig(_STEP_S)
    assert rig.rest is not None
    rig.put(np.tile([1.0, 0.0, 0.0], (case.hose.links + 1, 1)))
    rig.relax(_SETTLING_S, _BRAKE_1_S)
    end, tensions = rig.hose_end(), rig.tensions()
    places, tension = continuous_cable(case)
    rest = rig.rest
    ours = {
        "aft_m": -end[0],
        "below_m": -end[2],
        "root_tension_n": tensions[0],
        "drogue_tension_n": tensions[1],
        "rest_aft_m": -rest.p_WH[-1, 0],
        "rest_below_m": -rest.p_WH[-1, 2],
        "rest_root_tension_n": rest.root_tension_n,
        "rest_drogue_tension_n": rest.drogue_tension_n,
        "cable_aft_m": places[-1, 0],
        "cable_below_m": places[-1, 1],
        "cable_root_tension_n": tension[0],
        "cable_drogue_tension_n": tension[-1],
    }
    return {key: float(value) for key, value in ours.items()}, -rig.joints()[:, [0, 2]]


def _draw(drawn: list[tuple[str, Array, Array]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    axes = figure.subplots()
    for k, (name, joints, cable) in enumerate(drawn):
        axes.plot(joints[:, 0], joints[:, 1], "o", ms=3.5, color=f"C{k}", label=name)
        axes.plot(cable[:, 0], cable[:, 1], lw=1.0, color=f"C{k}")
    axes.invert_yaxis()
    axes.set_aspect("equal")
    axes.set(
        xlabel="aft of the exit [m]", ylabel="below [m]", title="joints of the settled chain; line: continuous cable"
    )
    axes.legend(frameon=False, fontsize=8, loc="lower left")
    figure.savefig(path)
