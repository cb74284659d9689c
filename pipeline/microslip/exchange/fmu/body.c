/* A reduced elastic body as a functional mock-up unit (FMI 2.0, model exchange and co-simulation), in its modes:

       q'' + C q' + K q = sum of LOAD f,   what is read: READ q and READ q'

   with M = 1, K and C of the table numbers.h entry by entry (PAIR), gyroscopic and circulatory parts included, and
   2 (D - DAMPING_RATIO) OMEGA added to the diagonal of C where damping ratios D are changed. In co-simulation f is
   constant over a step, or linear where the master gives its rate, and the step is the exact solution to rounding.
   Compile this file alone; fmi2Functions.h before it gives prefixed names for static linking. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "numbers.h"

#ifndef fmi2Functions_h /* the types and values of the standard that are needed here */
#ifdef _WIN32
#define FMI2_Export __declspec(dllexport)
#else
#define FMI2_Export __attribute__((visibility("default")))
#endif
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(void *, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged, nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#endif

typedef struct {
    double time, x[2 * MODES], damping[MODES], f[INPUTS], rate[INPUTS]; /* x: q, then q' */
} State;

typedef struct {
    State s;
    fmi2CallbackFunctions call;
    char name[64];
} Body;

/* value references: q, q', q'', damping ratios, forces, what is read, its rate */
enum { Q = 0, V = MODES, A = 2 * MODES, D = 3 * MODES, F = 4 * MODES };
enum { U = F + INPUTS, W = U + OUTPUTS, END = W + OUTPUTS };

static fmi2Status refuse(Body *b, const char *why)
{
    if (b->call.logger)
        b->call.logger(b->call.componentEnvironment, b->name, fmi2Error, "error", why); /* no % in it */
    return fmi2Error;
}

static int finite(const fmi2Real *x, size_t n)
{
    while (n--)
        if (!isfinite(x[n]))
            return 0;
    return 1;
}

static double damping(const State *s, int p)
{
    int i = PAIR[p].i;
    return PAIR[p].c + (i == PAIR[p].j ? 2 * (s->damping[i] - DAMPING_RATIO[i]) * OMEGA[i] : 0.0);
}

/* a - K q - C v, in place of a */
static void resist(const State *s, const double *q, const double *v, double *a)
{
    int p;
    for (p = 0; p < PAIRS; p++)
        a[PAIR[p].i] -= PAIR[p].k * q[PAIR[p].j] + damping(s, p) * v[PAIR[p].j];
}

static void load(const double *f, double *g)
{
    int i, j;
    for (j = 0; j < MODES; j++)
        for (i = 0, g[j] = 0; i < INPUTS; i++)
            g[j] += LOAD[i][j] * f[i];
}

static void accelerate(const State *s, double *a)
{
    load(s->f, a);
    resist(s, s->x, s->x + MODES, a);
}

/* largest row sums: |x'| <= rate |x| in the norm of (rate q, q') */
static double rate(const State *s)
{
    double k[MODES] = {0}, c[MODES] = {0}, most_k = 0, most_c = 0;
    int p, j;
    for (p = 0; p < PAIRS; p++) {
        k[PAIR[p].i] += fabs(PAIR[p].k);
        c[PAIR[p].i] += fabs(damping(s, p));
    }
    for (j = 0; j < MODES; j++) {
        most_k = fmax(most_k, k[j]);
        most_c = fmax(most_c, c[j]);
    }
    return sqrt(most_k) + most_c;
}

/* short ones that make up a step of h, see advance */
static double parts_of(const State *s, double h) { return 1 + floor(h * rate(s) / 4); }

#define MOST 1e6 /* of them, some seconds; a communication step takes a few */

/* The solution after h by its Taylor series, in parts so short that its terms are all that rounding leaves:
   4^33 / 33! = 8e-18, 1 / 21! = 2e-20 */
static void advance(State *s, double h)
{
    double term[2 * MODES], next[2 * MODES], g[MODES], slope[MODES], parts = parts_of(s, h), part;
    int j, k, terms = h * rate(s) < 1 ? 20 : 32;
    load(s->f, g);
    load(s->rate, slope);
    h /= parts;
    for (part = 0; part < parts && finite(s->x, 2 * MODES); part++) { /* beyond all numbers nothing is left to do */
        memcpy(term, s->x, sizeof term);
        for (k = 1; k <= terms; k++) { /* term k: the k-th derivative times h^k / k! */
            for (j = 0; j < MODES; j++) {
                next[j] = term[MODES + j];
                next[MODES + j] = k == 1 ? g[j] : k == 2 ? slope[j] * h : 0.0;
            }
            resist(s, term, term + MODES, next + MODES);
            for (j = 0; j < 2 * MODES; j++) {
                term[j] = next[j] * h / k;
                s->x[j] += term[j];
            }
        }
        for (j = 0; j < MODES; j++)
            g[j] += slope[j] * h;
    }
    for (j = 0; j < INPUTS; j++) {
        s->f[j] += s->rate[j] * h * parts;
        s->rate[j] = 0;
    }
}

static double *place(State *s, fmi2ValueReference r) /* of what can be set */
{
    return r < A ? s->x + r : r >= D && r < F ? s->damping + (r - D) : r >= F && r < U ? s->f + (r - F) : NULL;
}

static double read(const State *s, fmi2ValueReference r)
{
    const double *x = s->x + (r < W ? 0 : MODES), *row = READ[r < W ? r - U : r - W];
    double sum = 0;
    int j;
    for (j = 0; j < MODES; j++)
        sum += row[j] * x[j];
    return sum;
}

static void begin(State *s)
{
    memset(s, 0, sizeof *s);
    memcpy(s->damping, DAMPING_RATIO, sizeof s->damping);
}

#define STATE (&((Body *)c)->s)
#define CALL FMI2_Export fmi2Status
#define READY { return fmi2OK; }
#define NEVER { return refuse((Body *)c, "this function is not offered"); }
#define FINITE(call, x, n) (finite(x, n) || (refuse((Body *)c, call ": takes finite numbers alone"), 0))
#define REFERENCES const fmi2ValueReference r[], size_t n
#define NONE { return n ? refuse((Body *)c, "every variable is a real one") : fmi2OK; }

FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging)
{
    Body *b = guid && !strcmp(guid, GUID) ? calloc(1, sizeof(Body)) : NULL;
    if (!b)
        return NULL;
    if (call)
        b->call = *call;
    strncpy(b->name, name ? name : "", sizeof b->name - 1);
    begin(&b->s);
    return b;
}

