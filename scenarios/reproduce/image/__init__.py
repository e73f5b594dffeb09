"""The source's image processing, stage by stage, on rendered frames."""
