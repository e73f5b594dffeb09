"""Protection levels: bounds that the error of a frame's pose exceeds unseen with at most a set probability.

Slope method, for a frame that passed the test. With the least fault lambda that the test does not overlook,

    PL = max_i slope_i lambda + k sigma                                                   (1)

A fault shorter than lambda moves the pose by less than the first term, and noise alone exceeds the second with at most
the probability missed_detection; a longer fault passes the test with at most that probability, and the residuals are
independent of the error that noise makes. So whatever the fault, both at once happen with at most missed_detection.

Solution separation, for a frame from which an LED was left out. One LED is bad, so one of the exclusions x_i that pass
the test is free of it, and it need not be the lowest, x:

    PL = max over the x_i that pass of |x_i - x| + k sigma_i                              (2)

The mirror image of a flat ring is a fault mode of its own: all LEDs may be good and the attitude is wrong. It is ruled
out when it fails the test even without its worst LED (J - max t_i > T of two degrees of freedom less; never where none
are left, since any three LEDs fit). While it is not, the distance to it and its own level join the maximum in (1), it
is one of the x_i in (2), and no level of attitude is given. Nor is there one that reaches the frontal attitude half way
to the mirror image: there the linearisation ends.

Not modelled: a fault that the places a frame is tested on have followed, frame by frame (`contact_watch`):
what they contribute to the pose is added to the levels there.

Source: R. G. Brown, A baseline GPS RAIM scheme, 1992 (1); M. Brenner, Integrated GPS/inertial fault detection
availability, 1996 (2). There a fault has one axis and the problem is linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dockair.nav.integrity.fault_test import FaultTest
from dockair.nav.integrity.minima import Exclusion
from dockair.nav.integrity.sensitivity import Sensitivity, sensitivity, worst_sigmas
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class ProtectionLevels:
    """Bounds of the error in camera axes; inf where nothing can be promised."""

    range_m: float = np.inf  #: along the boresight x
    lateral_m: float = np.inf  #: across it, length in the y-z plane
    attitude_rad: float = np.inf  #: inf also while the mirror image is not ruled out, or the attitude nearly frontal

    def about(self, offset_m: Array) -> "ProtectionLevels":
        """Return the levels of another estimate of position, offset (3,) from this one in camera axes [m].

        By the triangle inequality; nothing is promised about that estimate's attitude.
        """
        return ProtectionLevels(
            range_m=self.range_m + abs(float(offset_m[0])),
            lateral_m=self.lateral_m + float(np.hypot(offset_m[1], offset_m[2])),
        )


def slope_levels(
    minima: Sequence[PoseEstimate], sight: LinesOfSight, found: Sensitivity, test: FaultTest, fewer: FaultTest
) -> tuple[ProtectionLevels, bool]:
    """Return the levels of the first minimum, Eq. (1), and whether it is the only one that the frame allows.

    Args:
        minima: of all LEDs; the first is believed.
        sight: their lines of sight.
        found: sensitivity at the first.
        test: for all LEDs.
        fewer: for one LED less.
    """
    bounds, alone = _slope_bound(found, test), True
    for other in minima[1:]:
        mirror = sensitivity(sight, other.R_CD, other.p_CD, other.covariance)
        without_worst = other.cost - mirror.local_chi2.max()  # 0 but for rounding where no freedom is left
        if not fewer.degrees_of_freedom or without_worst <= fewer.threshold:
            bounds = np.maximum(bounds, _distance(other, minima[0]) + _slope_bound(mirror, test))
            alone = False
    return _levels(bounds, minima[0], sight, alone), alone


def separation_levels(
    passed: Sequence[Exclusion], sight: LinesOfSight, test: FaultTest
) -> tuple[ProtectionLevels, bool]:
    """Return the levels of the first exclusion, Eq. (2), and whether its attitude is the only one that passes.

    Others without the same LED are its mirror image; without another one, those tilted to the other side of frontal.

    Args:
        passed: exclusions that pass the test; the first is believed.
        sight: lines of sight of all LEDs.
        test: for the LEDs that remain.
    """
    k, first = np.array(test.error_sigmas), passed[0]
    bounds = [_distance(other.pose, first.pose) + k * worst_sigmas(other.pose.covariance) for other in passed]
    tilt = _tilt(first.pose)
    alone = all(other.led != first.led and tilt @ _tilt(other.pose) > 0.0 for other in passed[1:])
    return _levels(np.max(bounds, axis=0), first.pose, sight, alone), alone


def _slope_bound(found: Sensitivity, test: FaultTest) -> Array:
    return np.asarray(found.slopes.max(axis=0) * test.least_fault + np.array(test.error_sigmas) * found.sigmas)


def _distance(pose: PoseEstimate, other: PoseEstimate) -> Array:
    """(3,) along x [m], across it [m], of attitude [rad]."""
    step = pose_difference(pose.R_CD, pose.p_CD, other.R_CD, other.p_CD)
    return np.array([abs(step[3]), np.hypot(step[4], step[5]), np.sqrt(step[:3] @ step[:3])])


def _tilt(pose: PoseEstimate) -> Array:
    """(3,) the drogue's axis across the line of sight to it, camera axes; its mirror image's is opposite."""
    axis, sight = pose.R_CD[:, 0], pose.p_CD / np.linalg.norm(pose.p_CD)
    return np.asarray(axis - sight * (axis @ sight))


def _levels(bounds: Array, pose: PoseEstimate, sight: LinesOfSight, alone: bool) -> ProtectionLevels:
    along, across, turn = (float(bound) for bound in bounds)
    R_CD, p_CD = mirrored(pose.R_CD, pose.p_CD, sight.points_D)
    mirror = pose_difference(R_CD, p_CD, pose.R_CD, pose.p_CD)
    linear = bool(turn < 0.5 * np.sqrt(mirror[:3] @ mirror[:3]))
    return ProtectionLevels(range_m=along, lateral_m=across, attitude_rad=turn if alone and linear else np.inf)
