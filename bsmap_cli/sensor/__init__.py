"""What was measured, in its own frame: scans, odometry, the simulator."""
