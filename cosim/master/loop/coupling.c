/* Components that exchange continuous quantities, taken over one tick together.
 *
 * ITERATE: the theta method. Each wire between them holds  u = (1 - theta) y(t_k) + theta y(t_(k+1)),  where the value at
 * the end is found by iteration: the components step in their order, each with the newest values of those before it; the
 * wires that point back are corrected by Aitken's method until they agree, and everybody is taken back in between.
 *
 * BALANCE: nobody is taken back. The tick is cut into pieces; each wire holds the value at the start of the piece plus
 * half of what it will change if it goes on as in the piece before; with equal pieces that gives back what holding cost
 * (NEPCE, Benedikt et al. 2013). The energy that is lost on each bond, |u_2 y_1 - u_1 y_2| h with means over the piece,
 * sets the size of the next piece (ECCO, Sadjina et al. 2017, Engineering with Computers 33, 607; exponents 1/8 and 1/4,
 * which need only roots).
 *
 * Outputs are read again after the inputs have their values of the same time, because outputs may follow inputs at once. */
#include "part.h"

static double larger(double one, double other)
{
    return one > other ? one : other;
}

static bool feeds(const Inner *inner, const Part *part)
{
    return inner->wire >= part->wire && inner->wire < part->wire + part->wires;
}

static double *target(const Loop *loop, const Inner *inner)
{
    return &loop->bus[loop->wire[inner->wire].target];
}

static int set_all(const Loop *loop, const Stage *stage, const Part *part, bool held)
{
    for (int64_t i = 0; i < stage->inners; i++) {
        Inner *inner = &stage->inner[i];
        if (feeds(inner, part)) {
            *target(loop, inner) = held ? inner->held : inner->guess;
        }
    }
    return set_inputs(part);
}

/* Steps one component with the held inputs; returns its worst status. */
static int step_held(const Loop *loop, const Stage *stage, const Part *part, double time, double size, bool final)
{
    int status = set_all(loop, stage, part, true);
    return status > FMI_WARNING ? status : worse(status, do_step(part, time, size, final));
}

/* Reads the outputs that belong to the inputs guessed for the end; the bus keeps the inputs that were held. */
static int read_at_end(const Loop *loop, const Stage *stage, const Part *part)
{
    int status = set_all(loop, stage, part, false);
    if (status <= FMI_WARNING) {
        status = worse(status, get_outputs(part));
    }
    for (int64_t i = 0; i < stage->inners; i++) {
        if (feeds(&stage->inner[i], part)) {
            *target(loop, &stage->inner[i]) = stage->inner[i].held;
        }
    }
    return leave(part, status);
}

static int judge(Loop *loop, int64_t part, int status)
{
    loop->warnings += status == FMI_WARNING;
    return status > FMI_WARNING ? fail(loop, part, status, loop->tick) : 0;
}

static int save_all(Loop *loop, const Stage *stage)
{
    for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
        if (judge(loop, i, save_state(enter(loop, i)))) {
            return 1;
        }
    }
    return 0;
}

static int restore_all(Loop *loop, const Stage *stage)
{
    for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
        if (judge(loop, i, restore_state(enter(loop, i)))) {
            return 1;
        }
    }
    return 0;
}

/* Steps every component once, each with the newest values of those before it. */
static int sweep(Loop *loop, Stage *stage, double time)
{
    for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
        const Part *part = enter(loop, i);
        for (int64_t j = 0; j < stage->inners; j++) {
            Inner *inner = &stage->inner[j];
            if (feeds(inner, part)) {
                inner->guess = inner->back ? inner->guess : carry(loop, &loop->wire[inner->wire]);
                inner->held = inner->from + stage->theta * (inner->guess - inner->from);
            }
        }
        int status = step_held(loop, stage, part, time, loop->step, false);
        status = status <= FMI_WARNING ? worse(status, read_at_end(loop, stage, part)) : leave(part, status);
        if (judge(loop, i, status)) {
            return 1;
        }
    }
    return 0;
}

/* Compares the wires that point back with what was guessed and improves the guesses; returns whether all agree. */
static bool agree(const Loop *loop, Stage *stage, int64_t round)
{
    bool agreed = true;
    double above = 0.0, below = 0.0;
    for (int64_t i = 0; i < stage->inners; i++) {
        Inner *inner = &stage->inner[i];
        if (!inner->back) {
            continue;
        }
        double value = carry(loop, &loop->wire[inner->wire]), residual = value - inner->guess;
        inner->scale = larger(inner->scale, fabs(value));
        if (fabs(residual) > stage->tolerance * inner->scale) {
            double change = (residual - inner->residual) / inner->scale;
            agreed = false;
            above += inner->residual / inner->scale * change;
            below += change * change;
        }
        inner->residual = residual;
    }
    if (round > 1 && below > 0.0 && above != 0.0) {
        stage->relaxation = -stage->relaxation * above / below;
    }
    for (int64_t i = 0; i < stage->inners && !agreed; i++) {
        if (stage->inner[i].back) {
            stage->inner[i].guess += stage->relaxation * stage->inner[i].residual;
        }
    }
    return agreed;
}

