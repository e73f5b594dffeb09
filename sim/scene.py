"""The MuJoCo model of the world, built by MjSpec: tanker, hose on its reel, drogue, receiver with probe, light.

Frame W: origin at the hose's exit at the start, x forward, z up; it moves with the tanker's velocity at the start, so
that a tanker flying straight stands still and the air blows. Bodies "tanker", "hose_0" ... "hose_{n-1}", "drogue",
"receiver"; geoms "probe_...", "basket_...", "coupling_...", "hose_...", "fuselage_..." and so on; sites "led_0" ...
"led_7", "coupling", "probe_tip".

What is seen of tanker and receiver are lofted skins, "tanker_skin_..." and "skin_..."; they touch nothing. What they
strike with are primitives in a group that is not drawn. Who touches whom: the probe touches basket, coupling and hose;
every other part of the receiver touches hose, drogue and tanker. Hose and drogue touch nothing of the tanker. Grey
values are reflectances near 850 nm.

Joints: "tanker" and "receiver" are free. The tanker is prescribed: so heavy that nothing which pulls at it changes its
acceleration by more than rounding, its weight made up for, it carries the hose along with all its inertia. "reel"
slides link 0 along the pod's axis, 0 at full trail, positive wound in (the outer stop gives a little beyond 0);
each link, and the drogue on the last one, has two hinges "<body>_y", "<body>_z" at its front end, and no twist.
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from dockair.calibration import Camera, Mounting
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.basket import add_drogue, grey, sliding
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.outlines import Piece, TankerParameters, receiver_pieces, tanker_pieces
from dockair.sim.skins import Skin, receiver_skins, tanker_skins

# Contact bits
_PROBE, _RECEIVER = 1, 2

# Of the prescribed tanker: hose and drogue pull with some 2 kN, at 20 m from its origin: 2e-7 m/s^2, 4e-8 rad/s^2
_TANKER_MASS_KG = 1e10
_TANKER_INERTIA_KG_M2 = 1e12

_RECEIVER_REFLECTANCE = 0.4  # grey paint near 850 nm; drawing only
_NOT_DRAWN = 3  # group of geoms that are struck and not seen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneParameters:
    """Everything the model is built from."""

    hose: HoseParameters
    drogue: DrogueParameters
    reel: ReelParameters
    coupling: CouplingParameters
    tanker: TankerParameters
    mounting: Mounting
    receiver_mass_kg: float
    receiver_inertia_B: Array  #: (3, 3) about the centre of gravity [kg m^2]
    sun_direction_W: Array  #: (3,) unit vector from the scene to the Sun
    step_s: float
    receiver_outline: str = "fighter"  #: of `outlines` and `skins`


def build_scene(parameters: SceneParameters) -> mujoco.MjModel:
    """Compile the model."""
    spec = mujoco.MjSpec()
    spec.modelname = "dockair"
    _set_options(spec, parameters.step_s)
    _add_sky_and_sun(spec, parameters.sun_direction_W)
    tanker = _add_tanker(spec, parameters.tanker)
    drogue = _add_hose(spec, tanker, parameters)
    add_drogue(drogue, parameters.drogue, parameters.coupling, _PROBE | _RECEIVER)
    _add_receiver(spec, parameters)
    latch = spec.add_equality(
        name="latch", type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE, name1="probe_tip"
    )
    latch.name2, latch.active = "coupling", False
    latch.solref[:] = parameters.coupling.latch_time_constant_s, parameters.coupling.latch_damping_ratio
    model = spec.compile()
    model.opt.tolerance *= _share_of_others(model)
    return model


def _share_of_others(model: mujoco.MjModel) -> float:
    """Mean of the mass matrix's diagonal without the tanker over that with it.

    MuJoCo's solver divides what a step gains by the mean: beside the tanker's mass it would never begin.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    diagonal = data.M[model.M_rowadr + model.M_rownnz - 1]  # the last of each row of the lower triangle
    tanker = model.joint("tanker").dofadr[0]
    return float(np.delete(diagonal, slice(tanker, tanker + 6)).mean() / diagonal.mean())


