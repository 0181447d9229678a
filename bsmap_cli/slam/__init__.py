"""Section IV and beyond: where the robot was, and a map that closes."""
