"""POV-Ray as the cross-check: a NumPy model of its shading, and tests that compare the two."""
