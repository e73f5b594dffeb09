"""From a scenario to its world, sensors and navigator."""
