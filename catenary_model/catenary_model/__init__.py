"""Catenary of an electric railway as finite elements in the moving frame of the train (thesis 3.1)."""