def _set_options(spec: Any, step_s: float) -> None:
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, -STANDARD_GRAVITY_M_S2]
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # the world says so when a step diverges
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND  # one at most: to look for it takes time, no bit
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    sensor = Camera()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = sensor.width_px, sensor.height_px
    spec.visual.quality.offsamples = 0  # multisampling costs tenfold off-screen and is the camera model's business
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 16, 8  # a third less drawing than 28 and 16
    spec.visual.quality.shadowsize = 0
    spec.stat.extent, spec.stat.center = 40.0, [-15.0, 0.0, -2.0]
    spec.visual.map.znear, spec.visual.map.zfar = 0.0025, 50.0  # times the extent: 0.1 m to 2 km


def _add_sky_and_sun(spec: Any, sun_direction_W: Array) -> None:
    """Add the Sun, whose direction the camera takes from here; strengths, sky and colours are for people's pictures."""
    headlight = spec.visual.headlight
    headlight.active, headlight.ambient[:], headlight.diffuse[:], headlight.specular[:] = 0, 0.0, 0.0, 0.0
    sun = np.asarray(sun_direction_W, dtype=float)
    light = spec.worldbody.add_light(name="sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=False)
    light.dir = -sun / np.linalg.norm(sun)
    light.ambient, light.diffuse, light.specular = [0.25] * 3, [0.75] * 3, [0.1] * 3
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.10] * 3,  # zenith: dark in the near infrared
        rgb2=[0.35] * 3,  # ground and haze
        width=64,
        height=384,
    )


def _add_pieces(body: Any, pieces: list[Piece], prefix: str, contact: dict[str, Any]) -> None:
    kinds = {
        "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        "box": mujoco.mjtGeom.mjGEOM_BOX,
        "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    }
    for piece in pieces:
        placed = {"fromto": [*piece.at, *piece.to]} if piece.to is not None else {"pos": piece.at, "quat": piece.q_wxyz}
        body.add_geom(
            name=prefix + piece.name,
            type=kinds[piece.kind],
            size=list(piece.size),
            group=_NOT_DRAWN,
            mass=0.0,
            **placed,
            **contact,
        )


def _add_skins(spec: Any, body: Any, skins: list[Skin], prefix: str, reflectance: float) -> None:
    for skin in skins:
        name, corners, triangles = prefix + skin.name, skin.mesh.vertices_m, skin.mesh.triangles
        mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert, mesh.userface = corners.ravel().tolist(), triangles.ravel().tolist()
        mesh.usernormal, mesh.userfacenormal = skin.mesh.normals.ravel().tolist(), triangles.ravel().tolist()
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            rgba=grey(min(reflectance * skin.shade, 1.0)),
            mass=0.0,
            contype=0,
            conaffinity=0,
        )


def _add_tanker(spec: Any, tanker: TankerParameters) -> Any:
    """Add the tanker; return its body."""
    body = spec.worldbody.add_body(name="tanker", pos=-np.asarray(tanker.exit_m))
    body.add_freejoint(name="tanker")
    body.explicitinertial, body.mass, body.gravcomp = True, _TANKER_MASS_KG, 1.0
    body.ipos, body.inertia = [0.0, 0.0, 0.0], [_TANKER_INERTIA_KG_M2] * 3
    contact = {"contype": 0, "conaffinity": _RECEIVER}
    _add_pieces(body, tanker_pieces(tanker), "tanker_", contact)
    _add_skins(spec, body, tanker_skins(tanker), "tanker_skin_", tanker.reflectance)
    return body


