"""The source's ground test."""
