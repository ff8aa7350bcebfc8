"""Equation and symbols of every effect, for the closed "Numbers" of a finding; an effect torque resists."""

EQUATIONS = {
    "friction_asymmetry": "F (1 + a sign v) + σ₂ v (1 + b sign v)",
    "stribeck": "[Fc + (Fs − Fc) exp(−|v/Vs|^δ)] sign v",
    "presliding": "dz/dt = v − σ₀ |v| z / g(v)",
    "cogging": "a cos(N q + φ)",
    "position_friction": "F (1 + r cos(N q + φ)), or F (1 + r) near one place",
    "gravity_unbalance": "mgl sin(q + φ)",
    "torque_offset": "τ₀",
    "thermal_viscosity": "F exp(k₁ (T − 20 °C)) + σ₂ v exp(k₂ (T − 20 °C))",
    "dwell_breakaway": "F + c ln(1 + age / t₀)",
    "compliance": "two masses on a spring: antiresonance, resonance",
    "actuator_lag": "τ_applied = τ / (1 + s T)",
    "delay": "τ_applied(t) = τ(t − T)",
    "backlash": "no torque inside the gap",
    "encoder_eccentricity": "reading = q + e₁ sin(N q + φ) + e₂ sin 2(N q + φ)",
    "quadratic_drag": "c v |v|",
    "cable_wrap": "k x (1 + h x²), x = q − q₀",
    "inertia_variation": "J (1 + r cos(N q + φ))",
    "load_dependent_friction": "F (1 + c |load|)",
    "torque_saturation": "the drive gives less above the knee",
    "periodic_disturbance": "a sin(2π f t + φ)",
    "clock_skew": "t_q = t_τ (1 + drift) + offset",
}
CONDITIONS = {
    "thermal_viscosity": "record 20 min from cold, with the temperature",
    "dwell_breakaway": "record stops of 1, 10 and 100 s before the same move",
    "clock_skew": "record 10 min in one piece",
    "encoder_eccentricity": "record at least one whole turn at two speeds",
    "gravity_unbalance": "record at least half a turn, slowly, with stops",
    "backlash": "record slow reversals under light load",
    "compliance": "record fast sweeps up to 40 Hz",
    "load_dependent_friction": "record with two different loads",
    "torque_saturation": "record the hardest acceleration that is allowed",
    "friction_asymmetry": "record the same speeds in both directions",
    "quadratic_drag": "record the highest speed that is allowed",
}
"""What to record where an effect cannot be tested and the diagnosis does not say."""
