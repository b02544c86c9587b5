"""References that the engine is compared with: a 50-digit simulator, an engine without optimisations, and checks."""
