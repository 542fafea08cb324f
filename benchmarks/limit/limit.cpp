// What a processor can do at most: the equations and the Runge-Kutta pair of uqpen/models/rod_kernel.py,
// compiled for this very machine, with fused operations. `GROUPS` vectors of lanes go step by step
// together, so that one computes while another waits for a division. The weights of the pair
// (A2 ... A6, SOLUTION, ERROR) come from a header that `program.py` writes.

#include <cmath>
#include <cstdint>

#include "weights.h"

#if defined(__AVX512F__)
#define WIDTH 8
#elif defined(__AVX__)
#define WIDTH 4
#else
#define WIDTH 2
#endif
#define GROUPS 2
#define LANES (WIDTH * GROUPS)
#define INLINE static inline __attribute__((always_inline))

typedef double Vector __attribute__((vector_size(WIDTH * 8)));
typedef int64_t Bits __attribute__((vector_size(WIDTH * 8)));

struct Number { Vector v[GROUPS]; };
struct Mask { Bits v[GROUPS]; };

#define EACH for (int g = 0; g < GROUPS; g++)
#define OPERATOR(op) \
    INLINE Number operator op(Number a, Number b) { EACH a.v[g] = a.v[g] op b.v[g]; return a; } \
    INLINE Number operator op(double a, Number b) { EACH b.v[g] = a op b.v[g]; return b; } \
    INLINE Number operator op(Number a, double b) { EACH a.v[g] = a.v[g] op b; return a; }
OPERATOR(+) OPERATOR(-) OPERATOR(*) OPERATOR(/)
#define COMPARISON(op) \
    INLINE Mask operator op(Number a, Number b) { Mask m; EACH m.v[g] = a.v[g] op b.v[g]; return m; } \
    INLINE Mask operator op(Number a, double b) { Mask m; EACH m.v[g] = a.v[g] op b; return m; }
COMPARISON(<) COMPARISON(>) COMPARISON(<=) COMPARISON(>=)
INLINE Mask operator&(Mask a, Mask b) { EACH a.v[g] &= b.v[g]; return a; }
INLINE Mask operator|(Mask a, Mask b) { EACH a.v[g] |= b.v[g]; return a; }
INLINE Mask operator~(Mask a) { EACH a.v[g] = ~a.v[g]; return a; }
INLINE Number operator-(Number a) { EACH a.v[g] = -a.v[g]; return a; }
INLINE Number all(double a) { Number n; EACH n.v[g] = a - Vector{}; return n; }
INLINE Number select(Mask m, Number a, Number b) { EACH a.v[g] = m.v[g] ? a.v[g] : b.v[g]; return a; }

// About e to the -3/32: the exponent of a number divides as its logarithm does.
INLINE Number small_root(Number e) {
    const int64_t one = 0x3FF0000000000000;
    EACH {
        Bits bits = (Bits)e.v[g];
        e.v[g] = (Vector)(one + (one >> 4) + (one >> 5) - (bits >> 4) - (bits >> 5));
    }
    return e;
}

struct State { Number p, x, L, z; };
struct Rod { Number Omega, o, kappa, gamma, gamma_c, gamma_kappa, a0, resistance; };
enum Along { CLOCK, EXCESS_OR_SLOWNESS };

const double OFFSET = 0.125, AT_IMPACT = 1 / (1 + OFFSET), AT_REST = 1 / OFFSET;
const double CAUGHT_UP = 0, RESTS = 1, ERODING = 2, PAST_EVENT = 3, GAVE_UP = -1;

INLINE State slopes(const State& y, const Rod& rod, Along along, Mask is_excess) {
    Number reciprocal = 1.0 / (y.p * y.L);
    Number u = y.L * reciprocal - OFFSET;
    Number s = rod.kappa * y.x;
    Number ratio = 1.0 + y.x;
    Number os = rod.o * s;
    Number a = os + rod.a0;
    Number b = 2.0 * rod.Omega * y.L - os;
    Number trailing = a + b * ratio;
    Number square = y.p * y.p, ux = u * y.x;
    Number brake = rod.resistance - u * u * (rod.Omega * y.x * y.x - 1.0);
    Number tail = rod.gamma_c + rod.gamma * ux;
    Number M = y.L - s;
    Number uM = u * M;
    Number pace = square * reciprocal;
    Number dp = square * ((brake * (uM + rod.gamma_kappa) - tail * (b - os) * u) * pace);
    Number dx = (M * ratio * brake - trailing * tail) * pace;
    Number dt = (uM * (a + os * ratio) + trailing * rod.gamma_kappa) * pace;
    State k = {dp, dx, -ux * dt, u * dt};
    if (along != CLOCK) {
        Number rate = 1.0 / select(is_excess, dx, dp);
        k = {k.p * rate, k.x * rate, k.L * rate, k.z * rate};
    }
    return k;
}

