"""What every folder may use: errors, files, the terminal, interrupts, memory, units."""