def _add_hose(spec: Any, tanker: Any, parameters: SceneParameters) -> Any:
    """Add reel and links to the tanker; return the drogue's body, hinged on the last one."""
    hose, drogue, reel = parameters.hose, parameters.drogue, parameters.reel
    length, mass = hose.link_length_m, hose.link_mass_kg
    across = mass * (length**2 / 12.0 + hose.radius_m**2 / 4.0)
    parent, joint_at = tanker, list(parameters.tanker.exit_m)
    stiffness = hose.bending_stiffness_n_m2 / length
    damping = hose.bending_damping_n_m2_s / length
    for i in range(hose.links):
        body = parent.add_body(name=f"hose_{i}", pos=joint_at)
        body.explicitinertial, body.mass = True, mass
        body.ipos = [-0.5 * length, 0.0, 0.0]
        body.inertia = [0.5 * mass * hose.radius_m**2, across, across]
        if i == 0:
            _add_reel(body, reel)
        _add_hinges(body, f"hose_{i}", [0.0, 0.0, 0.0], stiffness if i else 0.0, damping)
        body.add_geom(
            name=f"hose_{i}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0.0, 0.0, 0.0, -length, 0.0, 0.0],
            size=[hose.radius_m, 0.0, 0.0],
            rgba=grey(hose.reflectance),
            contype=0,
            conaffinity=_PROBE | _RECEIVER,
            friction=sliding(drogue.friction),
        )
        parent, joint_at = body, [-length, 0.0, 0.0]
    body = parent.add_body(name="drogue", pos=[-length - drogue.hose_joint_x_m, 0.0, 0.0])
    _add_hinges(body, "drogue", [drogue.hose_joint_x_m, 0.0, 0.0], 0.0, drogue.hinge_damping_n_m_s)
    return body


def _add_reel(body: Any, reel: ReelParameters) -> None:
    joint = body.add_joint(name="reel", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, [-reel.buffer_travel_m, reel.range_m]
    joint.armature = reel.drum_mass_kg
    joint.solref_limit[:] = reel.stop_time_constant_s, 1.0


def _add_hinges(body: Any, name: str, at: list[float], stiffness: float, damping: float) -> None:
    for axis, letter in ([0.0, 1.0, 0.0], "y"), ([0.0, 0.0, 1.0], "z"):
        joint = body.add_joint(name=f"{name}_{letter}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, pos=at)
        joint.stiffness[0], joint.damping[0] = stiffness, damping


def _add_receiver(spec: Any, parameters: SceneParameters) -> None:
    mounting, coupling = parameters.mounting, parameters.coupling
    inertia = np.asarray(parameters.receiver_inertia_B, dtype=float)
    body = spec.worldbody.add_body(name="receiver")
    body.add_freejoint(name="receiver")
    body.explicitinertial, body.mass = True, parameters.receiver_mass_kg
    # Without `ipos` MuJoCo takes the inertial frame as not given, and drops the turn of its axes in silence
    body.ipos = [0.0, 0.0, 0.0]
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    contact = {"contype": _RECEIVER, "conaffinity": 0, "friction": sliding(parameters.drogue.friction)}
    _add_pieces(body, receiver_pieces(mounting, parameters.receiver_outline), "", contact)
    _add_skins(spec, body, receiver_skins(mounting, parameters.receiver_outline), "skin_", _RECEIVER_REFLECTANCE)
    _add_probe(body, mounting, coupling, parameters.drogue.friction)
    body.add_site(name="probe_tip", pos=mounting.p_BP, size=[0.01] * 3)


def _add_probe(body: Any, mounting: Mounting, coupling: CouplingParameters, friction: float) -> None:
    """Tip sphere whose foremost point is P, a straight boom, and a mast from it to the nose's side."""
    x, y, z = (float(c) for c in mounting.p_BP)
    tip, boom = coupling.probe_tip_radius_m, coupling.probe_boom_radius_m
    elbow, foot = [x - coupling.probe_boom_length_m, y, z], [x - 3.2, 0.35 * y, 0.2 * z]
    # MuJoCo takes the larger friction of two geoms: both must have the pair's
    contact = {
        "contype": _PROBE,
        "conaffinity": 0,
        "rgba": grey(coupling.probe_reflectance),
        "friction": sliding(friction),
    }
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    body.add_geom(name="probe_tip", type=sphere, pos=[x - tip, y, z], size=[tip, 0.0, 0.0], **contact)
    for name, end, start, radius in (
        ("probe_boom", [x - tip, y, z], elbow, boom),
        ("probe_mast", elbow, foot, 1.3 * boom),
    ):
        body.add_geom(name=name, type=capsule, fromto=[*end, *start], size=[radius, 0.0, 0.0], **contact)
