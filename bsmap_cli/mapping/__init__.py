"""Section III: curves from scans and a map from curves."""
