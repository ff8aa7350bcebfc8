"""Unknown physics: what no listed effect describes."""

from .effects import Drawn, _sign, _where
from .machines import PI, between


def position_temperature_friction(r, m):
    p = dict(
        pt_A=_sign(r) * between(r, 0.05, 0.4),
        pt_q0=_where(r, m, -0.3, 0.3),
        pt_w=m["stroke"] * r.uniform(0.1, 0.5),
        pt_T=r.uniform(-4, 6),
    )
    return p, ["pt_A"], 0.02, 1.2, ("unknown_level",), 1.0


def filter_switches(r, m):
    p = dict(fs_w0=2 * PI * between(r, 300, 600), fs_w=2 * PI * between(r, 6, 25), fs_t=r.uniform(12, 28))
    return p, ["fs_w"], 2 * PI * 3, 2 * PI * 60, ("filter",), -0.5


def payload_dropped(r, m):
    return dict(dp_f=r.uniform(0.2, 1), dp_t=r.uniform(8, 25)), ["dp_f"], 0.02, 1.0, ("dropped",), 1.0


def drive_dead_band(r, m):
    return dict(db=m["Fc"] * between(r, 0.05, 0.4)), ["db"], 0.01 * m["Fc"], m["Fc"], ("deadband",), 1.0


def hysteretic_magnetic_drag(r, m):
    return (
        dict(mh_A=m["Fc"] * between(r, 0.05, 0.4), mh_L=m["stroke"] * between(r, 0.03, 0.25)),
        ["mh_A"],
        0.01 * m["Fc"],
        2 * m["Fc"],
        ("magnetic",),
        1.0,
    )


def load_changes_once(r, m):
    p = dict(
        lc_A=_sign(r) * m["Fc"] * between(r, 0.05, 0.4),
        lc_t=r.uniform(8, 25),
        lc_s=r.uniform(0, 0.8),
        lc_N=1.0,
        lc_p=r.uniform(-PI, PI),
    )
    return p, ["lc_A"], 0.01 * m["Fc"], 1.5 * m["Fc"], ("load_change",), 1.0


def distance_memory_friction(r, m):
    return (
        dict(dm_A=_sign(r) * between(r, 0.05, 0.4), dm_L=m["stroke"] * between(r, 0.05, 0.5)),
        ["dm_A"],
        0.02,
        0.8,
        ("unknown_level",),
        1.0,
    )


def torque_constant_droops(r, m):
    top = 0.35 * m["J"] * m["a"] + m["Fc"] + 0.5 * m["s2"] * m["v"]
    return dict(dr_c=between(r, 0.05, 0.4), dr_u=top, dr_tau=between(r, 3, 20)), ["dr_c"], 0.01, 2.0, ("droop",), 1.0


def ripple_with_torque(r, m):
    low, high = m["orders"]
    return (
        dict(rt_A=between(r, 0.03, 0.2), rt_N=round(between(r, low, high)), rt_p=r.uniform(-PI, PI)),
        ["rt_A"],
        0.01,
        0.7,
        ("ripple",),
        1.0,
    )


def running_in(r, m):
    p = dict(wr_A=_sign(r) * between(r, 0.05, 0.4), wr_L=m["stroke"] * between(r, 5, 40))
    return p, ["wr_A"], 0.02, 0.8, ("unknown_level",), 1.0


def mesh_damping(r, m):
    low, high = m["orders"]
    p = dict(gm_A=m["s2"] * between(r, 0.1, 0.6), gm_N=float(round(between(r, low, high))), gm_p=r.uniform(-PI, PI))
    return p, ["gm_A"], 0.02 * m["s2"], 3 * m["s2"], ("mesh",), 1.0


OUTSIDE = {
    f.__name__: f
    for f in (
        position_temperature_friction,
        filter_switches,
        payload_dropped,
        drive_dead_band,
        hysteretic_magnetic_drag,
        load_changes_once,
        distance_memory_friction,
        torque_constant_droops,
        ripple_with_torque,
        running_in,
        mesh_damping,
    )
}


def unknown(r, m, kind):
    """Draw an effect of one kind."""
    p, size, low, high, channels, power = OUTSIDE[kind](r, m)
    return Drawn("unknown", p, size, low, high, channels, power, kind)
