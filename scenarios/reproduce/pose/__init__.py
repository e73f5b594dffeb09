"""Solvers of the pose: accuracy, both minima, faults, competitors."""