int iterate(Loop *loop, Stage *stage)
{
    double time = (double)loop->tick * loop->step;
    for (int64_t i = 0; i < stage->inners; i++) {
        stage->inner[i].from = stage->inner[i].guess = *target(loop, &stage->inner[i]);
    }
    if (save_all(loop, stage)) {
        return 1;
    }
    for (int64_t round = 1;; round++) {
        if (sweep(loop, stage, time)) {
            return 1;
        }
        stage->rounds++;
        stage->greatest = round > stage->greatest ? round : stage->greatest;
        if (agree(loop, stage, round)) {
            return 0;
        }
        if (round == stage->most) {
            return fail(loop, stage->part, NOT_AGREED, loop->tick);
        }
        if (restore_all(loop, stage)) {
            return 1;
        }
    }
}

/* Takes everybody over one piece of `size` seconds from `time`. */
static int piece(Loop *loop, Stage *stage, double time, double size)
{
    for (int64_t i = 0; i < stage->inners; i++) {
        stage->inner[i].held = stage->inner[i].from + stage->inner[i].slope * size / 2.0;
    }
    for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
        const Part *part = enter(loop, i);
        int status = step_held(loop, stage, part, time, size, true);
        status = status <= FMI_WARNING ? worse(status, get_outputs(part)) : status;
        if (judge(loop, i, leave(part, status))) {
            return 1;
        }
    }
    for (int64_t i = 0; i < stage->inners; i++) {
        stage->inner[i].guess = carry(loop, &loop->wire[stage->inner[i].wire]);
    }
    for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
        if (judge(loop, i, read_at_end(loop, stage, enter(loop, i)))) {
            return 1;
        }
    }
    return 0;
}

/* The energy lost on the bonds in a piece, in units of what is tolerated; notes how the wires change. */
static double account(const Loop *loop, Stage *stage, double size)
{
    double worst = 0.0;
    for (int64_t i = 0; i < stage->inners; i++) {
        stage->inner[i].guess = carry(loop, &loop->wire[stage->inner[i].wire]);
    }
    for (int64_t i = 0; i < stage->bonds; i++) {
        Bond *bond = &stage->bond[i];
        const Inner *one = &stage->inner[bond->one], *other = &stage->inner[bond->other];
        double first = (one->from + one->guess) / 2.0, second = (other->from + other->guess) / 2.0;
        double lost = fabs(other->held * first - one->held * second) * size;
        bond->scale = larger(bond->scale, fabs(one->guess * other->guess));
        if (bond->scale > 0.0) {
            worst = larger(worst, lost / (stage->tolerance * bond->scale * loop->step));
        }
    }
    for (int64_t i = 0; i < stage->inners; i++) {
        Inner *inner = &stage->inner[i];
        inner->slope = (inner->guess - inner->from) / size;
        inner->from = inner->guess;
    }
    return worst;
}

/* Growth of the piece size: 0.9 error^(-1/8) (error before / error)^(1/4), between 0.2 and 1.5. */
static double growth(double before, double error)
{
    if (error == 0.0) {
        return 1.5;
    }
    before = before > 0.0 ? before : error;
    double factor = 0.9 * sqrt(sqrt(sqrt(1.0 / error) * (before / error)));
    return factor > 1.5 ? 1.5 : factor >= 0.2 ? factor : 0.2;
}

/* The greatest power of two that is not above `size` and ends where a piece of that size may end. */
static int64_t fitting(double size, int64_t position, int64_t most)
{
    int64_t found = 1;
    while (2 * found <= most && (double)(2 * found) <= size && position % (2 * found) == 0) {
        found *= 2;
    }
    return found;
}

int balance(Loop *loop, Stage *stage)
{
    int64_t pieces = 0;
    for (int64_t i = 0; i < stage->inners; i++) {
        stage->inner[i].from = *target(loop, &stage->inner[i]);
    }
    for (int64_t position = 0; position < stage->most; pieces++) {
        int64_t units = fitting(stage->size, position, stage->most);
        double size = loop->step * ((double)units / (double)stage->most);
        double time = loop->step * ((double)loop->tick + (double)position / (double)stage->most);
        if (piece(loop, stage, time, size)) {
            return 1;
        }
        double error = account(loop, stage, size);
        stage->at_limit += units == 1 && error > 1.0;
        stage->size = larger(1.0, stage->size * growth(stage->error, error));
        stage->size = stage->size > (double)stage->most ? (double)stage->most : stage->size;
        stage->error = error;
        position += units;
    }
    stage->rounds += pieces;
    stage->greatest = pieces > stage->greatest ? pieces : stage->greatest;
    return 0;
}