template <int N> INLINE State sum(const double (&weights)[N], const State* k, Number step) {
    State r = {weights[0] * k[0].p, weights[0] * k[0].x, weights[0] * k[0].L, weights[0] * k[0].z};
    for (int i = 1; i < N; i++) {
        r.p = r.p + weights[i] * k[i].p;
        r.x = r.x + weights[i] * k[i].x;
        r.L = r.L + weights[i] * k[i].L;
        r.z = r.z + weights[i] * k[i].z;
    }
    return {step * r.p, step * r.x, step * r.L, step * r.z};
}

template <int N>
INLINE State moved(const State& y, const double (&weights)[N], const State* k, Number step) {
    State r = sum(weights, k, step);
    return {y.p + r.p, y.x + r.x, y.L + r.L, y.z + r.z};
}

// The state after a step; k[0] is known, the others up to k[5] are filled in.
INLINE State stepped(const State& y, State* k, Number step, const Rod& rod, Along along, Mask m) {
    k[1] = slopes(moved(y, A2, k, step), rod, along, m);
    k[2] = slopes(moved(y, A3, k, step), rod, along, m);
    k[3] = slopes(moved(y, A4, k, step), rod, along, m);
    k[4] = slopes(moved(y, A5, k, step), rod, along, m);
    k[5] = slopes(moved(y, A6, k, step), rod, along, m);
    return moved(y, SOLUTION, k, step);
}

struct Lanes {
    State y, k;
    Rod rod;
    Number step, smallest, steps, phase;
};

INLINE double& lane_of(Number& number, int lane) { return ((double*)&number)[lane]; }

INLINE bool advance(Lanes& lanes, double tolerance) {
    State k[7], y = lanes.y;
    Rod rod = lanes.rod;
    Number step = lanes.step;
    k[0] = lanes.k;
    State n = stepped(y, k, step, rod, CLOCK, Mask{});
    k[6] = slopes(n, rod, CLOCK, Mask{});
    State e = sum(ERROR, k, step);
    Number eL = e.L / n.L;
    Number error = (e.p * e.p + 9.0 * (e.x * e.x) + 9.0 * (eL * eL) + e.z * e.z) / (tolerance * tolerance);
    Mask possible = (rod.kappa * n.x < n.L) & ~((n.x < 0) & (n.p > AT_REST + 0.01));
    Mask accepted = (error <= 1) & possible;
    Number factor = 0.9 * small_root(error + 1e-8);
    factor = select(factor > 0.2, factor, all(0.2));
    factor = select(possible | (factor < 0.5), factor, all(0.5));
    lanes.y = {select(accepted, n.p, y.p), select(accepted, n.x, y.x), select(accepted, n.L, y.L),
               select(accepted, n.z, y.z)};
    lanes.k = {select(accepted, k[6].p, k[0].p), select(accepted, k[6].x, k[0].x),
               select(accepted, k[6].L, k[0].L), select(accepted, k[6].z, k[0].z)};
    lanes.steps = lanes.steps + 1.0;
    lanes.step = step * factor;
    Mask past = accepted & ((n.x < 0) | (n.p > AT_REST));
    Mask lost = (lanes.steps >= 100000.0) | (step < lanes.smallest);
    lanes.phase = select(past, all(PAST_EVENT), select(lost, all(GAVE_UP), all(ERODING)));
    Bits ended = past.v[0] | lost.v[0];
    for (int g = 1; g < GROUPS; g++) ended |= past.v[g] | lost.v[g];
    int64_t any = 0;
    for (int i = 0; i < WIDTH; i++) any |= ended[i];
    return any != 0;
}