FMI2_Export void fmi2FreeInstance(fmi2Component c) { free(c); }
CALL fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String category[]) READY
CALL fmi2SetupExperiment(fmi2Component c, fmi2Boolean known, fmi2Real tolerance, fmi2Real start, fmi2Boolean ends,
                         fmi2Real stop)
{
    const fmi2Real given[] = {start, known ? tolerance : 0, ends ? stop : 0};
    return FINITE("fmi2SetupExperiment", given, 3) ? (STATE->time = start, fmi2OK) : fmi2Error;
}
CALL fmi2EnterInitializationMode(fmi2Component c) READY
CALL fmi2ExitInitializationMode(fmi2Component c) READY
CALL fmi2Terminate(fmi2Component c) READY
CALL fmi2Reset(fmi2Component c) { begin(STATE); return fmi2OK; }

CALL fmi2GetReal(fmi2Component c, REFERENCES, fmi2Real value[])
{
    double a[MODES];
    size_t i;
    int known = 0;
    for (i = 0; i < n; i++) {
        if (r[i] >= END)
            return refuse((Body *)c, "fmi2GetReal: there is no such variable");
        if (r[i] >= A && r[i] < D && !known++)
            accelerate(STATE, a);
        value[i] = r[i] >= U ? read(STATE, r[i]) : r[i] >= A && r[i] < D ? a[r[i] - A] : *place(STATE, r[i]);
    }
    return fmi2OK;
}

CALL fmi2SetReal(fmi2Component c, REFERENCES, const fmi2Real value[])
{
    size_t i;
    if (!FINITE("fmi2SetReal", value, n))
        return fmi2Error;
    for (i = 0; i < n; i++) {
        double *at = place(STATE, r[i]);
        if (!at)
            return refuse((Body *)c, "fmi2SetReal: this variable cannot be set");
        *at = value[i];
    }
    return fmi2OK;
}

CALL fmi2GetInteger(fmi2Component c, REFERENCES, fmi2Integer value[]) NONE
CALL fmi2GetBoolean(fmi2Component c, REFERENCES, fmi2Boolean value[]) NONE
CALL fmi2GetString(fmi2Component c, REFERENCES, fmi2String value[]) NONE
CALL fmi2SetInteger(fmi2Component c, REFERENCES, const fmi2Integer value[]) NONE
CALL fmi2SetBoolean(fmi2Component c, REFERENCES, const fmi2Boolean value[]) NONE
CALL fmi2SetString(fmi2Component c, REFERENCES, const fmi2String value[]) NONE

