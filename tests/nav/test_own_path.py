"""The receiver's place by its own commands."""

import numpy as np

from dockair.nav.guidance.own_path import OwnPath

RESPONSE_S = np.array([0.4, 0.17, 0.14])


def test_each_axis_flies_its_commands_a_response_time_later():
    path, u = OwnPath(RESPONSE_S, 0.01), np.random.default_rng(1).normal(size=(300, 3))
    sums = np.vstack([np.zeros(3), np.cumsum(u, axis=0) * 0.01])
    for k in range(300):
        path.step(u[k])
        late = [max(k + 1 - n, 0) for n in (40, 17, 14)]
        np.testing.assert_allclose(path.place_m, [sums[n, i] for i, n in enumerate(late)], atol=1e-12)
        np.testing.assert_allclose(path.velocity_m_s, [u[n - 1, i] if n else 0.0 for i, n in enumerate(late)])
        np.testing.assert_allclose(path.place_ahead_m, sums[k + 1], atol=1e-12)