static void start(Lanes& lanes, int lane, const double* rods, long runs, long run, double first) {
    Number* constants = (Number*)&lanes.rod;
    for (int row = 0; row < 8; row++) lane_of(constants[row], lane) = rods[row * runs + run];
    double Omega = rods[run], gamma_c = rods[4 * runs + run], gamma_kappa = rods[5 * runs + run];
    double a0 = rods[6 * runs + run], resistance = rods[7 * runs + run];
    // The slopes at impact: u = L = 1, x = 0.
    double trailing = a0 + 2 * Omega, force = -1 - resistance;
    double du = (force * (1 + gamma_kappa) + gamma_c * 2 * Omega) * AT_IMPACT;
    double dx = -(trailing * gamma_c + force) * AT_IMPACT;
    double dt = (a0 + trailing * gamma_kappa) * AT_IMPACT, dp = -AT_IMPACT * AT_IMPACT * du;
    double state[4] = {AT_IMPACT, 0, 1, 0}, k[4] = {dp, dx, 0, dt};
    for (int row = 0; row < 4; row++) {
        lane_of(((Number*)&lanes.y)[row], lane) = state[row];
        lane_of(((Number*)&lanes.k)[row], lane) = k[row];
    }
    double step = 2 * first / (std::fabs(dp) + std::fabs(dx));
    lane_of(lanes.step, lane) = step;
    lane_of(lanes.smallest, lane) = step * 1e-20;
    lane_of(lanes.steps, lane) = 0;
}

// From just past an event one step back to it, with the event's variable for a clock (Hénon).
static void land(Lanes& lanes) {
    State k[6], y = lanes.y;
    State now = slopes(y, lanes.rod, CLOCK, Mask{});
    Mask caught_up = (y.x < 0) & ((y.p <= AT_REST) | (y.x / now.x > (y.p - AT_REST) / now.p));
    Number back = select(caught_up, -y.x, AT_REST - y.p);
    k[0] = slopes(y, lanes.rod, EXCESS_OR_SLOWNESS, caught_up);
    State landed = stepped(y, k, back, lanes.rod, EXCESS_OR_SLOWNESS, caught_up);
    landed.p = select(caught_up, 1.0 / landed.p - OFFSET, all(0));
    lanes.y = landed;
    Mask past = (lanes.phase > PAST_EVENT - 0.5) & (lanes.phase < PAST_EVENT + 0.5);
    lanes.phase = select(past, select(caught_up, all(CAUGHT_UP), all(RESTS)), lanes.phase);
}

static void land_all(Lanes& lanes, const double* rods, long runs, double* ends) {
    for (long first = 0; first < runs; first += LANES) {
        int occupied = runs - first < LANES ? (int)(runs - first) : LANES;
        for (int lane = 0; lane < occupied; lane++) {
            for (int row = 0; row < 8; row++)
                lane_of(((Number*)&lanes.rod)[row], lane) = rods[row * runs + first + lane];
            for (int row = 0; row < 4; row++)
                lane_of(((Number*)&lanes.y)[row], lane) = ends[row * runs + first + lane];
            lane_of(lanes.phase, lane) = ends[4 * runs + first + lane];
        }
        land(lanes);
        for (int lane = 0; lane < occupied; lane++) {
            for (int row = 0; row < 4; row++)
                ends[row * runs + first + lane] = lane_of(((Number*)&lanes.y)[row], lane);
            ends[4 * runs + first + lane] = lane_of(lanes.phase, lane);
        }
    }
}

// As `walker_anderson.erode`, for at least one run; `ends` has six rows, the last of numbers of steps.
extern "C" void erode(const double* rods, long runs, double tolerance, double* ends) {
    alignas(64) Lanes lanes = {};
    long occupant[LANES], waiting = LANES, unfinished = runs;
    double first = std::pow(tolerance, 0.2);
    for (int lane = 0; lane < LANES; lane++) {
        occupant[lane] = lane;
        start(lanes, lane, rods, runs, lane < runs ? lane : runs - 1, first);
    }
    while (unfinished > 0) {
        if (!advance(lanes, tolerance)) continue;
        for (int lane = 0; lane < LANES; lane++) {
            if (lane_of(lanes.phase, lane) == ERODING) continue;
            long run = occupant[lane];
            if (run < runs) {
                for (int row = 0; row < 4; row++)
                    ends[row * runs + run] = lane_of(((Number*)&lanes.y)[row], lane);
                ends[4 * runs + run] = lane_of(lanes.phase, lane);
                ends[5 * runs + run] = lane_of(lanes.steps, lane);
                unfinished--;
            }
            occupant[lane] = waiting;
            start(lanes, lane, rods, runs, waiting < runs ? waiting : runs - 1, first);
            waiting++;
        }
    }
    land_all(lanes, rods, runs, ends);
}
