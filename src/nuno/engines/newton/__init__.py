"""The Newton engine (newton-physics)."""
