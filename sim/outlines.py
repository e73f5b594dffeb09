"""Outlines of tanker and receiver in MuJoCo's primitives: what they strike with. What is seen of them is `skins`.

Rough, and not physics: masses, inertias and forces come from the parameter sheets. Proportions are those of a
narrow-body transport with a refuelling unit under its tail or wing, and of a light single-engined fighter or a
long-winged unmanned aircraft; the tanker's scale with its sheet, the receiver's nose and probe with the mounting.

Each piece lies in its aircraft's axes, x forward, y left, z up, origin in the centre of gravity (receiver) or at the
middle of the wing's root (tanker). `yaw_rad` turns it about z, then `pitch_rad` about y and `roll_rad` about x.
Left out: control surfaces, undercarriage. Within a few decimetres these are where the skins are.
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from dockair.calibration import Mounting
from dockair.errors import DockairError
from dockair.rotations import Array, matrix_from_yaw_pitch_roll, quaternion_from_matrix

Point = tuple[float, float, float]
Pod = Literal["centreline", "left_wing", "right_wing"]  #: the unit whose hose is out

_NOSE_BEHIND_TIP_M = 1.2  # where the nose ends, behind the probe's tip: the boom must clear the basket
_SHORTEST_NOSE_M = 2.3  # ahead of the centre of gravity; with less the fuselage ahead of the wing has no length


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TankerParameters:
    """assets/parameters/tanker.toml."""

    mass_kg: float
    span_m: float
    length_m: float
    fuselage_radius_m: float
    exit_m: Array  #: (3,) the hose's exit in T
    wing_exit_m: Array  #: (3,) the same of a unit under the left wing; under the right one it is the mirror image
    pod_length_m: float
    pod_radius_m: float
    reflectance: float

    def at_pod(self, pod: Pod) -> "TankerParameters":
        """The same tanker with its hose at another unit.

        Raises:
            DockairError: no such unit; a wing pod's place that is not on the left.
        """
        if pod not in get_args(Pod):
            raise DockairError("tanker.pod", expected="a refuelling unit", got=pod, exists=list(get_args(Pod)))
        if pod == "centreline":
            return self
        if not self.wing_exit_m[1] > 0.0:
            expected = "a place left of the middle, y above 0: the right pod's is its mirror image"
            raise DockairError("tanker.wing_exit_m", expected=expected, got=np.asarray(self.wing_exit_m).tolist())
        side = np.array([1.0, 1.0 if pod == "left_wing" else -1.0, 1.0])
        return replace(self, exit_m=self.wing_exit_m * side)


@dataclass(frozen=True, slots=True)
class Piece:
    """One primitive. Kinds: ellipsoid and box with half-sizes, capsule from `at` to `to` with radius size[0]."""

    name: str
    kind: str
    at: Point
    size: Point
    to: Point | None = None
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @property
    def q_wxyz(self) -> list[float]:
        """Orientation in the aircraft's axes."""
        R = matrix_from_yaw_pitch_roll(self.yaw_rad, self.pitch_rad, self.roll_rad)
        return [float(c) for c in quaternion_from_matrix(R)]


def _pair(name: str, kind: str, at: Point, size: Point, *, yaw: float = 0.0, roll: float = 0.0) -> list[Piece]:
    """The piece on the left and its mirror image on the right."""
    x, y, z = at
    left = Piece(f"{name}_left", kind, at, size, yaw_rad=yaw, roll_rad=roll)
    right = Piece(f"{name}_right", kind, (x, -y, z), size, yaw_rad=-yaw, roll_rad=-roll)
    return [left, right]


def tanker_pieces(tanker: TankerParameters) -> list[Piece]:
    """Outline of the tanker in its own axes T, pod at the hose's exit included."""
    r, length, half_span = tanker.fuselage_radius_m, tanker.length_m, 0.5 * tanker.span_m
    sweep = np.deg2rad(28.0)  # tips aft
    dihedral = np.deg2rad(5.0)
    tail_x = -0.47 * length
    exit_x, exit_y, exit_z = (float(c) for c in tanker.exit_m)
    wing_at = (3.0 - 0.5 * half_span * np.tan(sweep), 0.5 * half_span, -0.45 * r + 0.5 * half_span * np.tan(dihedral))
    wing_half_length = 0.5 * half_span / np.cos(sweep)
    pod_x = exit_x + 0.5 * tanker.pod_length_m
    pod_half = 0.5 * tanker.pod_length_m - tanker.pod_radius_m
    over_pod_z = -0.45 * r + abs(exit_y) * np.tan(dihedral) if abs(exit_y) > r else 0.0  # wing or fuselage
    return [
        Piece("fuselage", "capsule", (0.36 * length, 0.0, 0.0), (r, 0.0, 0.0), to=(-0.22 * length, 0.0, 0.0)),
        Piece("tailcone", "ellipsoid", (-0.24 * length, 0.0, 0.12 * r), (0.28 * length, 0.9 * r, 0.8 * r)),
        *_pair("wing", "ellipsoid", wing_at, (2.9, wing_half_length, 0.33), yaw=sweep, roll=dihedral),
        *_pair(
            "tailplane",
            "ellipsoid",
            (tail_x - 0.6, 0.17 * half_span + r, 0.5 * r),
            (1.8, 0.2 * half_span, 0.16),
            yaw=sweep,
            roll=dihedral,
        ),
        Piece("fin", "box", (tail_x, 0.0, 2.6 * r), (1.5, 0.12, 1.7 * r), pitch_rad=np.deg2rad(-32.0)),
        *_pair("engine", "ellipsoid", (2.2, 0.36 * half_span, -1.25 * r), (2.3, 1.0, 1.0), yaw=0.0, roll=0.0),
        *_pair("pylon", "box", (1.0, 0.36 * half_span, -0.72 * r), (1.4, 0.12, 0.5)),
        Piece(
            "pod",
            "capsule",
            (pod_x + pod_half, exit_y, exit_z),
            (tanker.pod_radius_m, 0.0, 0.0),
            to=(pod_x - pod_half, exit_y, exit_z),
        ),
        Piece(
            "pod_pylon",
            "box",
            (pod_x + 0.2, exit_y, 0.5 * (exit_z + over_pod_z)),
            (0.9, 0.09, 0.5 * abs(over_pod_z - exit_z)),
        ),
    ]


