"""What is known about the pose beside the frame; each enters as one more measurement, `normal_equations` (1)-(2).

A belief about the whole pose, about the attitude (a gyro's, carried on), or about one direction of the drogue: its x
axis lies along the hose, whose direction is known better than its roll. Angles are errors phi in camera axes,
R_CD <- exp(phi) R_CD. What is not known has no information, which is why the last two hold information, not covariance.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dockair.errors import DockairError
from dockair.rotations import Array

_UNIT, _ZERO, _NOTHING = np.eye(3), np.zeros(3), np.zeros((0, 0))
_UNIT_LENGTH = 1e-6  # error of a unit vector's length that is taken for rounding
_ASYMMETRY = 1e-9  # of a covariance, in sigmas, that is taken for rounding

Terms = tuple[Array, Array, Array, Array, Array, float]
NO_PRIOR: Terms = (_UNIT, _ZERO, _NOTHING, _ZERO, _ZERO, 0.0)  #: what `descent_kernels.descend` takes for no prior


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePrior:
    """Belief about the whole pose; shapes and rank are looked at when it is used."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes [rad, m]

    @property
    def terms(self) -> Terms:
        """What `descent_kernels.descend` takes.

        Raises:
            DockairError: wrong shapes, numbers that are not finite, a covariance that is none or is singular.
        """
        R, p = np.ascontiguousarray(self.R_CD, dtype=float), np.ascontiguousarray(self.p_CD, dtype=float)
        shapes = R.shape, p.shape, np.shape(self.covariance)
        if shapes != ((3, 3), (3,), (6, 6)):
            raise DockairError("prior", expected="R_CD (3, 3), p_CD (3,), covariance (6, 6)", got=shapes)
        covariance = np.asarray(self.covariance, dtype=float)
        for name, numbers in {"R_CD": R, "p_CD": p, "covariance": covariance}.items():
            if not np.isfinite(numbers).all():
                raise DockairError(f"prior.{name}", expected="finite numbers", got="NaN or inf among them")
        expected, sigmas = "a covariance, symmetric and positive definite", np.sqrt(np.abs(np.diag(covariance)))
        if (np.abs(covariance - covariance.T) > _ASYMMETRY * np.outer(sigmas, sigmas)).any():
            raise DockairError("prior.covariance", expected=expected, got="one that is not symmetric")
        try:
            np.linalg.cholesky(covariance)
            return R, p, np.linalg.inv(covariance), _ZERO, _ZERO, 0.0
        except np.linalg.LinAlgError:
            got = f"one whose least eigenvalue is {np.linalg.eigvalsh(covariance)[0]:.3g}"
            raise DockairError("prior.covariance", expected=expected, got=got) from None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AttitudePrior:
    """Belief about the attitude, or about part of it.

    Raises:
        DockairError: wrong shapes, numbers that are not finite, information not symmetric and positive semidefinite.
    """

    R_CD: Array  #: (3, 3)
    information: Array  #: (3, 3) of phi in camera axes [1/rad^2], of any rank

    def __post_init__(self) -> None:
        for name in ("R_CD", "information"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3, 3) or not np.isfinite(value).all():
                raise DockairError(f"prior.{name}", expected="an array (3, 3) of finite numbers", got=value.shape)
        information = np.asarray(self.information, dtype=float)
        least = -1e-9 * np.trace(information)
        if not np.allclose(information, information.T) or np.linalg.eigvalsh(information)[0] < least:
            raise DockairError("prior.information", expected="symmetric, no negative eigenvalue", got=self.information)

    @classmethod
    def from_sigmas(cls, R_CD: Array, sigma_D_rad: Array) -> Self:
        """Take sigmas (3,) about the drogue's own axes [rad]; inf where nothing is known, as of its roll."""
        sigma = np.asarray(sigma_D_rad, dtype=float)
        if sigma.shape != (3,) or not (sigma > 0.0).all():
            raise DockairError("sigma_D_rad", expected="three numbers > 0, or inf", got=sigma_D_rad)
        return cls(R_CD=R_CD, information=R_CD @ np.diag(1.0 / sigma**2) @ R_CD.T)

    @property
    def terms(self) -> Terms:
        """What `descent_kernels.descend` takes."""
        information = np.zeros((6, 6))
        information[:3, :3] = self.information
        return np.ascontiguousarray(self.R_CD, dtype=float), _ZERO, information, _ZERO, _ZERO, 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DirectionPrior:
    """Belief about where one direction of the drogue points, whatever its roll about it.

    Raises:
        DockairError: vectors that are not of unit length, sigma not positive.
    """

    axis_C: Array  #: (3,) unit vector, camera axes: the hose's direction
    sigma_rad: float  #: standard deviation across it, in both directions
    axis_D: Array  #: (3,) unit vector, drogue axes: (1, 0, 0) for the hose

    def __post_init__(self) -> None:
        for name in ("axis_C", "axis_D"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3,) or not abs(np.linalg.norm(value) - 1.0) < _UNIT_LENGTH:
                raise DockairError(f"prior.{name}", expected="a unit vector (3,)", got=getattr(self, name))
        if not 0.0 < self.sigma_rad < np.inf:
            raise DockairError("prior.sigma_rad", expected="a number > 0", got=self.sigma_rad)

    @property
    def terms(self) -> Terms:
        """What `descent_kernels.descend` takes."""
        axis_D, axis_C = np.ascontiguousarray(self.axis_D, dtype=float), np.ascontiguousarray(self.axis_C, dtype=float)
        return _UNIT, _ZERO, _NOTHING, axis_D, axis_C, 1.0 / self.sigma_rad**2


Prior = PosePrior | AttitudePrior | DirectionPrior
