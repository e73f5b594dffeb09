"""What the hose is told of a pod that moves."""

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters

RACETRACK = TankerPathParameters(
    manoeuvre="racetrack", starts_s=0.1, bank_rad=np.radians(25.0), roll_rate_rad_s=np.radians(30.0)
)


def test_the_pods_motion_is_how_the_hoses_exit_moves_along_the_path(make_world):
    """While it rolls into a turn: place and velocity of the exit, by central differences, and the tanker's turning."""
    world = make_world(p_PD_B=(60.0, 0.0, 0.0), tanker_path=RACETRACK)
    for _ in range(600):
        truth = world.step(ReceiverCommand())
    exit_T, pod, h = world.parameters.tanker.exit_m, world._tanker.pod(), 1e-4
    path = TankerPath(RACETRACK, 180.0, -np.asarray(exit_T))
    before, now, after = (
        state.p_WT + state.R_WT @ exit_T for state in (path.at(0.6 + shift) for shift in (-h, 0.0, h))
    )
    assert np.linalg.norm(truth.w_WT_T) > 0.1
    np.testing.assert_allclose(pod.p_WO, now, atol=1e-9)
    np.testing.assert_allclose(pod.v_WO, (after - before) / (2.0 * h), atol=1e-5)
    np.testing.assert_allclose(pod.w_WT, truth.R_WT @ truth.w_WT_T, atol=1e-12)
    np.testing.assert_allclose(pod.R_WT, truth.R_WT, atol=1e-12)


def test_a_pod_that_rests_in_the_origin_has_no_motion(make_world):
    assert make_world(p_PD_B=(60.0, 0.0, 0.0))._tanker.pod() is None
