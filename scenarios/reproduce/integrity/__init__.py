"""What a slow fault and missing frames do."""
