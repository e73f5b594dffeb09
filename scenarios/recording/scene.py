"""The three-dimensional part of an episode: the model's shapes moved by the truth, the belief beside it.

Axes of "world": origin in the hose's exit, x level along the tanker's heading, z up. In straight flight that is W; in a
racetrack W's origin is soon kilometres away, where rerun's single precision would shake what it draws.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.rotations import Array, matrix_from_yaw_pitch_roll, quaternion_from_matrix
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.recording.layout import BELIEF, PIXEL_CENTRE, TRUTH
from dockair.sim.shapes import Shape
from dockair.sim.truth import Truth

#: Body of the model -> (rotation, position) in Truth.
_MOVED_BY = {"tanker": ("R_WT", "p_WT"), "drogue": ("R_WD", "p_WD"), "receiver": ("R_WB", "p_WB")}
_HOSE_RADIUS_M = 0.034  # drawn where no model gives it
_HOSE_COLOUR = [120, 120, 130]
_LED_COLOUR = [255, 120, 160]
_FRUSTUM_M = 1.2


def time_columns(log: FlightLog, ticks: Sequence[int]) -> list[Any]:
    """Return the timelines at some control ticks: `sim_time`, and `frame` if a frame arrived at each of them."""
    import rerun as rr

    columns = [rr.TimeColumn("sim_time", duration=[log.truths[k].time_s for k in ticks])]
    if not all(log.arrived[k] for k in ticks):
        return columns
    return [*columns, rr.TimeColumn("frame", sequence=log.frame_numbers()[list(ticks)])]


def hose_exit(first: Truth) -> Array:
    """(3,) p_TE from the first truth of a flight: the exit is W's origin there, and T's axes are W's."""
    return -first.p_WT


def log_still(recording: Any, sheets: NavigationSheets, shapes: Sequence[Shape]) -> None:
    """Log what does not change: the bodies' shapes, what is fitted to the receiver."""
    import rerun as rr

    recording.log("world", rr.ViewCoordinates.FLU, static=True)
    _log_bodies(recording, shapes)
    _log_receiver_fittings(recording, sheets)
    recording.log(
        "world/hose", rr.LineStrips3D.from_fields(colors=_HOSE_COLOUR, radii=_hose_radius(shapes)), static=True
    )
    _log_belief_shapes(recording, sheets)


def log_moving(
    recording: Any, log: FlightLog, ticks: Sequence[int], times: list[Any], sheets: NavigationSheets, p_TE: Array
) -> None:
    """Log where everything is at some control ticks.

    Args:
        recording: of rerun.
        log: of the flight, or of a part of it.
        ticks: indices into the log.
        times: columns of the timelines at these ticks.
        sheets: mounting of the probe.
        p_TE: (3,) of `hose_exit`.
    """
    import rerun as rr

    truths = [log.truths[k] for k in ticks]
    axes = [_level_axes(truth, p_TE) for truth in truths]
    for body, (rotation, position) in _MOVED_BY.items():
        rotations = [R_EW @ getattr(truth, rotation) for truth, (R_EW, _) in zip(truths, axes, strict=True)]
        translations = [
            R_EW @ (getattr(truth, position) - p_WE) for truth, (R_EW, p_WE) in zip(truths, axes, strict=True)
        ]
        recording.send_columns(f"world/{body}", times, _transforms(translations, rotations))
    strips = [(truth.p_WH - p_WE) @ R_EW.T for truth, (R_EW, p_WE) in zip(truths, axes, strict=True)]
    recording.send_columns("world/hose", times, rr.LineStrips3D.columns(strips=strips))
    _log_belief(recording, log, ticks, sheets, times)


def tip_place(truth: Truth, p_TE: Array) -> Array:
    """(3,) the probe's tip in the axes of "world"; p_TE of `hose_exit`."""
    R_EW, p_WE = _level_axes(truth, p_TE)
    return np.asarray(R_EW @ (truth.p_WP - p_WE))


def log_tip_path(recording: Any, places: Sequence[Array]) -> None:
    """Log the way of the probe's tip, (n, 3) of `tip_place`, in the place of what was logged of it before."""
    import rerun as rr

    line = rr.LineStrips3D([np.array(places)], colors=[*TRUTH, 90], radii=rr.Radius.ui_points(0.8))
    recording.log("world/probe_path", line, static=True)


def _level_axes(truth: Truth, p_TE: Array) -> tuple[Array, Array]:
    """R_EW (3, 3) and p_WE (3,) of the axes in which an episode is drawn."""
    ahead = truth.R_WT[:, 0]
    R_EW = matrix_from_yaw_pitch_roll(float(np.arctan2(ahead[1], ahead[0])), 0.0, 0.0).T
    return R_EW, truth.p_WT + truth.R_WT @ p_TE


def _transforms(translations: Sequence[Array], rotations: Sequence[Array]) -> Any:
    import rerun as rr

    quaternions = np.array([np.roll(quaternion_from_matrix(R), -1) for R in rotations])  # rerun: x, y, z, w
    return rr.Transform3D.columns(translation=np.array(translations), quaternion=quaternions)


