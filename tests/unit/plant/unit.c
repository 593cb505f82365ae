/* A carriage for both versions of FMI: dv/dt = (gain * drive + b - v) / 10 ms, dx/dt = v. It fails
   beyond "wall". */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if FMI == 2
#include "fmi2Functions.h"
#else
#include "fmi3Functions.h"
#endif

typedef struct {
    double drive, x, gain, wall, v, b;
} Unit;

static int advance(Unit *unit, double step) {
    for (int n = 0; n < 16; n++) {
        unit->v += (unit->gain * unit->drive + unit->b - unit->v) * step / 16 / 0.01;
        unit->x += unit->v * step / 16;
    }
    return unit->x > unit->wall;
}
static Unit *made(void) {
    Unit *unit = calloc(1, sizeof(Unit));
    unit->gain = 1.0;
    unit->wall = 1e9;
    return unit;
}

#if FMI == 2
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
                              const fmi2CallbackFunctions *calls, fmi2Boolean a, fmi2Boolean b) {
    return made();
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d,
                               fmi2Boolean e, fmi2Real f) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference *at, size_t n, fmi2Real *out) {
    for (size_t i = 0; i < n; i++) out[i] = ((double *)c)[at[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference *at, size_t n,
                       const fmi2Real *in) {
    for (size_t i = 0; i < n; i++) ((double *)c)[at[i]] = in[i];
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean a) {
    return advance(c, step) ? fmi2Error : fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    *s = memcpy(malloc(sizeof(Unit)), c, sizeof(Unit));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) {
    memcpy(c, s, sizeof(Unit));
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s); *s = 0; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) {
    *n = sizeof(Unit);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) {
    memcpy(b, s, n);
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n,
                                   fmi2FMUstate *s) {
    *s = memcpy(malloc(n), b, n);
    return fmi2OK;
}
#else
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference needed[], size_t n,
    fmi3InstanceEnvironment env, fmi3LogMessageCallback say, fmi3IntermediateUpdateCallback up) {
    return made();
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d,
                                       fmi3Boolean e, fmi3Float64 f) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference *at, size_t n, fmi3Float64 *out,
                          size_t m) {
    for (size_t i = 0; i < n; i++) out[i] = ((double *)c)[at[i]];
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference *at, size_t n,
                          const fmi3Float64 *in, size_t m) {
    for (size_t i = 0; i < n; i++) ((double *)c)[at[i]] = in[i];
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 now, fmi3Float64 step, fmi3Boolean a,
                      fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Float64 *last) {
    *last = now + step;
    return advance(c, step) ? fmi3Error : fmi3OK;
}
#endif
