"""Dilution of precision: the source's figures 5 to 8."""
