"""What is measured of an answer for its readers: errors, places, bounds. It decides nothing."""
