"""The live viewer: what it logs while an episode is flown, and that each episode is a recording of its own."""

from types import SimpleNamespace

import numpy as np
import pytest

from dockair.errors import MachineError
from dockair.scenarios import envs_viewer
from dockair.scenarios.envs_viewer import LiveViewer
from dockair.scenarios.loop import Tick

SECONDS = 0.5


def _flight(hand_made):
    return SimpleNamespace(
        scenario=SimpleNamespace(name="hand made"), sheets=hand_made.sheets, world=SimpleNamespace(model=None),
        truth=hand_made.truth(0),
    )  # fmt: skip


def _show(viewer, hand_made, flight, ticks: int) -> None:
    for truth, imu, frame, solution in hand_made.ticks(ticks):
        viewer.show(flight, Tick(truth=truth, imu=imu, frame=frame, solution=solution, outcome=None))


@pytest.fixture
def shown(hand_made, monkeypatch, tmp_path):
    """Two episodes of half a second, kept in files."""
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    paths, recordings = [], []

    def keep(recording) -> None:
        paths.append(tmp_path / f"{len(paths)}.rrd")
        recordings.append(recording)
        recording.save(paths[-1])

    viewer = LiveViewer(keep)
    for _ in range(2):
        _show(viewer, hand_made, _flight(hand_made), round(100 * SECONDS))
    for recording in recordings:
        recording.flush()
        recording.disconnect()
    return paths


def _rows(path) -> dict[str, list]:
    from rerun.chunk import RrdReader

    rows: dict[str, list] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            rows.setdefault(f"{chunk.entity_path}:{name}", []).extend(batch[name].to_pylist())
    return rows


def _recording_id(path) -> str:
    from rerun.chunk import RrdReader

    return RrdReader(path).recordings()[0].recording_id


def test_each_episode_is_a_recording_with_truth_and_belief_at_the_viewers_rate(shown, hand_made):
    assert len(shown) == 2
    assert len({_recording_id(path) for path in shown}) == 2
    for path in shown:
        rows = _rows(path)
        ranges = [value[0] for value in rows["/plots/range/belief:Scalars:scalars"]]
        assert len(ranges) == pytest.approx(20.0 * SECONDS, abs=1)
        np.testing.assert_allclose(ranges[0], hand_made.tick(1)[3].p_PD_B[0])
        assert any(key.startswith("/world/receiver/belief:") for key in rows)
        assert any(key.startswith("/camera/window/pixels:") for key in rows)


def test_without_the_viewers_program_the_machine_is_said_to_lack_it(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer.shutil, "which", lambda *args, **kwargs: None)
    with pytest.raises(MachineError, match="render_mode: expected the rerun viewer"):
        _show(LiveViewer(), hand_made, _flight(hand_made), 1)


def test_a_viewer_that_is_asked_twice_for_one_tick_draws_it_once(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    opened = []
    viewer = LiveViewer(opened.append)
    flight = _flight(hand_made)
    drawn = []
    monkeypatch.setattr(envs_viewer, "log_scene", lambda recording, log, ticks, sheets, shapes: drawn.append(ticks))
    _show(viewer, hand_made, flight, 4)
    assert len(opened) == 1
    assert drawn == [[], [0]]
