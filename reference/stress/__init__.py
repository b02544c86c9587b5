"""Shots by the million: what must hold of every one of them, whatever the scene."""
