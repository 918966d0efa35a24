"""What is asked without a fit: one simulation, a sweep, the force by setting."""
