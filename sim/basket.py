"""The drogue's geometry: a basket that can be struck and entered, the coupling, the LEDs, the canopy.

Axes D, origin in the LED ring's centre, x forward. From aft to forward: LEDs at x = 0 on the faces of their housings,
the rim just ahead of them, ribs narrowing from the rim to the coupling's mouth, the mouth's bore around the coupling
point, the coupling's solid body from behind that point to the hose's end.
"""

from typing import Any

import mujoco
import numpy as np

from dockair.calibration import LedRing
from dockair.errors import DockairError
from dockair.rotations import Array, quaternion_from_matrix
from dockair.sim.hose.chain import DrogueParameters
from dockair.sim.hose.coupling import CouplingParameters

_LEDS = 8
_SOCKET_STAVES = 12  # capsules around the coupling's mouth
_CANOPY_PANELS = 24


def require_fit(drogue: DrogueParameters, coupling: CouplingParameters) -> None:
    """Refuse a coupling point that no tip can get to.

    Raises:
        DockairError: it does not lie between the throat and the hose's end.
    """
    where, bottom = "parameters.coupling.depth_m", coupling.depth_m + coupling.stop_gap_m
    if not drogue.throat_x_m < coupling.depth_m:
        expected = f"more than drogue.throat_x_m = {drogue.throat_x_m}, where the bore begins"
        raise DockairError(where, expected=expected, got=coupling.depth_m)
    if not bottom < drogue.hose_joint_x_m:
        end, gap = f"drogue.hose_joint_x_m = {drogue.hose_joint_x_m}", f"coupling.stop_gap_m = {coupling.stop_gap_m}"
        raise DockairError(where, expected=f"less than {end} by more than {gap}", got=coupling.depth_m)


def require_leds(ring: LedRing) -> None:
    """Refuse a ring of more or fewer LEDs than the drogue carries.

    Raises:
        DockairError: it is one.
    """
    if ring.count != _LEDS:
        raise DockairError("ring.count", expected=f"{_LEDS} LEDs, as many as the drogue carries", got=ring.count)


def throat_radius_m(drogue: DrogueParameters, coupling: CouplingParameters) -> float:
    """Of the circle on which the middles of the ribs end, around the coupling's bore."""
    return coupling.socket_radius_m + drogue.rib_radius_m


def grey(reflectance: float) -> list[float]:
    """RGBA of a reflectance."""
    return [reflectance, reflectance, reflectance, 1.0]


def sliding(friction: float) -> list[float]:
    """MuJoCo's three friction coefficients of a sliding one; the others are its defaults."""
    return [friction, 0.005, 0.0001]


def add_drogue(body: Any, drogue: DrogueParameters, coupling: CouplingParameters, touched_by: int) -> None:
    """Give the drogue's body its mass, geoms and sites.

    Args:
        body: MjsBody with its joints, origin in the LED ring's centre.
        drogue: sheet.
        coupling: sheet.
        touched_by: contact bits of what it collides with.

    Raises:
        DockairError: of `require_fit`.
    """
    require_fit(drogue, coupling)
    body.explicitinertial, body.mass = True, drogue.mass_kg
    body.ipos, body.inertia = [drogue.centre_of_mass_x_m, 0.0, 0.0], drogue.inertia_kg_m2
    solid = {
        "contype": 0,
        "conaffinity": touched_by,
        "friction": sliding(drogue.friction),
        "solref": [drogue.contact_time_constant_s, 1.0],
        "priority": 1,  # else MuJoCo takes the mean of both geoms' time constants, the other's being its default
        "rgba": grey(drogue.reflectance),
    }
    _add_basket(body, drogue, coupling, solid)
    _add_socket(body, drogue, coupling, solid)
    _add_canopy(body, drogue)
    ring = LedRing(diameter_m=drogue.ring_diameter_m, count=_LEDS)
    drawn = {"contype": 0, "conaffinity": 0}
    for k, (_, y, z) in enumerate(ring.positions_D):
        body.add_site(name=f"led_{k}", pos=[0.0, y, z], size=[0.004] * 3)
        body.add_geom(
            name=f"led_housing_{k}",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            fromto=[drogue.led_housing_gap_m, y, z, drogue.rim_x_m, y, z],
            size=[drogue.led_housing_radius_m, 0.0, 0.0],
            rgba=grey(drogue.led_housing_reflectance),
            **drawn,
        )
    body.add_site(name="coupling", pos=[coupling.depth_m, 0.0, 0.0], size=[0.01] * 3)


