"""What the models must reproduce, measured: one module a name of ``scripts/validate.sh``."""
