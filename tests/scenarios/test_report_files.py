"""What a report reads and writes: campaigns of one code; a page that is whole, or one line that says why not."""

import errno
import os
import stat
import sys
from pathlib import Path

import pytest

from dockair.errors import DockairError, MachineError
from dockair.scenarios import cli
from dockair.scenarios.campaign import journal, manifest, table
from dockair.scenarios.campaign.folder import rows_of
from dockair.scenarios.campaign.row import COLUMNS
from dockair.scenarios.report.folders import read_campaigns
from dockair.scenarios.whole_file import write_text


@pytest.fixture
def campaign(tmp_path):
    """Make a folder with a campaign of one flight, whose seed is the folder's name."""

    def make(name: str, scenario: str = "as it is", **manifested):
        folder = tmp_path / name
        folder.mkdir()
        begun = {"schema_version": manifest.SCHEMA_VERSION, "plan": {"name": "made"}}
        manifest.write_json(begun | manifested, folder / manifest.FILE_NAME)
        values = {"scenario": "still_air", "seed": ord(name), "sensing": "camera", "attempts": 0}
        texts = {
            "attempt_log": "[]",
            "timeline": "[]",
            "nav_by_range": "[]",
            "error": "ValueError: made",
            "command": f"dockair fly still_air --seed {ord(name)}",
            "scenario_hash": scenario,
        }
        table.write_table([dict.fromkeys(COLUMNS) | values | texts], folder)
        return folder

    return make


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ({"code": "c0de"}, {"code": "f00"}, "code c0de in {}/a, f00 in {}/b"),
        (
            {"code": "c0de", "plug_ins": {"mine": "1"}},
            {"code": "c0de", "plug_ins": {"mine": "2"}},
            "navigator mine 1 in {}/a, 2 in {}/b",
        ),
        (
            {"code": "c0de", "background": "analytic"},
            {"code": "c0de", "background": "mujoco"},
            "background analytic in {}/a, mujoco in {}/b",
        ),
        (
            {"versions": {"numpy": "2.1", "mujoco": "3.2"}},
            {"versions": {"mujoco": "3.3", "numpy": "2.1"}},
            "versions mujoco 3.2, numpy 2.1 in {}/a, mujoco 3.3, numpy 2.1 in {}/b",
        ),
    ],
)
def test_campaigns_of_two_codes_are_not_pooled(campaign, tmp_path, first, second, said):
    folders = [campaign("a", **first), campaign("b", **second)]
    with pytest.raises(DockairError) as refused:
        read_campaigns(folders)
    assert str(refused.value).startswith("FOLDER...: expected campaigns of the same code")
    assert said.format(tmp_path, tmp_path) in str(refused.value)
    assert all(len(read_campaigns([folder])) == 1 for folder in folders)


def test_campaigns_of_one_code_are_pooled_whoever_navigates(campaign):
    """A background is only named where a scenario left it to the machine; older manifests name no navigators."""
    same = {"code": "c0de"}
    folders = [
        campaign("a", background="analytic", **same),
        campaign("b", background="", plug_ins={"mine": "1"}, **same),
        campaign("c", background="", plug_ins={"another": "2"}, **same),
    ]
    assert len(read_campaigns(folders)) == 3


