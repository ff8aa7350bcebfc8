"""What a diagnosis hands over: JSON, cards, FMUs, the closed loop, files of proposed effects."""
