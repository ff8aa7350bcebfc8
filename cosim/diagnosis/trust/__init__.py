"""Is it the recording at all? What is impossible is refused, what is doubtful is said before any effect is named."""