@pytest.mark.parametrize(
    ("given", "is_"),
    [("", "the folder of one flight; what came of it is in its result.json"), ("result.json", "a file")],
)
def test_of_a_flight_a_report_is_refused_with_what_it_is_and_what_is_wanted(tmp_path, monkeypatch, capsys, given, is_):
    (tmp_path / "result.json").write_text("{}")
    monkeypatch.setattr(sys, "argv", ["dockair", "report", str(tmp_path / given)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    wanted = f"{tmp_path / given}: expected the folder of a campaign, which `dockair campaign PLAN` makes, got '{is_}"
    assert said.startswith(f"dockair: {wanted}") and said.count("\n") == 1


def test_of_a_plan_s_name_a_report_says_where_its_campaign_is(campaign, tmp_path, monkeypatch):
    made = tmp_path / "out" / "campaigns"
    made.mkdir(parents=True)
    campaign("a").rename(made / "levels")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DockairError, match=r"^levels: expected the folder .*; exists: out/campaigns/levels"):
        read_campaigns([Path("levels")])
    with pytest.raises(DockairError, match="^level/manifest.json: .* which `dockair campaign PLAN` makes, got 'No "):
        read_campaigns([Path("level")])


def test_a_campaigns_folder_in_which_somebody_flew_is_still_a_campaigns(campaign):
    folder = campaign("a")
    (folder / "result.json").write_text("{}")
    assert len(read_campaigns([folder])) == 1


@pytest.mark.parametrize("version", [0, 2, "x", None])
def test_a_manifest_of_another_format_is_refused(campaign, version):
    with pytest.raises(DockairError, match=r"manifest.json: schema_version: expected 1, got "):
        read_campaigns([campaign("a", schema_version=version)])


@pytest.mark.parametrize("option", ["--out", "--evidence"])
@pytest.mark.parametrize("place", ["/proc/x.html", "{}", "{}/a/manifest.json/x.html", "/proc/none/x.html"])
def test_a_page_that_cannot_be_written_is_one_line_and_status_two(
    campaign, tmp_path, monkeypatch, capsys, option, place
):
    folder = campaign("a")
    path = place.format(tmp_path)
    monkeypatch.setattr(sys, "argv", ["dockair", "report", str(folder), option, path])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.startswith(f"dockair: {path}: expected a file that can be written, got ")
    assert said.count("\n") == 1


def test_without_room_the_page_before_stays(tmp_path, monkeypatch):
    path = write_text("before", tmp_path / "pages" / "report.html")

    def no_room(file):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_room)
    with pytest.raises(MachineError, match=r"report.html: expected room to write; make some"):
        write_text("after", path)
    assert path.read_text() == "before"
    assert [found.name for found in path.parent.iterdir()] == ["report.html"]


