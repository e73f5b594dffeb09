"""The join: scenarios, the closed loop, the referee, results. Nobody imports it."""
