"""What a worker process flies is the job it was ordered."""

import pickle

import pytest

from dockair.scenarios.campaign.jobs import jobs_of
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.row import columns_of
from dockair.scenarios.campaign.worker import Order, fly_order
from dockair.scenarios.loop import fly

pytestmark = pytest.mark.slow

PLAN = """name = "p"
seeds = [7, 8]
scenarios = ["light_gusts"]

[set]
"camera.sensing" = "measurements"
"flight.duration_s" = 1.0
"""


@pytest.fixture
def jobs(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(PLAN)
    return jobs_of(PlanFile(path))


def test_an_order_is_flown_with_its_jobs_scenario_and_seed(jobs):
    flown = [fly_order(Order(seed=job.seed, key=job.key, pickled=pickle.dumps(job))) for job in jobs]
    assert flown == [columns_of(fly(job.scenario, seed)) for job, seed in zip(jobs, (7, 8), strict=True)]
    for name in ("nav_range_rmse_m", "nav_lateral_rmse_m", "nav_velocity_rmse_m_s", "nav_nees_mean"):
        assert flown[0][name] != flown[1][name]
