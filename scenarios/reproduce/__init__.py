"""Published figures and tables made again by the code that flies, each beside its printed numbers."""
