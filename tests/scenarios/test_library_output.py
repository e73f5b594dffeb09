"""The library as it is listed: what each scenario claims and what it is held to."""

from dockair.scenarios.accept import Accept
from dockair.scenarios.commands.library_output import show_scenario, show_scenarios
from dockair.scenarios.schema import Scenario, load_scenario


def test_each_scenario_is_one_line_with_claim_and_acceptance_also_in_a_file(capsys):
    """Of 80 columns, as a terminal has them, the claim alone takes more than half."""
    accept, claim = (
        Accept(outcome="contact", radial_offset_max_m=0.15),
        "it docks in light gusts, with the Sun astern, too",
    )
    show_scenarios([Scenario(name="one", claim=claim, accept=accept), Scenario(name="two", claim="it may")])
    lines = [line.split("  ") for line in capsys.readouterr().out.splitlines()[1:]]
    assert [[part.strip() for part in line if part.strip()] for line in lines] == [
        ["one", claim, "contact, within 0.15 m"],
        ["two", "it may"],
    ]


def test_one_scenario_is_shown_as_it_was_written_brackets_included(capsys, tmp_path):
    """Tables of TOML look like the mark-up of the terminal's printer, which would swallow them."""
    path = tmp_path / "mine.toml"
    path.write_text(
        '# mine\nname = "mine"\n[flight]\nduration_s = 5.0\n[accept]\noutcome = "timeout"\n', encoding="utf-8"
    )
    show_scenario(str(path), load_scenario(path))
    out = capsys.readouterr().out
    assert out.startswith(path.read_text(encoding="utf-8").rstrip())
    assert out.splitlines()[-1] == "held to: timeout"


def test_a_scenario_is_shown_without_the_mark_that_an_editor_put_before_it(capsys, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('\ufeffname = "mine"\n', encoding="utf-8")
    show_scenario(str(path), load_scenario(path))
    assert capsys.readouterr().out == 'name = "mine"\n'
