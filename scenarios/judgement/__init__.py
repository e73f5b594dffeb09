"""What became of a flight, told from the truth: outcome, attempts, what was unsafe, why it failed, figures."""
