"""What guidance foresees, plans, and does on the probe."""
