"""Hose, air, reel, contact and receiver against closed forms and published cases."""
