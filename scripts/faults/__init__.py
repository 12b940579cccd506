"""Faults done to a running ride, and what becomes of it: ``scripts/faults.sh``."""
