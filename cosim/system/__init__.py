"""What is simulated: scenario, wiring, coupling algorithm, schedule, faults, diagram and SSP."""
