"""Programs of observatories point the simulated mount: one telescope, spoken to by ASCOM Alpaca and by INDI."""
