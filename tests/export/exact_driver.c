/* Drives one FMU through a fixed scenario and prints a hash of the bits of everything it answers (tests/export/test_platforms.py).
 *
 * The inputs are triangle waves of different periods, exact in double precision. scenario.h, written by the test, says
 * SIZE, COUNT, LENGTH [s] and AMPLITUDES: variables, steps, length of a step, one amplitude an input.
 */
#include "fmi3Functions.h"
#include "model.h"
#include "scenario.h"

#include <stdint.h>
#include <stdio.h>

static const double amplitudes[] = {AMPLITUDES}, step = LENGTH;

static double triangle(long i, long period) {
    long phase = i % period;
    return (double)(phase < period / 2 ? 4 * phase - period : 3 * period - 4 * phase) / (double)period;
}

static uint64_t hash = 14695981039346656037u;

static void add(const double *values, size_t count) {
    const unsigned char *bytes = (const unsigned char *)values;
    for (size_t i = 0; i < count * sizeof *values; i++) hash = (hash ^ bytes[i]) * 1099511628211u;
}

static int advance(fmi3Instance c, long i) {
    static uint32_t references[SIZE];
    static double values[SIZE];
    fmi3Boolean event, end, early;
    fmi3Float64 last;
    for (int k = 0; k < SIZE; k++) references[k] = (uint32_t)k;
    for (int k = 0; k < model.inputs; k++) values[k] = amplitudes[k] * triangle(i, 5000 + 1402 * k);
    if (fmi3SetFloat64(c, references + 1, (size_t)model.inputs, values, (size_t)model.inputs)) return 1;
    if (fmi3DoStep(c, (double)i * step, step, fmi3True, &event, &end, &early, &last)) return 1;
    if (fmi3GetFloat64(c, references, SIZE, values, SIZE)) return 1;
    add(values, SIZE);
    return 0;
}

static int drive(char *text, size_t size) {
    fmi3Instance c = fmi3InstantiateCoSimulation("it", model.token, "", fmi3False, fmi3False, fmi3False, fmi3False, NULL,
                                                 0, NULL, NULL, NULL);
    if (!c || fmi3EnterInitializationMode(c, fmi3False, 0, 0, fmi3False, 0) || fmi3ExitInitializationMode(c)) return 1;
    for (long i = 0; i < COUNT; i++)
        if (advance(c, i)) return 2;
    return snprintf(text, size, "%08x%08x\n", (unsigned)(hash >> 32), (unsigned)hash) < 0;
}

#ifdef _WIN32
__declspec(dllimport) void *GetStdHandle(unsigned long which);
__declspec(dllimport) int WriteFile(void *file, const void *bytes, unsigned long size, unsigned long *written, void *o);
__declspec(dllimport) void ExitProcess(unsigned code);

void mainCRTStartup(void) {
    char text[32];
    unsigned long written;
    int code = drive(text, sizeof text);
    if (code == 0) WriteFile(GetStdHandle((unsigned long)-11), text, 17, &written, NULL);
    ExitProcess((unsigned)code);
}
#else
int main(void) {
    char text[32];
    int code = drive(text, sizeof text);
    if (code == 0) fputs(text, stdout);
    return code;
}
#endif
