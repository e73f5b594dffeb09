"""Where a flight may be written, and what is never lost."""

import pytest

from dockair.errors import DockairError
from dockair.nav.navigator import Navigator
from dockair.scenarios.loop import fly
from dockair.scenarios.output_folder import (
    FLIGHT_FILES,
    check_output_folder,
    forget_flight,
    keep_flight,
    made_folder,
    prepare_output_folder,
)
from dockair.scenarios.schema import load_scenario


def filled(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(name)
    return folder


def test_a_new_or_empty_folder_is_made(tmp_path):
    under_way = prepare_output_folder(tmp_path / "a" / "b")
    assert under_way.parent == tmp_path / "a" / "b" and list(under_way.iterdir()) == []
    forget_flight(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_an_earlier_flights_files_go_when_the_next_one_is_whole_and_others_stay(tmp_path):
    folder = filled(tmp_path / "out", *FLIGHT_FILES, "notes.txt")
    (prepare_output_folder(folder) / "result.json").write_text("new")
    assert {path.name for path in folder.iterdir()} >= {*FLIGHT_FILES, "notes.txt"}
    keep_flight(folder)
    assert sorted(path.name for path in folder.iterdir()) == ["notes.txt", "result.json"]
    assert (folder / "result.json").read_text() == "new"


def test_what_a_killed_flight_has_left_is_no_obstacle_and_no_part_of_the_next(tmp_path):
    (prepare_output_folder(tmp_path / "out") / "estimates.parquet").write_text("half")
    assert list(prepare_output_folder(tmp_path / "out").iterdir()) == []


class _EndsHalfway:
    """A navigator of one's own that answers nothing after some ticks."""

    def __init__(self, sheets):
        self._good, self._ticks = Navigator(sheets), 0

    def step(self, imu, frame):
        self._ticks += 1
        return None if self._ticks > 20 else self._good.step(imu, frame)


@pytest.mark.parametrize("record", ["window", "none"])
def test_a_flight_that_comes_to_nothing_leaves_the_earlier_one(tmp_path, record):
    folder = filled(tmp_path / "out", *FLIGHT_FILES, "notes.txt")
    with pytest.raises(DockairError, match="expected a NavSolution"):
        fly(load_scenario("still_air", {"navigation.navigator": f"{__name__}:_EndsHalfway"}), out=folder, record=record)
    assert sorted(path.name for path in folder.iterdir()) == sorted([*FLIGHT_FILES, "notes.txt"])
    assert all((folder / name).read_text() == name for name in FLIGHT_FILES)


@pytest.mark.parametrize("act", [check_output_folder, prepare_output_folder])
def test_a_file_or_a_folder_with_other_peoples_files_is_refused_untouched(tmp_path, act):
    thesis = filled(tmp_path / "mine", "thesis.tex") / "thesis.tex"
    for folder in (thesis, thesis.parent):
        with pytest.raises(DockairError, match="expected a new or empty folder, or one with an earlier flight"):
            act(folder)
    assert thesis.read_text() == "thesis.tex"


def test_checking_changes_nothing(tmp_path):
    folder = filled(tmp_path / "out", *FLIGHT_FILES)
    check_output_folder(folder)
    check_output_folder(tmp_path / "new")
    assert sorted(path.name for path in folder.iterdir()) == sorted(FLIGHT_FILES)
    assert not (tmp_path / "new").exists()


def test_a_flight_that_cannot_be_built_leaves_the_earlier_one(tmp_path):
    folder = filled(tmp_path / "out", "result.json", "episode.rrd")
    with pytest.raises(DockairError, match="nobody:Here"):
        fly(load_scenario("still_air", {"navigation.navigator": "nobody:Here"}), out=folder)
    assert sorted(path.name for path in folder.iterdir()) == ["episode.rrd", "result.json"]


def test_a_folder_is_made_and_nothing_is_left_in_it(tmp_path):
    assert made_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert made_folder(tmp_path / "a") == tmp_path / "a"
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "b"]
