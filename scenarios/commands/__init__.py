"""The command line's commands, where they are more than a call, and what they show."""
