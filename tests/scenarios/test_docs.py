"""What the pages show works as shown."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from dockair.scenarios.envs import DockEnv
from dockair.scenarios.statistics import wilson_interval

ROOT = Path(__file__).parents[2]


def python_blocks(page):
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


def run(folder, *arguments):
    return subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.gl
def test_the_navigator_of_ones_own_flies_from_the_folder_one_stands_in_and_replays(tmp_path):
    (tmp_path / "own_command.py").write_text(python_blocks("docs/navigation.md")[0], encoding="utf-8")
    short = ("--set", "flight.duration_s=1", "--out", "flown")
    flown = run(tmp_path, "-m", "dockair", "fly", "--set", "navigation.navigator=own_command.py:OwnCommand", *short)
    assert flown.returncode == 0, flown.stderr
    assert flown.stdout.startswith("timeout")
    replayed = run(tmp_path, "-m", "dockair", "replay", "flown")
    assert replayed.returncode == 0 and replayed.stdout.startswith("identical"), replayed.stderr


@pytest.mark.slow
def test_the_wrapper_that_draws_settings_does_so_at_every_reset_and_a_seed_determines_them():
    shown = next(block for block in python_blocks("docs/environments.md") if "class Drawn" in block)
    names: dict = {"__name__": "shown"}
    exec(shown, names)  # noqa: S102 - the page's own lines
    env = names["Drawn"](DockEnv("truth_navigation"))
    seeds = (3, None, 3, None)
    flown = []
    for seed in seeds:
        _, info = env.reset(seed=seed)
        flown.append(env.unwrapped._flight.scenario)
        assert info["set"]["turbulence.sigma_m_s"] == flown[-1].turbulence.sigma_m_s
    env.close()
    sigmas = [scenario.turbulence.sigma_m_s for scenario in flown]
    assert sigmas[:2] == sigmas[2:] and sigmas[0] != sigmas[1]
    assert flown[1].flight.duration_s == 12.0


def test_an_id_that_names_the_package_is_found_where_nobody_has_imported_it(tmp_path):
    script = 'import gymnasium; print(gymnasium.make("dockair:dockair/DockFast-v0").spec.id)'
    found = run(tmp_path, "-c", script)
    assert found.stdout.strip() == "dockair/DockFast-v0", found.stderr


PAGES = [
    str(page.relative_to(ROOT))
    for page in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
    if "```python" in page.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("page", PAGES)
def test_code_on_a_page_is_python(page):
    blocks = python_blocks(page)
    assert blocks
    for block in blocks:
        compile(block, page, "exec")


def test_the_pages_with_code_are_found():
    assert {"README.md", "docs/environments.md", "docs/tutorials/own_controller.md"} <= set(PAGES)


def test_every_relative_link_leads_somewhere():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]
    assert len(pages) > 10
    broken = [
        f"{page.relative_to(ROOT)}: {target}"
        for page in pages
        for target in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", page.read_text(encoding="utf-8"))
        if not (page.parent / target).exists()
    ]
    assert broken == []


COUNT_AND_INTERVAL = re.compile(r"(\d+) of (\d+) \(([\d.]+)-([\d.]+) %\)")


def test_an_interval_beside_a_count_is_wilsons():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]
    found = [(page, m) for page in pages for m in COUNT_AND_INTERVAL.finditer(page.read_text(encoding="utf-8"))]
    assert len(found) >= 12
    wrong = []
    for page, m in found:
        limits = wilson_interval(int(m[1]), int(m[2]))
        said = [
            f"{100.0 * limit:.{len(text.partition('.')[2])}f}"
            for limit, text in zip(limits, m.groups()[2:], strict=True)
        ]
        if said != [m[3], m[4]]:
            wrong.append(f"{page.relative_to(ROOT)}: {m[0]}, Wilson's {'-'.join(said)} %")
    assert not wrong
