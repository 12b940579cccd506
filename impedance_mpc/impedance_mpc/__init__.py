"""Model predictive impedance controller: makes the rig move like the contact wire (thesis 3.2)."""
