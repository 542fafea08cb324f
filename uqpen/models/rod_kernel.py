"""The compiled part of `walker_anderson`: eroding rods integrated side by side in lanes, by Numba.

Sixteen runs are integrated together, each with a step of its own, in one loop that the compiler
turns into vector instructions; a lane whose run has ended takes the next. Lanes share nothing, so
a run's result has the same bits whatever else is in its batch and wherever in it the run stands.

The unknowns are the slowness p = 1/(u/v0 + 1/8), the excess x = v/u - 1, the length L and the
depth z, with lengths in units of the rod's own and velocities in units of its impact velocity.
In them the equations stay regular where the nose comes to rest, which those in u and v do not.
Erosion ends where x is 0 again (v = u) or p reaches 8 (u = 0).

All compiled code stands in this one file, as Numba's cache notices no change in another; only what
never changes comes from elsewhere: the weights of the Runge-Kutta pair, and how to compile.

References
----------
Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876. Its equation numbers in brackets.
Hénon, M. (1982). Physica D 5, 412-414. The step that lands on an event.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.models.compiled import align_stack, compiled, inlined, use_widest_vectors

# The explicit Runge-Kutta pair of orders 5 and 4 by Tsitouras, as weights of the stages' slopes.


STAGE_2 = (0.161,)
STAGE_3 = (-0.008480655492356989, 0.335480655492357)
STAGE_4 = (2.8971530571054935, -6.359448489975075, 4.3622954328695815)
STAGE_5 = (5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525)
STAGE_6 = (
    5.86145544294642,
    -12.92096931784711,
    8.159367898576159,
    -0.071584973281401,
    -0.028269050394068383,
)
SOLUTION = (
    0.09646076681806523,
    0.01,
    0.4798896504144996,
    1.379008574103742,
    -3.290069515436081,
    2.324710524099774,
)
# The solution of order 5 less that of order 4.
ERROR = (
    -0.00178001105222577714,
    -0.0008164344596567469,
    0.007880878010261995,
    -0.1447110071732629,
    0.5823571654525552,
    -0.45808210592918697,
    0.015151515151515152,
)


FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Vector = tuple[float, float, float, float]
Rod = tuple[float, float, float, float, float, float, float, float]
# Where a step begins, its length, the rod, and what the step is measured along.
Start = tuple[Vector, float, Rod, int]

# How erosion ended: v = u and u = 0, with the numbers of `rod_and_target.Termination`, or neither
# within the steps allowed.
CAUGHT_UP, AT_REST, GAVE_UP = 0.0, 1.0, -1.0
# The phases of a lane before its end.
_ERODING, _PAST_EVENT = 2.0, 3.0

# Runs that are integrated together.
_LANES = 16
_HALF = _LANES // 2
# Erosion takes 60 steps as a rule and 11 000 where S is only a thousandth more than R.
_STEP_LIMIT = 100_000.0
# A step this much smaller than the first makes no progress; something is not finite.
_SMALLEST_STEP = 1e-20

# p = 1/(u/v0 + _OFFSET): the offset keeps p finite at rest and makes the start mild.
_OFFSET = 0.125
_SLOWNESS_AT_IMPACT = 1.0 / (1.0 + _OFFSET)
_SLOWNESS_AT_REST = 1.0 / _OFFSET
# A step past both events is halved until it is so short that their order is certain.
_JUST_PAST_REST = _SLOWNESS_AT_REST + 0.01

# The bits of 1, whose logarithm is 0, for a power of -3/32 = -(1/16 + 1/32).
_ONE = 0x3FF << 52
_POWER_OF_ONE = np.uint64(_ONE + (_ONE >> 4) + (_ONE >> 5))

# What a step is measured along: the clock, or the variable of an event.
_CLOCK, _EXCESS, _SLOWNESS = 0, 1, 2

# Where each row of numbers, one a lane, begins in the buffer.
_STATE, _SLOPES, _ROD, _STEP, _SMALLEST, _STEPS, _PHASE, _BUFFER = (
    row * _LANES for row in (0, 4, 8, 16, 17, 18, 19, 20)
)


@inlined
def _slopes(state: Vector, rod: Rod, along: int) -> Vector:
    """Derivatives of p, x, L and z along the clock, or along one of them.

    (2.16) and (2.17) are linear in the derivatives of u and x. Their determinant is positive until
    past both events; the clock, dt = determinant · p/L dτ, saves the division by it.
    """
    p, x, L, _ = state
    Omega, o, kappa, gamma, gamma_c, gamma_kappa, a0, resistance = rod
    reciprocal = 1.0 / (p * L)
    u = L * reciprocal - _OFFSET
    s = kappa * x  # (2.9)
    ratio = 1.0 + x
    a = o * s + a0
    b = 2.0 * Omega * L - o * s
    trailing = a + b * ratio
    square, ux = p * p, u * x
    brake = resistance - u * u * (Omega * x * x - 1.0)  # (2.16)
    tail = gamma_c + gamma * ux  # (2.17)
    uM = u * (L - s)
    pace = square * reciprocal  # p/L
    # Cramer's rule, each times p/L in place of the division by the determinant.
    dp = square * ((brake * (uM + gamma_kappa) - tail * (b - o * s) * u) * pace)
    dx = ((L - s) * ratio * brake - trailing * tail) * pace
    dt = (uM * (a + o * s * ratio) + trailing * gamma_kappa) * pace
    if along != _CLOCK:
        rate = 1.0 / (dx if along == _EXCESS else dp)
        return dp * rate, dx * rate, -ux * dt * rate, u * dt * rate
    return dp, dx, -ux * dt, u * dt  # (2.18)


@inlined
def _increment(step: float, weights: tuple[float, ...], slopes: tuple[Vector, ...]) -> Vector:
    p = weights[0] * slopes[0][0]
    x = weights[0] * slopes[0][1]
    L = weights[0] * slopes[0][2]
    z = weights[0] * slopes[0][3]
    for stage in range(1, len(weights)):
        p += weights[stage] * slopes[stage][0]
        x += weights[stage] * slopes[stage][1]
        L += weights[stage] * slopes[stage][2]
        z += weights[stage] * slopes[stage][3]
    return step * p, step * x, step * L, step * z


@inlined
def _moved(start: Start, weights: tuple[float, ...], slopes: tuple[Vector, ...]) -> Vector:
    state, step, _, _ = start
    p, x, L, z = _increment(step, weights, slopes)
    return state[0] + p, state[1] + x, state[2] + L, state[3] + z


@inlined
def _stage(
    start: Start, weights: tuple[float, ...], slopes: tuple[Vector, ...]
) -> tuple[Vector, tuple[Vector, ...]]:
    """The state at the next stage of a step, and the slopes so far with those there."""
    moved = _moved(start, weights, slopes)
    return moved, _with_slopes_at(moved, start, slopes)


@inlined
def _stage_after(
    other: Vector, start: Start, weights: tuple[float, ...], slopes: tuple[Vector, ...]
) -> tuple[Vector, tuple[Vector, ...]]:
    """Compute what `_stage` does, after p of another state.

    The compiler cannot change that order. A step is never negative, and one that is not a number is
    never accepted, so `other` changes no result.
    """
    p, x, L, z = _moved(start, weights, slopes)
    moved = (p if start[1] >= 0.0 else other[0], x, L, z)
    return moved, _with_slopes_at(moved, start, slopes)


@inlined
def _with_slopes_at(moved: Vector, start: Start, slopes: tuple[Vector, ...]) -> tuple[Vector, ...]:
    _, _, rod, along = start
    return (*slopes, _slopes(moved, rod, along))


@inlined
def _step(start: Start, k1: Vector) -> Vector:
    """The state after a step."""
    _, k = _stage(start, STAGE_2, (k1,))
    _, k = _stage(start, STAGE_3, k)
    _, k = _stage(start, STAGE_4, k)
    _, k = _stage(start, STAGE_5, k)
    _, k = _stage(start, STAGE_6, k)
    return _moved(start, SOLUTION, k)


@inlined
def _vector(lanes: FloatArray, row: int, lane: int) -> Vector:
    at = row + lane
    return (lanes[at], lanes[at + _LANES], lanes[at + 2 * _LANES], lanes[at + 3 * _LANES])


@inlined
def _set_vector(lanes: FloatArray, row: int, lane: int, vector: Vector) -> None:
    for place in range(4):
        lanes[row + place * _LANES + lane] = vector[place]


@inlined
def _rod(lanes: FloatArray, lane: int) -> Rod:
    return _vector(lanes, _ROD, lane) + _vector(lanes, _ROD + 4 * _LANES, lane)


@inlined
def _start(lanes: FloatArray, lane: int, rods: FloatArray, run: int, first_step: float) -> None:
    for row in range(8):
        lanes[_ROD + row * _LANES + lane] = rods[row, run]
    state = (_SLOWNESS_AT_IMPACT, 0.0, 1.0, 0.0)
    slopes = _slopes(state, _rod(lanes, lane), _CLOCK)
    _set_vector(lanes, _STATE, lane, state)
    _set_vector(lanes, _SLOPES, lane, slopes)
    step = 2.0 * first_step / (abs(slopes[0]) + abs(slopes[1]))
    lanes[_STEP + lane] = step
    lanes[_SMALLEST + lane] = step * _SMALLEST_STEP
    lanes[_STEPS + lane] = 0.0


@inlined
def _beginning(lanes: FloatArray, lane: int) -> tuple[Start, tuple[Vector, ...]]:
    start = _vector(lanes, _STATE, lane), lanes[_STEP + lane], _rod(lanes, lane), _CLOCK
    return start, (_vector(lanes, _SLOPES, lane),)


@inlined
def _advance(lanes: FloatArray, tolerance: float) -> int:
    """Try one step in every lane; how many lanes have ended.

    Two vectors of lanes take their stages by turns, so that the processor has work from one of
    them while the other waits for a division. Each stage waits for p of the one before: LLVM would
    do the whole step of one vector before that of the other, to keep fewer numbers at a time.
    """
    use_widest_vectors()
    ended = 0
    for lane in range(_HALF):
        one, k = _beginning(lanes, lane)
        two, j = _beginning(lanes, lane + _HALF)
        moved, k = _stage(one, STAGE_2, k)
        other, j = _stage_after(moved, two, STAGE_2, j)
        moved, k = _stage_after(other, one, STAGE_3, k)
        other, j = _stage_after(moved, two, STAGE_3, j)
        moved, k = _stage_after(other, one, STAGE_4, k)
        other, j = _stage_after(moved, two, STAGE_4, j)
        moved, k = _stage_after(other, one, STAGE_5, k)
        other, j = _stage_after(moved, two, STAGE_5, j)
        moved, k = _stage_after(other, one, STAGE_6, k)
        other, j = _stage_after(moved, two, STAGE_6, j)
        moved, k = _stage_after(other, one, SOLUTION, k)
        other, j = _stage_after(moved, two, SOLUTION, j)
        ended += _accept(lanes, lane, one, moved, k, tolerance)
        ended += _accept(lanes, lane + _HALF, two, other, j, tolerance)
    return ended


@inlined
def _small_root(value: float) -> float:
    """The power of -3/32, to a tenth: a number's bits are about its logarithm, and cost no root."""
    bits = np.float64(value).view(np.uint64)
    part = (bits >> np.uint64(4)) + (bits >> np.uint64(5))
    return np.uint64(_POWER_OF_ONE - part).view(np.float64)


