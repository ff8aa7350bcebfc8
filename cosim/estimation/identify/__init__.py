"""Parameters of a known structure from recordings: friction map, presliding step, output error in closed loop."""
