"""What of a machine stands in the way of a ride in real time, and what to type about it."""