@inlined
def _accept(
    lanes: FloatArray,
    lane: int,
    start: Start,
    moved: Vector,
    slopes: tuple[Vector, ...],
    tolerance: float,
) -> int:
    """Accept a step, or try it again shorter, and choose the next; 1 if the lane has ended."""
    state, step, rod, _ = start
    p, x, L, _ = moved
    errors = _increment(step, ERROR, slopes)
    scale = 0.5 / tolerance**2
    error = scale * (
        errors[0] ** 2 + 9.0 * errors[1] ** 2 + 9.0 * (errors[2] / L) ** 2 + errors[3] ** 2
    )
    # Plastic flow never takes hold of the whole rod, as (2.17) slows the tail before it does.
    possible = rod[2] * x < L and not (x < 0.0 and p > _JUST_PAST_REST)
    accepted = error <= 1.0 and possible
    factor = 0.9 * _small_root(error + 1e-8)  # 1e-8 bounds the growth
    factor = factor if factor > 0.2 else 0.2  # also where the error is not a number
    factor = factor if possible or factor < 0.5 else 0.5
    _set_vector(lanes, _STATE, lane, moved if accepted else state)
    _set_vector(lanes, _SLOPES, lane, slopes[6] if accepted else slopes[0])
    steps = lanes[_STEPS + lane] + 1.0
    lanes[_STEPS + lane] = steps
    lanes[_STEP + lane] = step * factor
    past = accepted and (x < 0.0 or p > _SLOWNESS_AT_REST)
    lost = steps >= _STEP_LIMIT or step < lanes[_SMALLEST + lane]
    lanes[_PHASE + lane] = _PAST_EVENT if past else (GAVE_UP if lost else _ERODING)
    return 1 if past or lost else 0