CALL fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *copy)
{
    if (!*copy && !(*copy = malloc(sizeof(State))))
        return refuse((Body *)c, "fmi2GetFMUstate: there is no memory left");
    memcpy(*copy, STATE, sizeof(State));
    return fmi2OK;
}
CALL fmi2SetFMUstate(fmi2Component c, fmi2FMUstate copy)
{
    if (!FINITE("fmi2SetFMUstate", copy, sizeof(State) / sizeof(double)))
        return fmi2Error;
    memcpy(STATE, copy, sizeof(State));
    return fmi2OK;
}
CALL fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *copy) { free(*copy); *copy = NULL; return fmi2OK; }
CALL fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate copy, size_t *size)
{
    *size = sizeof(State);
    return fmi2OK;
}
CALL fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate copy, fmi2Byte to[], size_t size)
{
    return size < sizeof(State) ? fmi2Error : (memcpy(to, copy, sizeof(State)), fmi2OK);
}
CALL fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte from[], size_t size, fmi2FMUstate *copy)
{
    if (size != sizeof(State) || !(*copy = malloc(sizeof(State))))
        return refuse((Body *)c, "fmi2DeSerializeFMUstate: this is no state of this unit");
    memcpy(*copy, from, sizeof(State));
    return fmi2OK;
}
CALL fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t nu,
                                  const fmi2ValueReference k[], size_t nk, const fmi2Real dk[], fmi2Real du[]) NEVER

/* model exchange */
#define COPY(to, from) { return n == 2 * MODES ? (memcpy(to, from, sizeof STATE->x), fmi2OK) : fmi2Error; }
CALL fmi2EnterEventMode(fmi2Component c) READY
CALL fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) { memset(info, 0, sizeof *info); return fmi2OK; }
CALL fmi2EnterContinuousTimeMode(fmi2Component c) READY
CALL fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean kept, fmi2Boolean *event, fmi2Boolean *end)
{
    *event = *end = 0;
    return fmi2OK;
}
CALL fmi2SetTime(fmi2Component c, fmi2Real time)
{
    return FINITE("fmi2SetTime", &time, 1) ? (STATE->time = time, fmi2OK) : fmi2Error;
}
CALL fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n)
{
    if (!FINITE("fmi2SetContinuousStates", x, n))
        return fmi2Error;
    COPY(STATE->x, x)
}
CALL fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) COPY(x, STATE->x)
CALL fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n)
{
    if (n != 2 * MODES)
        return fmi2Error;
    memcpy(dx, STATE->x + MODES, MODES * sizeof *dx);
    accelerate(STATE, dx + MODES);
    return fmi2OK;
}
CALL fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) READY
CALL fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) COPY(x, NOMINAL)

/* co-simulation */
CALL fmi2SetRealInputDerivatives(fmi2Component c, REFERENCES, const fmi2Integer order[], const fmi2Real value[])
{
    size_t i;
    if (!FINITE("fmi2SetRealInputDerivatives", value, n))
        return fmi2Error;
    for (i = 0; i < n; i++) {
        if (order[i] != 1 || r[i] < F || r[i] >= U)
            return refuse((Body *)c, "fmi2SetRealInputDerivatives: inputs have a first derivative and no other");
        STATE->rate[r[i] - F] = value[i];
    }
    return fmi2OK;
}
CALL fmi2GetRealOutputDerivatives(fmi2Component c, REFERENCES, const fmi2Integer order[], fmi2Real value[]) NEVER
CALL fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean final)
{
    State before = *STATE;
    if (!(h >= 0) || h > 1e300 || !isfinite(time))
        return refuse((Body *)c, "fmi2DoStep: the step must be a positive time");
    if (!(parts_of(STATE, h) <= MOST))
        return refuse((Body *)c, "fmi2DoStep: the step is longer than can be followed, "
                                 "some 1e5 periods of the fastest mode; shorten it");
    advance(STATE, h);
    STATE->time = time + h;
    if (finite(STATE->x, 2 * MODES))
        return fmi2OK;
    *STATE = before;
    return refuse((Body *)c, "fmi2DoStep: the motion grows beyond all numbers");
}
CALL fmi2CancelStep(fmi2Component c) NEVER
#define LATER { return fmi2Discard; } /* of steps that end later: there are none */
CALL fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) LATER
CALL fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    *value = STATE->time;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}
CALL fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) LATER
CALL fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) LATER
CALL fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) LATER
