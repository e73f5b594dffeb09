"""The tables of a scenario file, the only converters of units."""
