"""Parameters and a displacement to the damper's response; the only door to the compiled core."""
