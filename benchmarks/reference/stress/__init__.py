"""Random scenes and shots, and the checks that every shot must pass."""
