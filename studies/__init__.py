"""Experiments with trained agents: results of the recipes, effects of the timestep, players without training."""
