"""Buckling of a string in its hole, found from the rod itself."""
