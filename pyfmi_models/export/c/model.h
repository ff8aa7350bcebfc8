/* What the generator writes about one model (model.c) and the generic shim reads. Constant: shared by all instances. */
#ifndef MODEL_H
#define MODEL_H

/* A value reference is the row in `table`: time, inputs, parameters, states, rates of continuous states, outputs. */
typedef enum { TIME, INPUT, PARAMETER, STATE, RATE, OUTPUT } Kind;

typedef struct {
    const char *name;
    Kind kind;
    double start, low, high;
    int fixed; /* a parameter that keeps its value from the end of initialization on */
    int same; /* the value reference of the input or state that an output shows as it is, else its own */
} Variable;

/* A generated function: columns of numbers in, columns of numbers out. */
typedef void Code(const double *const in[], double *const out[]);

typedef struct {
    const char *token;
    double period;    /* s; 0: continuous */
    double tolerance; /* relative, when the master gives none */
    int size, inputs, parameters, states, rates, outputs;
    int most_steps; /* solver steps, or ticks, that one call may take: about a second of work */
    const Variable *table;
    const double *nominals;
    /* of a continuous model */
    Code *rates_code;       /* t, x, u, p -> dx/dt */
    Code *outputs_code;     /* t, x, u, p -> y */
    Code *step_code;        /* t, x, u, p, h -> x at t + h, error of each, sum of their squares, reciprocals of the pivots */
    Code *directional_code; /* t, x, u, p, dt, dx, du, dp -> d rates, d outputs */
    Code *adjoint_code;     /* t, x, u, p, d rates, d outputs -> (dt, dx, du, dp) */
    /* of a sampled model */
    Code *tick_code; /* t, x, u, p -> next states, y */
} Model;

extern const Model model;

#endif
