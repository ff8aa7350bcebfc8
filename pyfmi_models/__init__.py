"""What the world is: equations, model cards, and how equations become C and FMUs.

Signs, stated once for the whole package: the commanded torque `tau` drives, everything else resists,

    J q'' = tau - tau_f - loads - effects - disturbance.

SI units throughout (rad, rad/s, N m, s; for a linear axis m, m/s, N).
"""
