"""The hose, from the reel in the pod to the coupling in the drogue."""
