"""The pose's benchmark times every way it names; how fast it is belongs to the machine and is not tested."""

import cv2
import pytest

from dockair.scenarios.bench import pose


@pytest.mark.slow
def test_every_solver_is_timed_and_opencv_gets_its_threads_back(monkeypatch):
    monkeypatch.setattr(pose, "_CALLS", 2)
    threads = cv2.getNumThreads()
    figures = pose.bench_pose()
    us, ratios = figures["microseconds"], figures["ratios"]
    assert all(value > 0.0 for value in us.values()) and cv2.getNumThreads() == threads
    assert len(ratios) == sum("OpenCV" in name for name in us) == 4
    tracked = f"{pose._OPENCV_TRACKED} over {pose._TRACKED}"
    assert ratios[tracked] == us[pose._OPENCV_TRACKED] / us[pose._TRACKED]
    assert all(
        ratios[name] == us[name.removesuffix(f" over {pose._FREE}")] / us[pose._FREE]
        for name in ratios.keys() - {tracked}
    )
