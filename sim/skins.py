"""What is seen of tanker and receiver: lofted skins, from tables of stations and sections in `assets/outlines`.

A drawing, not physics, like `outlines`: those primitives are what is struck, these skins what the camera, the LEDs and
the Sun meet. Proportions are the tables'; the tanker's scale goes with its sheet, the receiver's nose with its
mounting. The refuelling unit ends at the hose's exit and hangs on a pylon from whatever is above it, fuselage or wing.
Not drawn: control surfaces, undercarriage, inside of intakes, markings.
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from dockair.calibration import Mounting
from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.lofts import Mesh, body, mirrored, surface
from dockair.sim.outlines import TankerParameters, nose_x_m

_FULL = 1.0
_NEAREST = 4  # corners whose mean height is that of the part above
_FARTHEST_M = 6.0  # and how far aside the nearest may be: on the fuselage they stand as much as 3.3 m off its middle


class Skin(NamedTuple):
    """One part of an aircraft's surface, in its axes."""

    name: str
    mesh: Mesh
    shade: float  #: reflectance over the aircraft's own


def outline_names() -> list[str]:
    """Names of the tables that exist."""
    folder = files("dockair.assets").joinpath("outlines")
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def tanker_skins(tanker: TankerParameters) -> list[Skin]:
    """Skin of the tanker in its own axes T, refuelling unit at the hose's exit included."""
    table = _table("transport")
    reference = table["reference"]
    along, across = tanker.length_m / reference["length_m"], tanker.span_m / reference["span_m"]
    thick = tanker.fuselage_radius_m / reference["radius_m"]
    stretch = np.array([along, thick, thick, across, thick, _FULL])
    skins = [skin for part in table["body"] for skin in _bodies(part, np.array(part["stations"]) * stretch)]
    stretch = np.array([along, across, thick, along, _FULL, _FULL])
    for part in table["surface"]:
        skins += _surfaces(part, np.array(part["sections"]) * stretch)
    return skins + _unit(table["unit"], tanker, skins)


def receiver_skins(mounting: Mounting, outline: str = "fighter") -> list[Skin]:
    """Skin of the receiver in body axes B, without its probe.

    Args:
        mounting: of the probe, behind whose tip the nose ends.
        outline: name of its table.

    Raises:
        DockairError: no such table; no room for a nose.
    """
    table = _table(outline)
    stretch = nose_x_m(mounting) / table["reference"]["nose_x_m"]
    skins = []
    for part in table["body"]:
        stations = np.array(part["stations"])
        stations[:, 0] *= np.where(stations[:, 0] > 0.0, stretch, _FULL)
        skins += _bodies(part, stations)
    return skins + [skin for part in table["surface"] for skin in _surfaces(part, np.array(part["sections"]))]


@cache
def _table(name: str) -> Mapping[str, Any]:
    path = files("dockair.assets").joinpath("outlines", f"{name}.toml")
    if not path.is_file():
        raise DockairError("outline", expected="a table of an aircraft's outline", got=name, exists=outline_names())
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _bodies(part: Mapping[str, Any], stations: Array) -> list[Skin]:
    return _sides(part, body(stations, part["slices"], part["finer"]))


def _surfaces(part: Mapping[str, Any], sections: Array) -> list[Skin]:
    return _sides(part, surface(sections, part["points"]))


def _sides(part: Mapping[str, Any], mesh: Mesh) -> list[Skin]:
    name, shade = part["name"], part.get("shade", _FULL)
    if not part.get("mirrored", False):
        return [Skin(name, mesh, shade)]
    return [Skin(f"{name}_left", mesh, shade), Skin(f"{name}_right", mirrored(mesh), shade)]


def _unit(part: Mapping[str, Any], tanker: TankerParameters, skins: list[Skin]) -> list[Skin]:
    """The refuelling unit and its pylon, which reaches up to the middle of what is above it."""
    length, radius, (x, y, z) = tanker.pod_length_m, tanker.pod_radius_m, tanker.exit_m
    stations = np.array(part["stations"]) * [length, radius, radius, _FULL, _FULL, _FULL] + [x, 0.0, 0.0, y, z, 0.0]
    pod = Skin("pod", body(stations, part["slices"], part["finer"]), part["shade"])
    chord = part["pylon_chord"] * length
    middle_x = x + 0.5 * length
    top_z = _height_over(skins, middle_x, float(y), float(z))
    if top_z is None:
        expected = "a place below the fuselage or a wing"
        raise DockairError("tanker.exit_m", expected=expected, got=np.asarray(tanker.exit_m).tolist())
    lead = middle_x + 0.5 * chord
    ratio = part["pylon_thickness"]
    low = [lead, y, z, chord, ratio, 0.0]
    high = [lead + part["pylon_rake"] * (top_z - z), y, top_z, chord, ratio, 0.0]
    return [pod, Skin("pod_pylon", surface(np.array([low, high]), part["pylon_points"]), part["shade"])]


def _height_over(skins: list[Skin], x: float, y: float, z: float) -> float | None:
    """Mean height of the corners above a place that are nearest to its vertical, None where none is near it."""
    corners = np.vstack([skin.mesh.vertices_m for skin in skins])
    above = corners[corners[:, 2] > z]
    away = np.hypot(above[:, 0] - x, above[:, 1] - y)
    if not np.any(away < _FARTHEST_M):
        return None
    return float(above[np.argsort(away, kind="stable")[:_NEAREST], 2].mean())
