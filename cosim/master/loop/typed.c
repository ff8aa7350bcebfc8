/* An FMU whose variables are of any type, behind the functions that the loop calls with doubles.
 *
 * The bus carries numbers as doubles, and texts, binaries and integers of 64 bits that must stay exact as numbers of a
 * pool (pool.h). A part's values stand on the bus with its plain reals first, which go to the FMU as they are; then come
 * the variables of other types and arrays, each with its values side by side. Nothing is rounded unless a wire asks for
 * it (`cast`): a value that its variable cannot hold is NOT_EXACT, and `culprit` and `wrong` tell which.
 * For a model-exchange FMU the inner functions are those of exchange.c, which must be called before others are set. */
#include "part.h"
#include "pool.h"

#include <math.h>
#include <string.h>

enum { F64, F32, I8, U8, I16, U16, I32, U32, I64, U64, TRUTH2, TRUTH3, TEXT, BYTES, EXACT };
enum { NOT_EXACT = 103, POOL_FULL = 104 };

typedef int Set2(void *, const uint32_t *, size_t, const void *);
typedef int Set3(void *, const uint32_t *, size_t, const void *, size_t);
typedef int SetBytes(void *, const uint32_t *, size_t, const size_t *, const void *, size_t);
typedef int Get2(void *, const uint32_t *, size_t, void *);
typedef int Get3(void *, const uint32_t *, size_t, void *, size_t);
typedef int GetBytes(void *, const uint32_t *, size_t, size_t *, void *, size_t);

typedef struct {
    int64_t kind, reference, size; /* type, value reference, elements of the FMU's variable */
    int64_t first, count;          /* its values among those of the part: where they begin, how many */
    const int64_t *element;        /* the element that each of them is */
    const int64_t *cast;           /* of each: whether it may be rounded */
    void (*access)(void);          /* FMI's set or get of the type */
    void *content;                 /* `size` elements as the FMU has them */
    size_t *length;                /* of binaries */
    const double *item;            /* values that an enumeration has */
    int64_t items;
    void (*read)(void); /* FMI's get of the type: an input that is fed in part keeps its other elements */
} Variable;

typedef struct {
    int64_t version; /* of FMI */
    void *instance;
    int64_t inner_version; /* of the inner functions, which take reals */
    void *inner;
    void (*set)(void), (*get)(void), (*step)(void);
    int (*save)(void *, void **), (*restore)(void *, void *);
    const uint32_t *plain_input, *plain_output; /* value references of plain reals */
    int64_t plain_inputs, plain_outputs, inputs, outputs;
    Variable *input, *output;
    Pool *pool;
    int64_t begun, culprit; /* culprit: place among the values of the part, inputs from 0, outputs from -1 downwards */
    double wrong, start; /* `start`: of the run, added to the loop's time */
    int64_t *altered;    /* what calls of the FMU changed that they must not, see foreign.h */
} Typed;

static const double LEAST[] = {[I8] = -128, [I16] = -32768, [I32] = -2147483648.0, [I64] = -9223372036854775808.0,
                               [U64] = 0};
/* The first value beyond the range; of 64 bits so that the conversion is defined. */
static const double BEYOND[] = {[I8] = 128, [U8] = 256, [I16] = 32768, [U16] = 65536, [I32] = 2147483648.0,
                                [U32] = 4294967296.0, [I64] = 9223372036854775808.0, [U64] = 18446744073709551616.0};
#define MOST_EXACT 9007199254740992.0 /* 2^53: up to here every integer is a double */

static bool is_item(const Variable *v, double value)
{
    for (int64_t i = 0; i < v->items; i++) {
        if (v->item[i] == value) {
            return true;
        }
    }
    return v->items == 0;
}

/* Writes one element; returns false where the type does not hold the value. */
static bool write(const Typed *t, const Variable *v, int64_t i, double value)
{
    int64_t e = v->element[i], kind = v->kind;
    if (kind == TEXT || kind == BYTES || kind == EXACT) {
        size_t size;
        const void *content = pool_content(t->pool, (int64_t)value, &size);
        if (kind == EXACT) {
            memcpy((int64_t *)v->content + e, content, size < 8 ? 0 : 8);
            return size == 8;
        }
        ((const void **)v->content)[e] = content;
        if (kind == BYTES) {
            v->length[e] = size;
        }
        return true;
    }
    if (kind == F64) {
        ((double *)v->content)[e] = value;
        return true;
    }
    if (kind == F32) {
        ((float *)v->content)[e] = (float)value;
        return v->cast[i] ? isfinite((float)value) || !isfinite(value) : (double)(float)value == value;
    }
    value = v->cast[i] ? round(value) : value;
    if (kind == TRUTH2 || kind == TRUTH3) {
        if (kind == TRUTH2) {
            ((int32_t *)v->content)[e] = value != 0;
        } else {
            ((bool *)v->content)[e] = value != 0;
        }
        return value == 0 || value == 1;
    }
    if (!(value >= LEAST[kind] && value < BEYOND[kind] && value == floor(value) && is_item(v, value))) {
        return false;
    }
    switch (kind) {
    case I8: case U8:
        ((uint8_t *)v->content)[e] = (uint8_t)(int64_t)value;
        return true;
    case I16: case U16:
        ((uint16_t *)v->content)[e] = (uint16_t)(int64_t)value;
        return true;
    case I32: case U32:
        ((uint32_t *)v->content)[e] = (uint32_t)(int64_t)value;
        return true;
    case I64:
        ((int64_t *)v->content)[e] = (int64_t)value;
        return true;
    default:
        ((uint64_t *)v->content)[e] = (uint64_t)value;
        return true;
    }
}

