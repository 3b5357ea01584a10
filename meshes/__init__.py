"""Meshes of drillfem: the string (interval with section tags) and the rock surface (periodic interval)."""
