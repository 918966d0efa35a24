"""The paper's damper: an orifice and two linear checks, oil with one bulk modulus, friction."""
