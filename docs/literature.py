"""Where effects come from whose own file names no source."""

LITERATURE = {
    "actuator_lag": "Ellis, Control System Design Guide, 4th edition (2012), on current loops.",
    "cable_wrap": "A spring; no source is needed.",
    "clock_skew": "Moon, Skelly, Towsley, Estimation and removal of clock skew from network delay measurements, "
    "IEEE INFOCOM (1999).",
    "axis_coupling": "Siciliano, Sciavicco, Villani, Oriolo, Robotics (2009), section 7.1.",
    "constant_force": "A constant; no source is needed.",
    "cogging": "Zhu, Howe, IEEE Transactions on Energy Conversion 15 (2000) 407.",
    "friction_asymmetry": "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083.",
    "gravity_unbalance": "Siciliano, Sciavicco, Villani, Oriolo, Robotics (2009), chapter 7.",
    "periodic_disturbance": "Bodson, Douglas, Automatica 33 (1997) 2213.",
    "position_friction": "Popovic, Goldenberg, IEEE Transactions on Robotics and Automation 14 (1998) 114.",
    "torque_offset": "A constant; no source is needed.",
}
