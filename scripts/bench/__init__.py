"""How long things take on this machine, as distributions: ``scripts/bench.sh NAME``."""