static double read(const Typed *t, const Variable *v, int64_t i)
{
    int64_t e = v->element[i];
    const char *text;
    switch (v->kind) {
    case F64: return ((const double *)v->content)[e];
    case F32: return ((const float *)v->content)[e];
    case I8: return ((const int8_t *)v->content)[e];
    case U8: return ((const uint8_t *)v->content)[e];
    case I16: return ((const int16_t *)v->content)[e];
    case U16: return ((const uint16_t *)v->content)[e];
    case I32: return ((const int32_t *)v->content)[e];
    case U32: return ((const uint32_t *)v->content)[e];
    case I64: return (double)((const int64_t *)v->content)[e];
    case U64: return (double)((const uint64_t *)v->content)[e];
    case TRUTH2: return ((const int32_t *)v->content)[e] != 0;
    case TRUTH3: return ((const bool *)v->content)[e];
    case EXACT: return (double)pool_put(t->pool, (const int64_t *)v->content + e, 8);
    case TEXT:
        text = ((const char *const *)v->content)[e];
        return (double)pool_put(t->pool, text ? text : "", text ? strlen(text) : 0);
    default:
        text = ((const char *const *)v->content)[e];
        return (double)pool_put(t->pool, text ? text : "", text ? v->length[e] : 0);
    }
}

static int call_set(const Typed *t, const Variable *v)
{
    uint32_t reference = (uint32_t)v->reference;
    if (v->kind == BYTES) {
        return after(t->altered, ((SetBytes *)v->access)(t->instance, &reference, 1, v->length, v->content,
                                                         (size_t)v->size));
    }
    if (t->version == 2) {
        return after(t->altered, ((Set2 *)v->access)(t->instance, &reference, 1, v->content));
    }
    return after(t->altered, ((Set3 *)v->access)(t->instance, &reference, 1, v->content, (size_t)v->size));
}

static int call_get(const Typed *t, const Variable *v, void (*access)(void))
{
    uint32_t reference = (uint32_t)v->reference;
    if (v->kind == BYTES) {
        return after(t->altered, ((GetBytes *)access)(t->instance, &reference, 1, v->length, v->content,
                                                      (size_t)v->size));
    }
    if (t->version == 2) {
        return after(t->altered, ((Get2 *)access)(t->instance, &reference, 1, v->content));
    }
    return after(t->altered, ((Get3 *)access)(t->instance, &reference, 1, v->content, (size_t)v->size));
}

/* Arrays that are fed in part begin with what the FMU has in their other elements. */
static int begin(Typed *t)
{
    int status = 0;
    for (int64_t i = 0; i < t->inputs && status <= FMI_WARNING; i++) {
        if (t->input[i].count < t->input[i].size) {
            status = worse(status, call_get(t, &t->input[i], t->input[i].read));
        }
    }
    t->begun = 1;
    return status;
}

EXPORT int typed_set(Typed *t, const uint32_t *references, size_t count, const double *values)
{
    (void)references;
    (void)count;
    int status = t->begun ? 0 : begin(t);
    if (status <= FMI_WARNING) {
        Part inner = {.version = t->inner_version, .instance = t->inner, .set = t->set, .inputs = t->plain_inputs,
                      .input_references = t->plain_input, .input = (double *)values};
        bool must = t->inner != t->instance; /* exchange.c goes to event mode before anything is set */
        int set = must && t->plain_inputs == 0 ? ((Set2 *)t->set)(t->inner, t->plain_input, 0, values)
                                               : set_inputs(&inner);
        status = worse(status, after(t->altered, set)); /* numbers are converted below */
    }
    for (int64_t i = 0; i < t->inputs && status <= FMI_WARNING; i++) {
        const Variable *v = &t->input[i];
        for (int64_t j = 0; j < v->count; j++) {
            if (!write(t, v, j, values[v->first + j])) {
                t->culprit = v->first + j;
                t->wrong = values[v->first + j];
                return NOT_EXACT;
            }
        }
        status = worse(status, call_set(t, v));
    }
    return status;
}

EXPORT int typed_get(Typed *t, const uint32_t *references, size_t count, double *values)
{
    (void)references;
    (void)count;
    Part inner = {.version = t->inner_version, .instance = t->inner, .get = t->get, .outputs = t->plain_outputs,
                  .output_references = t->plain_output, .output = values};
    int status = after(t->altered, get_outputs(&inner));
    for (int64_t i = 0; i < t->outputs && status <= FMI_WARNING; i++) {
        const Variable *v = &t->output[i];
        status = worse(status, call_get(t, v, v->access));
        for (int64_t j = 0; j < v->count && status <= FMI_WARNING; j++) {
            double value = read(t, v, j);
            bool wide = (v->kind == I64 || v->kind == U64) && fabs(value) >= MOST_EXACT;
            bool full = (v->kind == TEXT || v->kind == BYTES || v->kind == EXACT) && value < 0;
            values[v->first + j] = value;
            if (wide || full) {
                t->culprit = -1 - (v->first + j);
                t->wrong = value;
                return wide ? NOT_EXACT : POOL_FULL;
            }
        }
    }
    return status;
}

EXPORT int typed_step(Typed *t, double time, double size, int final)
{
    Part inner = {.version = t->inner_version, .instance = t->inner, .step = t->step};
    return do_step(&inner, t->start + time, size, final);
}

EXPORT int typed_save(Typed *t, void **state) { return t->save(t->inner, state); }

EXPORT int typed_restore(Typed *t, void *state) { return t->restore(t->inner, state); }

EXPORT int64_t typed_layout(void) { return (int64_t)(sizeof(Typed) + 3 * sizeof(Variable)); }