def receiver_pieces(mounting: Mounting, outline: str = "fighter") -> list[Piece]:
    """Outline of the receiver in body axes B, without its probe: "fighter" or "unmanned".

    Raises:
        DockairError: another outline; no room for a nose.
    """
    kinds = {"fighter": _fighter, "unmanned": _unmanned}
    if outline not in kinds:
        raise DockairError("outline", expected="a receiver's outline", got=outline, exists=sorted(kinds))
    return kinds[outline](nose_x_m(mounting))


def nose_x_m(mounting: Mounting) -> float:
    """Where the receiver's nose ends, ahead of its centre of gravity [m].

    Raises:
        DockairError: a probe's tip so far aft that there is no room for a nose.
    """
    nose_x = float(mounting.p_BP[0]) - _NOSE_BEHIND_TIP_M
    if not nose_x > _SHORTEST_NOSE_M:
        ahead_m = _NOSE_BEHIND_TIP_M + _SHORTEST_NOSE_M
        expected = f"a tip more than {ahead_m:g} m ahead of the centre of gravity"
        raise DockairError("mounting.probe_tip_m", expected=expected, got=np.asarray(mounting.p_BP).tolist())
    return nose_x


def _fighter(nose_x: float) -> list[Piece]:
    sweep = np.deg2rad(32.0)
    return [
        Piece("fuselage_middle", "capsule", (1.6, 0.0, -0.1), (0.62, 0.0, 0.0), to=(-4.6, 0.0, -0.1)),
        # Three ellipsoids, slender toward the tip, so that the camera beside the nose looks past it
        Piece("fuselage_front", "ellipsoid", (1.4, 0.0, -0.05), (nose_x - _SHORTEST_NOSE_M, 0.52, 0.52)),
        Piece("fuselage_nose", "ellipsoid", (nose_x - 1.6, 0.0, -0.05), (1.6, 0.26, 0.26)),
        Piece("fuselage_intake", "ellipsoid", (0.6, 0.0, -0.75), (2.2, 0.45, 0.42)),
        Piece("canopy", "ellipsoid", (1.1, 0.0, 0.42), (1.5, 0.36, 0.5)),
        Piece("nozzle", "capsule", (-5.0, 0.0, -0.1), (0.5, 0.0, 0.0), to=(-5.6, 0.0, -0.1)),
        *_pair("wing", "box", (-1.6, 2.5, -0.1), (1.2, 2.0, 0.05), yaw=0.5 * sweep),
        *_pair("tailplane", "box", (-5.4, 1.6, -0.1), (0.7, 1.0, 0.04), yaw=0.5 * sweep),
        Piece("fin", "box", (-4.9, 0.0, 1.5), (0.9, 0.05, 1.3), pitch_rad=-sweep),
    ]


def _unmanned(nose_x: float) -> list[Piece]:
    return [
        Piece("fuselage_middle", "capsule", (1.6, 0.0, 0.0), (0.48, 0.0, 0.0), to=(-4.8, 0.0, 0.0)),
        Piece("fuselage_nose", "ellipsoid", (nose_x - 2.6, 0.0, 0.0), (2.6, 0.5, 0.48)),
        *_pair("wing", "box", (-0.2, 5.0, 0.4), (0.55, 4.8, 0.08), yaw=np.deg2rad(2.0), roll=np.deg2rad(1.0)),
        *_pair("tail", "box", (-4.6, 1.25, 0.92), (0.45, 1.3, 0.04), yaw=np.deg2rad(12.0), roll=np.deg2rad(36.0)),
        Piece("fin", "box", (-4.9, 0.0, -0.65), (0.35, 0.04, 0.45), pitch_rad=np.deg2rad(30.0)),
    ]
