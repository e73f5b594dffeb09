"""How fast a flight and its parts run on this machine: `dockair bench`."""
