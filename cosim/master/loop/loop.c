/* The stepping loop. At tick k, t = k * step:
 *   1. the signals of the tick are put on the bus;
 *   2. outputs and signals are noted for the recording;
 *   3. the stages of the tick are taken: wires carry  y = quantise(gain * x + offset) + noise  to inputs, components step;
 *   4. the row is recorded: outputs at t_k and the inputs that act from t_k to t_(k+1).
 * A component that steps every n ticks takes its inputs at ticks 0, n, 2n, ... and is stepped at the end of the last
 * tick before the next of them, so nobody sees its outputs early. What the bus holds before tick 0 is written by
 * initialisation.py. interpreted.py does the same in Python, bit for bit.
 * Nothing is allocated here. */
#include "part.h"

enum { MOST_PLAIN = 64 }; /* columns for which there is room */

static bool begins(const Part *part, int64_t tick)
{
    return part->every == 1 || tick % part->every == 0;
}

static bool ends(const Part *part, int64_t tick)
{
    return part->every == 1 || (tick + 1) % part->every == 0;
}

static void gather(const Loop *loop, const Part *part)
{
    if (begins(part, loop->tick)) {
        for (int64_t i = part->wire; i < part->wire + part->wires; i++) {
            loop->bus[loop->wire[i].target] = carry(loop, &loop->wire[i]);
        }
    }
}

/* Takes one component over its step, as far as it falls into this tick; returns the worst status of its calls. */
static int advance(const Loop *loop, const Part *part)
{
    bool fed = begins(part, loop->tick), due = ends(part, loop->tick);
    if (!fed && !due) {
        return 0;
    }
    int status = fed ? set_inputs(part) : 0;
    if (status <= FMI_WARNING && due) {
        double time = (double)(loop->tick + 1 - part->every) * loop->step;
        status = worse(status, do_step(part, time, (double)part->every * loop->step, true));
        status = status <= FMI_WARNING ? worse(status, get_outputs(part)) : status;
    }
    return leave(part, status);
}

static int step_all(Loop *loop, const Stage *stage)
{
    for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
        const Part *part = enter(loop, i);
        int status = advance(loop, part);
        loop->warnings += status == FMI_WARNING;
        if (status > FMI_WARNING) {
            return fail(loop, i, status, loop->tick - loop->tick % part->every);
        }
    }
    return 0;
}

static int take(Loop *loop, Stage *stage)
{
    switch (stage->kind) {
    case GATHER:
        for (int64_t i = stage->part; i < stage->part + stage->parts; i++) {
            gather(loop, &loop->part[i]);
        }
        return 0;
    case STEP:
        return step_all(loop, stage);
    case ITERATE:
        return iterate(loop, stage);
    default:
        return balance(loop, stage);
    }
}

/* Writes the row begun at the last multiple of `decimation`; rows are stored column by column, `capacity` apart. */
static void emit(Loop *loop, double *row, int64_t capacity)
{
    for (int64_t i = 0; i < loop->columns; i++) {
        Column *column = &loop->column[i];
        row[i * capacity] = column->mean ? column->sum / (double)loop->halves : column->sample;
        column->sum = 0.0;
    }
    loop->halves = 0;
    loop->sampled = 0;
}

/* Adds half a tick to the means, which ends a row when its window is full; returns the number of rows ended. */
static int64_t add_half(Loop *loop, double *row, int64_t capacity)
{
    int64_t ended = loop->half == loop->edge;
    if (ended) {
        emit(loop, row, capacity);
        loop->edge += 2 * loop->decimation;
    }
    for (int64_t i = 0; i < loop->columns; i++) {
        if (loop->column[i].mean) {
            loop->column[i].sum += loop->column[i].value;
        }
    }
    loop->halves++;
    loop->half++;
    return ended;
}

static int64_t record(Loop *loop, double *row, int64_t capacity)
{
    if (loop->decimation == 1 || loop->tick % loop->decimation == 0) { /* a division costs as much as a wire */
        for (int64_t i = 0; i < loop->columns; i++) {
            loop->column[i].sample = loop->column[i].value;
        }
        loop->sampled = 1;
        if (loop->means == 0) {
            emit(loop, row, capacity);
            return 1;
        }
    }
    if (loop->means == 0) {
        return 0;
    }
    int64_t ended = add_half(loop, row, capacity);
    return ended + add_half(loop, row + ended, capacity);
}

static void note(Loop *loop, int64_t late)
{
    for (int64_t i = 0; i < loop->columns; i++) {
        if (loop->column[i].late == late) {
            loop->column[i].value = loop->bus[loop->column[i].source];
        }
    }
}

/* `note` where each tick is a row of samples: they go straight into it, which saves a third of the loop's own time. */
static void note_row(const Loop *loop, int64_t late, double *row, int64_t capacity)
{
    for (int64_t i = 0; i < loop->columns; i++) {
        if (loop->column[i].late == late) {
            row[i * capacity] = loop->bus[loop->column[i].source];
        }
    }
}

/* Whether all components take their inputs, and then all step, in each tick, and each tick is a row of samples. */
static bool is_plain(const Loop *loop)
{
    bool plain = loop->decimation == 1 && loop->means == 0 && loop->columns <= MOST_PLAIN && loop->stages == 2;
    for (int64_t i = 0; i < loop->stages && plain; i++) {
        const Stage *stage = &loop->stage[i];
        plain = stage->kind == (i ? STEP : GATHER) && stage->part == 0 && stage->parts == loop->parts;
    }
    for (int64_t i = 0; i < loop->parts && plain; i++) {
        plain = loop->part[i].every == 1;
    }
    return plain;
}

