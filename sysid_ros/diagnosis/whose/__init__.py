"""Whose torques they are: the URDF's robot, another one or none, and faults of the channels."""
