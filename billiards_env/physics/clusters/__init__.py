"""Impacts of several balls at one instant."""
