"""Rides in real time, measured: alone or disturbed, one build or two in turns."""
