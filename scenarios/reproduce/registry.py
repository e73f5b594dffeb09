"""What can be reproduced, by id.

A reproduction is a function of a folder for its picture, or None for no picture. It returns

    {"id": ..., "source": ..., "rows": [{"case": ..., "ours": {...}, "reference": {...}}]}

with units in the keys; `ours` has every key of `reference`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.reproduce import (
    contact_sheet,
    dop_figures,
    fusion_consistency,
    fusion_outages,
    ground_fig29,
    heading_flight,
    heading_oval,
    heading_pairs,
    heading_straight,
    image_contour,
    image_ellipse,
    image_frames,
    image_hough,
    image_identification,
    image_kalman,
    image_labels,
    image_morphology,
    image_panels,
    image_three_point,
    pose_divergence,
    pose_efficiency,
    pose_flips,
    pose_frontal,
    pose_integrity,
    pose_opencv,
    pose_surface,
    pose_table3,
    sensor_band,
    world_bow_wave,
    world_contact,
    world_convergence,
    world_excursions,
    world_gusts,
    world_hose_checks,
    world_receiver,
    world_reel,
    world_static,
    world_swing,
    world_velocity_hold,
    world_wake,
    world_whip,
)

Reproduction = Callable[[Path | None], dict[str, Any]]

_MODULES = (
    contact_sheet,
    fusion_consistency,
    fusion_outages,
    ground_fig29,
    heading_flight,
    heading_oval,
    heading_straight,
    image_contour,
    image_ellipse,
    image_frames,
    image_identification,
    image_kalman,
    image_labels,
    image_morphology,
    image_panels,
    image_three_point,
    pose_divergence,
    pose_efficiency,
    pose_flips,
    pose_frontal,
    pose_integrity,
    pose_opencv,
    sensor_band,
    world_bow_wave,
    world_contact,
    world_convergence,
    world_excursions,
    world_gusts,
    world_hose_checks,
    world_receiver,
    world_reel,
    world_static,
    world_swing,
    world_velocity_hold,
    world_wake,
    world_whip,
)
_REPRODUCTIONS: dict[str, tuple[str, Reproduction]] = {
    **{module.ID: (module.TITLE, module.reproduce) for module in _MODULES},
    **dop_figures.REPRODUCTIONS,
    **heading_pairs.REPRODUCTIONS,
    **image_hough.REPRODUCTIONS,
    **pose_surface.REPRODUCTIONS,
    **pose_table3.REPRODUCTIONS,
}


def ids() -> tuple[str, ...]:
    """Return the ids, sorted."""
    return tuple(sorted(_REPRODUCTIONS))


def titles() -> dict[str, str]:
    """Return what each id shows."""
    return {wanted: _REPRODUCTIONS[wanted][0] for wanted in ids()}


def reproduce(wanted: str, out: Path | None = None) -> dict[str, Any]:
    """Run one reproduction; with `out`, a folder that need not exist, its picture is put there.

    Raises:
        DockairError: no such id.
    """
    if wanted not in _REPRODUCTIONS:
        raise DockairError("reproduce", expected="the id of a reproduction", got=wanted, exists=ids())
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    return _REPRODUCTIONS[wanted][1](out)