@inlined
def _land(lanes: FloatArray) -> None:
    """From just past an event one step back to it, with the event's variable for a clock."""
    use_widest_vectors()
    for lane in range(_LANES):
        state = _vector(lanes, _STATE, lane)
        rod = _rod(lanes, lane)
        p, x, _, _ = state
        dp, dx, _, _ = _slopes(state, rod, _CLOCK)
        # Of two events the first is the one that was passed longer ago.
        caught_up = x < 0.0 and (p <= _SLOWNESS_AT_REST or x / dx > (p - _SLOWNESS_AT_REST) / dp)
        along = _EXCESS if caught_up else _SLOWNESS
        back = -x if caught_up else _SLOWNESS_AT_REST - p
        landed = _step((state, back, rod, along), _slopes(state, rod, along))
        lanes[_STATE + lane] = 1.0 / landed[0] - _OFFSET if caught_up else 0.0
        for row in range(1, 4):
            lanes[_STATE + row * _LANES + lane] = landed[row]
        if lanes[_PHASE + lane] == _PAST_EVENT:
            lanes[_PHASE + lane] = CAUGHT_UP if caught_up else AT_REST


@inlined
def _integrate(
    lanes: FloatArray,
    occupant: IntArray,
    rods: FloatArray,
    tolerance: float,
    first_step: float,
    ends: FloatArray,
) -> None:
    """Bring every run just past its event; a lane without a run of its own repeats the last."""
    runs = rods.shape[1]
    for lane in range(_LANES):
        occupant[lane] = lane
        _start(lanes, lane, rods, min(lane, runs - 1), first_step)
    waiting = _LANES
    unfinished = runs
    while unfinished > 0:
        if _advance(lanes, tolerance) == 0:
            continue
        for lane in range(_LANES):
            if lanes[_PHASE + lane] == _ERODING:
                continue
            if occupant[lane] < runs:
                for row in range(4):
                    ends[row, occupant[lane]] = lanes[_STATE + row * _LANES + lane]
                ends[4, occupant[lane]] = lanes[_PHASE + lane]
                ends[5, occupant[lane]] = lanes[_STEPS + lane]
                unfinished -= 1
            occupant[lane] = waiting
            _start(lanes, lane, rods, min(waiting, runs - 1), first_step)
            waiting += 1