def _log_belief(
    recording: Any, log: FlightLog, ticks: Sequence[int], sheets: NavigationSheets, times: list[Any]
) -> None:
    """The believed drogue, placed from the receiver as the navigation has it, and what is commanded."""
    import rerun as rr

    solutions = [log.solutions[k] for k in ticks]
    places = [s.p_PD_B + sheets.mounting.p_BP for s in solutions]
    recording.send_columns("world/receiver/belief", times, _transforms(places, [s.R_BD for s in solutions]))
    velocities = np.array([s.command.velocity_m_s for s in solutions]).reshape(-1, 3)
    recording.send_columns("world/receiver/command", times, rr.Arrows3D.columns(vectors=velocities))


def _log_belief_shapes(recording: Any, sheets: NavigationSheets) -> None:
    """The believed drogue's ring, LEDs and axis; the foot of the command's arrow."""
    import rerun as rr

    ring = np.vstack([sheets.ring.positions_D, sheets.ring.positions_D[:1]])
    axis = np.array([[0.0, 0.0, 0.0], [sheets.coupling_depth_m, 0.0, 0.0]])
    lines = rr.LineStrips3D([_circle(sheets.ring.diameter_m), axis], colors=BELIEF, radii=rr.Radius.ui_points(1.5))
    recording.log("world/receiver/belief/ring", lines, static=True)
    points = rr.Points3D(ring[:-1], colors=BELIEF, radii=rr.Radius.ui_points(3.0))
    recording.log("world/receiver/belief/leds", points, static=True)
    recording.log(
        "world/receiver/command",
        rr.Arrows3D.from_fields(origins=[sheets.mounting.p_BP], colors=BELIEF, radii=rr.Radius.ui_points(1.5)),
        static=True,
    )


def _circle(diameter_m: float) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    return 0.5 * diameter_m * np.column_stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)])


def _log_receiver_fittings(recording: Any, sheets: NavigationSheets) -> None:
    import rerun as rr

    camera, mounting = sheets.camera, sheets.mounting
    recording.log("world/receiver/camera", rr.Transform3D(translation=mounting.p_BC, mat3x3=mounting.R_BC), static=True)
    pinhole = rr.Pinhole(
        focal_length=camera.focal_length_px,
        width=camera.width_px,
        height=camera.height_px,
        principal_point=np.add(camera.principal_point_px, PIXEL_CENTRE),
        camera_xyz=rr.ViewCoordinates.FLU,
        image_plane_distance=_FRUSTUM_M,
    )
    recording.log("world/receiver/camera", pinhole, static=True)
    leds = rr.Points3D(sheets.ring.positions_D, colors=_LED_COLOUR, radii=0.012)
    recording.log("world/drogue/leds", leds, static=True)


def _hose_radius(shapes: Sequence[Shape]) -> float:
    radii = [shape.half_size_m[0] for shape in shapes if shape.body.startswith("hose") and shape.kind == "capsule"]
    return float(radii[0]) if radii else _HOSE_RADIUS_M


def _log_bodies(recording: Any, shapes: Sequence[Shape]) -> None:
    groups: dict[tuple[str, str], list[Shape]] = defaultdict(list)
    for shape in shapes:
        if shape.body in _MOVED_BY:
            groups[shape.body, shape.kind].append(shape)
    for (body, kind), group in groups.items():
        entity = f"world/{body}/{kind}s"
        if kind == "mesh":
            _log_meshes(recording, entity, group)
        else:
            recording.log(entity, _primitives(kind, group), static=True)


def _primitives(kind: str, group: Sequence[Shape]) -> Any:
    """Return one archetype for all shapes of a kind."""
    import rerun as rr

    centres = np.array([shape.p_m for shape in group])
    half = np.array([shape.half_size_m for shape in group])
    look: dict[str, Any] = {
        "quaternions": np.array([np.roll(shape.q_wxyz, -1) for shape in group]),
        "colors": [_colour(shape) for shape in group],
        "fill_mode": rr.components.FillMode.Solid,
    }
    if kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=half, centers=centres, **look)
    if kind == "box":
        return rr.Boxes3D(half_sizes=half, centers=centres, **look)
    lengths, radii = 2.0 * half[:, 2], half[:, 0]
    if kind == "cylinder":
        return rr.Cylinders3D(lengths=lengths, radii=radii, centers=centres, **look)
    starts = centres - np.array([_z_axis(shape) * shape.half_size_m[2] for shape in group])
    return rr.Capsules3D(
        lengths=lengths, radii=radii, translations=starts, **look
    )  # the viewer's begin at their origin


def _log_meshes(recording: Any, entity: str, group: Sequence[Shape]) -> None:
    import rerun as rr

    for shape in group:
        place = f"{entity}/{shape.name or 'unnamed'}"
        attitude = rr.Quaternion(xyzw=np.roll(shape.q_wxyz, -1))
        transform = rr.Transform3D(translation=shape.p_m, quaternion=attitude)
        recording.log(place, transform, static=True)
        corners, triangles = np.asarray(shape.vertices_m), np.asarray(shape.triangles)
        mesh = rr.Mesh3D(vertex_positions=corners, triangle_indices=triangles, albedo_factor=_colour(shape))
        recording.log(place, mesh, static=True)


def _z_axis(shape: Shape) -> Array:
    w, x, y, z = shape.q_wxyz
    return np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])


def _colour(shape: Shape) -> list[int]:
    """The near-infrared reflectance as a visible grey, brightened: black rubber and white paint must both show."""
    return [int(255 * np.sqrt(np.clip(c, 0.0, 1.0))) for c in shape.rgba[:3]] + [int(255 * shape.rgba[3])]
