"""What changed on which robot, since when and how sure that is: trends, change points and alarms over a fleet's store."""
