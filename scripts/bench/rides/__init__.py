"""Rides in lockstep, measured as a user sees them: how fast, how soon, with how much processor time and memory."""
