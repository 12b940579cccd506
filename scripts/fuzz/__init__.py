"""Damaged files of every kind that is read: what comes of them is judged. Run by ``scripts/fuzz.sh``."""
