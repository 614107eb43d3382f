/* FMI 3.0 around the functions of one vehicle. MODEL(name) is its prefix; DELAYED says that only whole steps are taken.
 *
 * Value references: 0 is time, then the states that are shown, then (without a delay) their rates, then the inputs. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef void (*Log)(void *environment, Status status, const char *category, const char *message);

typedef struct {
    double t, s[STEP_STATES], u[INPUTS];
    bool ready, whole;
    void *environment;
    Log log;
} Vehicle;

static Status refuse(Vehicle *v, const char *words)
{
    if (v->log) v->log(v->environment, ERROR, "error", words);
    return ERROR;
}

static void settle(Vehicle *v)
{
    if (!v->ready) MODEL(settle_step)(v->u, v->s);
}

static Vehicle *make(const char *token, bool logging, void *environment, Log log)
{
    Vehicle *v = strcmp(token, TOKEN) ? NULL : calloc(1, sizeof *v);
    if (!v) return NULL;
    memcpy(v->s, START, sizeof START);
    memcpy(v->u, START_INPUTS, sizeof v->u);
    v->environment = environment;
    v->log = logging ? log : NULL;
    return v;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT Status fmi3SetDebugLogging(void *i, bool on, size_t n, const char *const *categories)
{
    (void)i, (void)on, (void)n, (void)categories;
    return OK;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const uint32_t *required, size_t n,
                                         void *environment, Log log, void *update)
{
    (void)name, (void)resources, (void)visible, (void)events, (void)early, (void)required, (void)n, (void)update;
    Vehicle *v = make(token, logging, environment, log);
    if (v) v->whole = true;
    return v;
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Log log)
{
    (void)name, (void)resources, (void)visible;
    return DELAYED ? NULL : make(token, logging, environment, log);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Log log, void *a, void *b, void *c)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)a, (void)b, (void)c;
    return NULL;
}

EXPORT void fmi3FreeInstance(void *i) { free(i); }

EXPORT Status fmi3EnterInitializationMode(void *i, bool tolerance, double value, double start, bool stop, double end)
{
    (void)tolerance, (void)value, (void)stop, (void)end;
    ((Vehicle *)i)->t = start;
    return OK;
}

EXPORT Status fmi3ExitInitializationMode(void *i)
{
    settle(i);
    ((Vehicle *)i)->ready = true;
    return OK;
}

EXPORT Status fmi3Reset(void *i)
{
    Vehicle *v = i;
    memset(v->s, 0, sizeof v->s);
    memcpy(v->s, START, sizeof START);
    memcpy(v->u, START_INPUTS, sizeof v->u);
    v->t = 0.0;
    v->ready = false;
    return OK;
}

EXPORT Status fmi3GetFloat64(void *i, const uint32_t *refs, size_t n, double *values, size_t count)
{
    Vehicle *v = i;
    double rate[STATES];
    bool known = false;
    if (n != count) return refuse(v, "as many values as references are needed");
    settle(v);
    for (size_t k = 0; k < n; k++) {
        const uint32_t r = refs[k];
        if (r == 0) {
            values[k] = v->t;
        } else if (r <= SHOWN) {
            values[k] = v->s[r - 1];
        } else if (r < FIRST_INPUT) {
            if (!known) MODEL(rate)(v->t, v->s, v->u, rate);
            known = true;
            values[k] = rate[r - 1 - SHOWN];
        } else if (r < FIRST_INPUT + INPUTS) {
            values[k] = v->u[r - FIRST_INPUT];
        } else {
            return refuse(v, "there is no such value reference");
        }
    }
    return OK;
}

EXPORT Status fmi3SetFloat64(void *i, const uint32_t *refs, size_t n, const double *values, size_t count)
{
    Vehicle *v = i;
    if (n != count) return refuse(v, "as many values as references are needed");
    for (size_t k = 0; k < n; k++) {
        const uint32_t r = refs[k];
        if (!isfinite(values[k])) return refuse(v, "a value is not finite");
        if (r >= FIRST_INPUT && r < FIRST_INPUT + INPUTS)
            v->u[r - FIRST_INPUT] = values[k];
        else if (r >= 1 && r <= MOVABLE && !v->ready)
            v->s[r - 1] = values[k];
        else
            return refuse(v, "this variable cannot be set now");
    }
    return OK;
}

EXPORT Status fmi3DoStep(void *i, double t, double h, bool keep, bool *events, bool *terminate, bool *early, double *last)
{
    Vehicle *v = i;
    (void)keep;
    *events = *terminate = *early = false;
    *last = v->t;
    if (!v->whole || !(h > 0.0)) return refuse(v, "a positive step of co-simulation is needed");
    const double steps = DELAYED ? floor(h / STEP + 0.5) : ceil(h / STEP - 1e-9);
    if (steps < 1.0 || (DELAYED && fabs(h - steps * STEP) > 1e-6 * STEP))
        return refuse(v, "with an actuation delay communication steps are whole multiples of the internal step");
    for (double k = 0.0; k < steps; k++)
        if (MODEL(step)(t + k * (h / steps), DELAYED ? STEP : h / steps, v->s, v->u, v->s)) return refuse(v, "step refused");
    for (int k = 0; k < SHOWN; k++)
        if (!isfinite(v->s[k])) return refuse(v, "the state is not finite any more");
    *last = v->t = t + h;
    return OK;
}

/* Model exchange. */
EXPORT Status fmi3SetTime(void *i, double t) { return ((Vehicle *)i)->t = t, OK; }
EXPORT Status fmi3EnterContinuousTimeMode(void *i) { return (void)i, OK; }
EXPORT Status fmi3EnterEventMode(void *i) { return (void)i, OK; }
EXPORT Status fmi3EnterStepMode(void *i) { return (void)i, OK; }
EXPORT Status fmi3Terminate(void *i) { return (void)i, OK; }
EXPORT Status fmi3EnterConfigurationMode(void *i) { return (void)i, OK; }
EXPORT Status fmi3ExitConfigurationMode(void *i) { return (void)i, OK; }
EXPORT Status fmi3EvaluateDiscreteStates(void *i) { return (void)i, OK; }