@inlined
def _land_all(lanes: FloatArray, rods: FloatArray, ends: FloatArray) -> None:
    runs = rods.shape[1]
    for first in range(0, runs, _LANES):
        occupied = min(_LANES, runs - first)
        for lane in range(occupied):
            for row in range(8):
                lanes[_ROD + row * _LANES + lane] = rods[row, first + lane]
            for row in range(4):
                lanes[_STATE + row * _LANES + lane] = ends[row, first + lane]
            lanes[_PHASE + lane] = ends[4, first + lane]
        _land(lanes)
        for lane in range(occupied):
            for row in range(4):
                ends[row, first + lane] = lanes[_STATE + row * _LANES + lane]
            ends[4, first + lane] = lanes[_PHASE + lane]


@compiled("float64[:, ::1](float64[:, ::1], float64)")
def erode(rods: FloatArray, tolerance: float) -> FloatArray:
    """Integrate rods, at least one; see `uqpen.models.walker_anderson.erode`."""
    align_stack()
    ends = np.empty((6, rods.shape[1]))
    lanes, occupants = np.zeros(_BUFFER), np.empty(_LANES, np.int64)
    _integrate(lanes, occupants, rods, tolerance, tolerance**0.2, ends)
    _land_all(lanes, rods, ends)
    return ends
