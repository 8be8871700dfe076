"""What a robot on legs adds: feet, stance, trunk, and rows that are free of the contact forces."""
