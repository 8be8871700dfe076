"""Motions that tell most about a model, within the limits and without collisions."""