def test_a_link_stays_a_link_and_a_pipe_a_pipe(tmp_path):
    (tmp_path / "link.html").symlink_to(tmp_path / "page.html")
    write_text("text", tmp_path / "link.html")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "page.html").read_text() == "text"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text("text", tmp_path / "pipe")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_page_and_its_evidence_are_two_files(campaign, tmp_path, monkeypatch, capsys):
    folder = campaign("a")
    monkeypatch.setattr(sys, "argv", ["dockair", "report", str(folder), "--evidence", f"{tmp_path}/a/../a/report.html"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    assert "expected a file of its own, got" in capsys.readouterr().err
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize("text", ["{}", "[]", '{"plan": {}}', '{"plan": null}', '{"plan": "levels"}'])
def test_a_manifest_without_a_plan_is_refused(campaign, text):
    folder = campaign("a")
    (folder / manifest.FILE_NAME).write_text(text)
    with pytest.raises(DockairError, match=r"manifest.json: expected the manifest of a campaign, got 'no plan"):
        read_campaigns([folder])


@pytest.mark.parametrize("key", ["plug_ins", "versions", "files"])
def test_a_manifest_with_something_else_in_place_of_a_table_is_refused(campaign, key):
    with pytest.raises(DockairError, match=f"manifest.json: expected a table {key} in the manifest of a campaign"):
        read_campaigns([campaign("a", **{key: [1]})])


def test_a_scenario_that_was_edited_between_two_campaigns_is_not_pooled_with_itself(campaign):
    folders = [campaign("a", files={"still_air": "1"}), campaign("b", files={"still_air": "2"})]
    with pytest.raises(DockairError) as refused:
        read_campaigns(folders)
    assert str(refused.value) == (
        "FOLDER...: expected one content of a scenario's name; of others a report each, or another name, "
        f"got 'still_air in {folders[0]}, another in {folders[1]}'"
    )
    assert len(read_campaigns([folders[0], campaign("c", files={"still_air": "1", "mine": "2"})])) == 2


def test_where_no_manifest_says_what_a_file_held_the_flights_digest_does(campaign):
    folders = [campaign("a"), campaign("b", scenario="another")]
    with pytest.raises(DockairError, match=r"still_air --seed 97 in .*/a, another scenario by .* --seed 98 in .*/b"):
        read_campaigns(folders)


def test_draws_of_one_scenario_are_one_scenario(campaign):
    """Each drawn value has a digest of its own."""
    folders = []
    for name in "ab":
        folders.append(campaign(name, scenario=name))
        (row,) = rows_of(folders[-1])
        drawn = {"set.start.aft_m": 3.0, "command": f"{row['command']} --set start.aft_m=3.0"}
        table.write_table([row | drawn], folders[-1])
    assert len(read_campaigns(folders)) == 2


@pytest.fixture
def report(monkeypatch, capsys):
    """Run `dockair report`; return its exit status and stderr."""

    def report(*arguments) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["dockair", "report", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return ended.value.code, capsys.readouterr().err

    return report


@pytest.mark.parametrize("option", ["--out", "--evidence"])
@pytest.mark.parametrize(
    "name", ["journal.jsonl", "manifest.json", "flights.parquet", "summary.json", "timing.json", "manifest.json.part"]
)
def test_a_campaigns_own_files_are_not_written_over(campaign, report, tmp_path, option, name):
    folder, other = campaign("a"), campaign("b")
    (other / journal.FILE_NAME).touch()
    before = {path: path.read_bytes() for path in other.iterdir()}
    (tmp_path / "link").symlink_to(other)
    for path in (other / name, tmp_path / "link" / name):
        said = f'dockair: {option} {path}: expected a file of its own, got "a campaign\'s"\n'
        assert report(folder, option, path) == (2, said)
    assert {path: path.read_bytes() for path in other.iterdir()} == before
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize("option", ["--out", "--evidence"])
@pytest.mark.parametrize("name", ["result.json", "as_built.json", "episode.rrd"])
def test_a_flights_own_files_are_not_written_over(campaign, report, tmp_path, option, name):
    for file in ("result.json", "flight.parquet", "as_built.json"):
        (tmp_path / file).write_text(file)
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    said = f'dockair: {option} {tmp_path / name}: expected a file of its own, got "a flight\'s"\n'
    folder = campaign("a")
    assert report(folder, option, tmp_path / name) == (2, said)
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before
    assert report(folder, option, tmp_path / "page.html") == (0, "")


def test_where_no_campaign_and_no_flight_is_their_names_are_anybodys(campaign, report, tmp_path):
    folder = campaign("a")
    for name in ("summary.json", "result.json", "result.json"):
        assert report(folder, "--out", tmp_path / "page.html", "--evidence", tmp_path / name) == (0, "")
        assert (tmp_path / name).is_file()


def test_a_table_that_was_cut_off_is_one_line(campaign, report):
    folder = campaign("a")
    path = folder / table.FILE_NAME
    path.write_bytes(path.read_bytes()[:-100])
    status, said = report(folder)
    assert (status, said.count("\n")) == (2, 1)
    assert said.startswith(f"dockair: {path}: expected the table of a campaign (removed, it is made again by")


def test_a_table_of_something_else_is_one_line(campaign, report):
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = campaign("a")
    pq.write_table(pa.table({"departures": [1, 2]}), folder / table.FILE_NAME)
    status, said = report(folder)
    assert (status, said.count("\n")) == (2, 1)
    assert said.endswith("got 'rows of something else'\n")


@pytest.mark.parametrize(
    "arguments", [["{long}"], ["{folder}", "--out", "{long}"], ["{folder}", "--evidence", "{long}"]]
)
def test_a_name_that_is_too_long_is_one_line(campaign, report, arguments):
    places = {"long": "n" * 300, "folder": campaign("a")}
    status, said = report(*(argument.format(**places) for argument in arguments))
    assert (status, said.count("\n")) == (2, 1)
    assert "got 'File name too long'" in said