/* Where a column is from, and where its next sample goes. */
typedef struct {
    const double *from;
    double *to;
} Sample;

static void put(Sample *sample, int64_t samples)
{
    for (int64_t i = 0; i < samples; i++) {
        *sample[i].to++ = *sample[i].from;
    }
}

/* Lists the columns that are noted early, or late, in a tick; returns their number. */
static int64_t list(const Loop *loop, int64_t late, double *rows, int64_t capacity, Sample *sample)
{
    int64_t count = 0;
    for (int64_t i = 0; i < loop->columns; i++) {
        if (loop->column[i].late == late) {
            sample[count++] = (Sample){&loop->bus[loop->column[i].source], rows + i * capacity};
        }
    }
    return count;
}

/* One step of one component that is as long as a tick; its status. */
static int step_one(const Part *part, double time, double size)
{
    int status = set_inputs(part);
    if (status <= FMI_WARNING) {
        status = worse(status, do_step(part, time, size, true));
        status = status <= FMI_WARNING ? worse(status, get_outputs(part)) : status;
    }
    return leave(part, status);
}

/* Ticks of a loop that `is_plain`: what loop_run does, with nothing asked in a tick that is the same in all. */
static int64_t run_plain(Loop *loop, int64_t ticks, const double *signals, double *rows, int64_t capacity)
{
    Sample early[MOST_PLAIN], late[MOST_PLAIN];
    int64_t earlies = list(loop, 0, rows, capacity, early), lates = list(loop, 1, rows, capacity, late);
    int64_t parts = loop->parts, wires = loop->wires, given = loop->signals, failed = 0, k = 0;
    double *bus = loop->bus, step = loop->step;
    for (; k < ticks && !failed; k++) {
        for (int64_t i = 0; i < given; i++) {
            loop->signal[i] = signals[i * ticks + k];
        }
        put(early, earlies);
        for (int64_t i = 0; i < wires; i++) {
            bus[loop->wire[i].target] = carry(loop, &loop->wire[i]);
        }
        double time = (double)loop->tick * step;
        for (int64_t i = 0; i < parts && !failed; i++) {
            int status = step_one(enter(loop, i), time, step);
            loop->warnings += status == FMI_WARNING;
            failed = status > FMI_WARNING ? fail(loop, i, status, loop->tick) : 0;
        }
        put(late, lates);
        loop->tick += !failed;
    }
    return k;
}

/* Tells how its data is laid out, so that a library of another version is not trusted. */
EXPORT int64_t loop_layout(void)
{
    return (int64_t)(sizeof(Loop) + 3 * sizeof(Part) + 5 * sizeof(Wire) + 7 * sizeof(Stage) + 11 * sizeof(Column) +
                     13 * sizeof(Inner) + 17 * sizeof(Bond) + 19 * sizeof(Fault));
}

/* Runs `ticks` ticks. `signals` holds one column of `ticks` values for each signal, `rows` one of `capacity` for each
 * recorded column. Returns the number of rows written; `failed` and `status` tell whether it got to the end. */
EXPORT int64_t loop_run(Loop *loop, int64_t ticks, const double *signals, double *rows, int64_t capacity)
{
    Environment before = begin_standard();
    if (is_plain(loop)) {
        int64_t done = run_plain(loop, ticks, signals, rows, capacity);
        end_standard(before);
        return done;
    }
    bool direct = loop->decimation == 1 && loop->means == 0;
    int64_t written = 0;
    for (int64_t k = 0; k < ticks; k++) {
        for (int64_t i = 0; i < loop->signals; i++) {
            loop->signal[i] = signals[i * ticks + k];
        }
        int failed = 0;
        if (direct) {
            note_row(loop, 0, rows + written, capacity);
        } else {
            note(loop, 0);
        }
        for (int64_t i = 0; i < loop->stages && !failed; i++) {
            failed = take(loop, &loop->stage[i]);
        }
        if (direct) {
            note_row(loop, 1, rows + written++, capacity);
        } else {
            note(loop, 1);
            written += record(loop, rows + written, capacity);
        }
        if (failed) {
            break;
        }
        loop->tick++;
    }
    end_standard(before);
    return written;
}

/* After the last tick: the row at stop, where one falls due. Wires are carried once more, and nothing steps, so a mean
 * is that of the half window before. `loop_flush` writes it. */
EXPORT void loop_finish(Loop *loop, const double *signals)
{
    if (loop->tick % loop->decimation) {
        return;
    }
    Environment before = begin_standard();
    for (int64_t i = 0; i < loop->signals; i++) {
        loop->signal[i] = signals[i];
    }
    note(loop, 0);
    for (int64_t i = 0; i < loop->parts; i++) {
        gather(loop, &loop->part[i]);
    }
    note(loop, 1);
    for (int64_t i = 0; i < loop->columns; i++) {
        loop->column[i].sample = loop->column[i].value;
    }
    loop->sampled = 1;
    end_standard(before);
}

/* Ends a row whose window was cut short by the end of the run; its means are those of what there was. */
EXPORT int64_t loop_flush(Loop *loop, double *rows, int64_t capacity)
{
    if (!loop->sampled) {
        return 0;
    }
    Environment before = begin_standard();
    emit(loop, rows, capacity);
    end_standard(before);
    return 1;
}
