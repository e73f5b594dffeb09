"""Where a flight may be written, and what is never lost."""

import pytest

from dockair.errors import DockairError
from dockair.scenarios.loop import fly
from dockair.scenarios.output_folder import FLIGHT_FILES, check_output_folder, made_folder, prepare_output_folder
from dockair.scenarios.schema import load_scenario


def filled(folder, *names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(name)
    return folder


def test_a_new_or_empty_folder_is_made(tmp_path):
    prepare_output_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_an_earlier_flights_files_go_and_others_stay(tmp_path):
    prepare_output_folder(filled(tmp_path / "out", *FLIGHT_FILES, "notes.txt"))
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["notes.txt"]


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
