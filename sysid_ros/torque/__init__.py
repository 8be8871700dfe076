"""The one sum of torques: what is known of it, what is free, and the file that keeps it."""
