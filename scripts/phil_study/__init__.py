"""What studies (`validate`) and benches (`bench`) have in common: what they find, and their command line."""
