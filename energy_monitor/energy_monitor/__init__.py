"""Audit of a ride: books of energy and momentum, contact quality, completeness, recording and report."""
