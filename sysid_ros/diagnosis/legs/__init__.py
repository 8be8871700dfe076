"""Diagnosis of robots on legs: their rows, the search in them, and the whole of it."""