EXPORT Status fmi3CompletedIntegratorStep(void *i, bool keep, bool *event, bool *terminate)
{
    (void)i, (void)keep;
    *event = *terminate = false;
    return OK;
}

EXPORT Status fmi3SetContinuousStates(void *i, const double *x, size_t n)
{
    if (n != SHOWN) return refuse(i, "wrong number of states");
    return memcpy(((Vehicle *)i)->s, x, n * sizeof *x), OK;
}

EXPORT Status fmi3GetContinuousStates(void *i, double *x, size_t n)
{
    if (n != SHOWN) return refuse(i, "wrong number of states");
    settle(i);
    return memcpy(x, ((Vehicle *)i)->s, n * sizeof *x), OK;
}

EXPORT Status fmi3GetContinuousStateDerivatives(void *i, double *rate, size_t n)
{
    Vehicle *v = i;
    if (DELAYED || n != SHOWN) return refuse(v, "wrong number of states");
    settle(v);
    return MODEL(rate)(v->t, v->s, v->u, rate), OK;
}

EXPORT Status fmi3GetNominalsOfContinuousStates(void *i, double *nominals, size_t n)
{
    (void)i;
    for (size_t k = 0; k < n; k++) nominals[k] = 1.0;
    return OK;
}

EXPORT Status fmi3GetNumberOfContinuousStates(void *i, size_t *n) { return (void)i, *n = DELAYED ? 0 : SHOWN, OK; }
EXPORT Status fmi3GetNumberOfEventIndicators(void *i, size_t *n) { return (void)i, *n = 0, OK; }
EXPORT Status fmi3GetEventIndicators(void *i, double *z, size_t n) { return (void)i, (void)z, n ? ERROR : OK; }

EXPORT Status fmi3UpdateDiscreteStates(void *i, bool *update, bool *terminate, bool *nominals, bool *values, bool *defined,
                                       double *next)
{
    (void)i;
    *update = *terminate = *nominals = *values = *defined = false;
    *next = 0.0;
    return OK;
}

