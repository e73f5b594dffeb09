"""How well a geometry can be seen: dilution of precision, the bound of a pose, the best few of many landmarks."""

from dockair.nav.dop.bound import PoseBound, pose_bound
from dockair.nav.dop.dilution import Dop, DopStatus, dilution_of_precision, dilution_of_precision_in_plane
from dockair.nav.dop.subset import Subset, SubsetStatus, best_subset

__all__ = [
    "Dop",
    "DopStatus",
    "PoseBound",
    "Subset",
    "SubsetStatus",
    "best_subset",
    "dilution_of_precision",
    "dilution_of_precision_in_plane",
    "pose_bound",
]
