"""The payload, live or replayed: one step from a measurement to an estimate, free of ROS."""