/* The whole state of an instance, to go back to. */
EXPORT Status fmi3GetFMUState(void *i, void **state)
{
    if (!*state) *state = malloc(sizeof(Vehicle));
    if (!*state) return refuse(i, "no memory");
    return memcpy(*state, i, sizeof(Vehicle)), OK;
}

EXPORT Status fmi3SetFMUState(void *i, void *state)
{
    Vehicle *v = i, kept = *v;
    memcpy(v, state, sizeof *v);
    v->environment = kept.environment;
    v->log = kept.log;
    return OK;
}

EXPORT Status fmi3FreeFMUState(void *i, void **state)
{
    (void)i;
    free(*state);
    *state = NULL;
    return OK;
}

/* What this FMU has no use for. */
#define NONE(name, ...) \
    EXPORT Status name(void *i, __VA_ARGS__) { return refuse(i, #name " is not supported"); }
#define UNUSED_GET(kind, type) NONE(fmi3Get##kind, const uint32_t *a, size_t b, type *c, size_t d)
#define UNUSED_SET(kind, type) NONE(fmi3Set##kind, const uint32_t *a, size_t b, const type *c, size_t d)
#define UNUSED(kind, type) UNUSED_GET(kind, type) UNUSED_SET(kind, type)
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
UNUSED(Float32, float)
UNUSED(Int8, int8_t)
UNUSED(UInt8, uint8_t)
UNUSED(Int16, int16_t)
UNUSED(UInt16, uint16_t)
UNUSED(Int32, int32_t)
UNUSED(UInt32, uint32_t)
UNUSED(Int64, int64_t)
UNUSED(UInt64, uint64_t)
UNUSED(Boolean, bool)
UNUSED(String, char *)
NONE(fmi3GetBinary, const uint32_t *a, size_t b, size_t *c, const uint8_t **d, size_t e)
NONE(fmi3SetBinary, const uint32_t *a, size_t b, const size_t *c, const uint8_t *const *d, size_t e)
NONE(fmi3GetClock, const uint32_t *a, size_t b, bool *c)
NONE(fmi3SetClock, const uint32_t *a, size_t b, const bool *c)
NONE(fmi3GetNumberOfVariableDependencies, uint32_t a, size_t *b)
NONE(fmi3GetVariableDependencies, uint32_t a, size_t *b, uint32_t *c, size_t *d, int *e, size_t f)
NONE(fmi3SerializedFMUStateSize, void *a, size_t *b)
NONE(fmi3SerializeFMUState, void *a, uint8_t *b, size_t c)
NONE(fmi3DeserializeFMUState, const uint8_t *a, size_t b, void **c)
NONE(fmi3GetDirectionalDerivative, const uint32_t *a, size_t b, const uint32_t *c, size_t d, const double *e, size_t f,
     double *g, size_t h)
NONE(fmi3GetAdjointDerivative, const uint32_t *a, size_t b, const uint32_t *c, size_t d, const double *e, size_t f,
     double *g, size_t h)
NONE(fmi3GetIntervalDecimal, const uint32_t *a, size_t b, double *c, int *d)
NONE(fmi3GetIntervalFraction, const uint32_t *a, size_t b, uint64_t *c, uint64_t *d, int *e)
NONE(fmi3GetShiftDecimal, const uint32_t *a, size_t b, double *c)
NONE(fmi3GetShiftFraction, const uint32_t *a, size_t b, uint64_t *c, uint64_t *d)
NONE(fmi3SetIntervalDecimal, const uint32_t *a, size_t b, const double *c)
NONE(fmi3SetIntervalFraction, const uint32_t *a, size_t b, const uint64_t *c, const uint64_t *d)
NONE(fmi3SetShiftDecimal, const uint32_t *a, size_t b, const double *c)
NONE(fmi3SetShiftFraction, const uint32_t *a, size_t b, const uint64_t *c, const uint64_t *d)
NONE(fmi3GetOutputDerivatives, const uint32_t *a, size_t b, const int32_t *c, double *d, size_t e)
NONE(fmi3ActivateModelPartition, uint32_t a, double b)
