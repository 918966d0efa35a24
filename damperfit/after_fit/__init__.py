"""What follows a fit: the next test, valves as parts, the ride, a passport, a watched folder."""
