"""The aircraft: receiver and its flight control, tanker."""