def place_leds(model: mujoco.MjModel, data: mujoco.MjData, ring: LedRing) -> None:
    """Move the LEDs' sites and housings, which `add_drogue` spaced evenly, to where a ring's sheet has its LEDs.

    They are drawn only: mass, contacts and motion do not change.

    Args:
        model: of the world; changed.
        data: its state; places of sites and geoms are brought up to date.
        ring: its sheet.

    Raises:
        DockairError: a ring of more or fewer LEDs than the drogue carries.
    """
    require_leds(ring)
    for k, (_, y, z) in enumerate(ring.positions_D):
        model.site(f"led_{k}").pos[1:] = y, z
        model.geom(f"led_housing_{k}").pos[1:] = y, z
    mujoco.mj_kinematics(model, data)


def _circle(count: int, radius: float) -> Array:
    """(count, 2) points (y, z) on a circle."""
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _add_basket(body: Any, drogue: DrogueParameters, coupling: CouplingParameters, solid: dict[str, Any]) -> None:
    """Rim of capsules; ribs from the rim to the coupling's mouth, too close together for a probe's tip."""
    rim = _circle(drogue.ribs, 0.5 * drogue.ring_diameter_m)
    throat = _circle(drogue.ribs, throat_radius_m(drogue, coupling))
    for k in range(drogue.ribs):
        here, there = rim[k], rim[(k + 1) % drogue.ribs]
        for name, to, radius in (
            ("rim", [drogue.rim_x_m, *there], drogue.rim_tube_radius_m),
            ("rib", [drogue.throat_x_m, *throat[k]], drogue.rib_radius_m),
        ):
            body.add_geom(
                name=f"basket_{name}_{k}",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[drogue.rim_x_m, *here, *to],
                size=[radius, 0.0, 0.0],
                **solid,
            )


def _add_socket(body: Any, drogue: DrogueParameters, coupling: CouplingParameters, solid: dict[str, Any]) -> None:
    """Mouth of the coupling as a bundle of staves around its bore; a solid body from its bottom to the hose."""
    bottom = coupling.depth_m + coupling.stop_gap_m
    half_wall = 0.5 * coupling.socket_wall_m
    outside = coupling.socket_radius_m + coupling.socket_wall_m
    for k, (y, z) in enumerate(_circle(_SOCKET_STAVES, coupling.socket_radius_m + half_wall)):
        body.add_geom(
            name=f"coupling_stave_{k}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[drogue.throat_x_m, y, z, bottom, y, z],
            size=[half_wall, 0.0, 0.0],
            **solid,
        )
    body.add_geom(
        name="coupling_body",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=[bottom, 0.0, 0.0, drogue.hose_joint_x_m, 0.0, 0.0],
        size=[outside, 0.0, 0.0],
        **solid,
    )


def _add_canopy(body: Any, drogue: DrogueParameters) -> None:
    """A skirt of flat panels from the rim outward and forward; drawn only."""
    inner, outer, panels = 0.5 * drogue.ring_diameter_m, 0.5 * drogue.canopy_diameter_m, _CANOPY_PANELS
    slant = np.hypot(outer - inner, drogue.canopy_length_m)
    lean = np.arctan2(outer - inner, drogue.canopy_length_m)
    half_width = np.pi * outer / panels
    for k in range(panels):
        angle = 2.0 * np.pi * k / panels
        middle = 0.5 * (inner + outer)
        x = drogue.rim_x_m + drogue.rim_tube_radius_m + 0.5 * drogue.canopy_length_m
        out = np.array([0.0, np.cos(angle), np.sin(angle)])
        along = np.cos(lean) * np.array([1.0, 0.0, 0.0]) + np.sin(lean) * out
        sideways = np.array([0.0, -np.sin(angle), np.cos(angle)])
        quat = quaternion_from_matrix(np.column_stack([along, sideways, np.cross(along, sideways)]))
        body.add_geom(
            name=f"canopy_{k}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=np.array([x, 0.0, 0.0]) + middle * out,
            quat=quat,
            size=[0.5 * slant, half_width, 0.002],
            rgba=grey(drogue.canopy_reflectance),
            contype=0,
            conaffinity=0,
        )
