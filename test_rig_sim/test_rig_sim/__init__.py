"""Simulated pantograph test rig: linear drive, inner position loop, pantograph, contact, load cell."""
