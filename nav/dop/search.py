"""The search behind `subset`: all choices, or branch and bound with its Eqs. (1) and (2). Compiled.

Everywhere `start` is the prior's information (m, m), `pieces` (n, m, m) that of each landmark, and a choice's value the
trace of the last `wanted` rows and columns of the inverse of their sum; inf when that is singular.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.kernels import njit
from dockair.rotations import Array

_PIVOT = 1e-13  # of N at unit diagonal: nothing but rounding is left
_TIE = 1e-9  # relative; a choice that is better by less is the same choice by symmetry and rounding
_SHIFTS = 4  # of w toward Eq. (2)'s best at each node: more cost more than the branches they save

Integers = NDArray[np.signedinteger[Any]]


@njit(cache=True)
def _factor(N: Array, L: Array) -> bool:
    """Fill the Cholesky factor of N; False when N at unit diagonal is singular."""
    for i in range(len(N)):
        if not (N[i, i] > 0.0 and N[i, i] < np.inf):
            return False
        for j in range(i + 1):
            total = N[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i != j:
                L[i, j] = total / L[j, j]
            elif total > _PIVOT * N[i, i]:
                L[i, i] = np.sqrt(total)
            else:
                return False
    return True


@njit(cache=True)
def _trace(L: Array, wanted: int) -> float:
    """Trace of the last block of (LL')^-1: that block is the inverse of L's own last block times its transpose."""
    m, total = len(L), 0.0
    for c in range(m - wanted, m):
        x = np.empty(m)
        for i in range(c, m):
            x[i] = 1.0 if i == c else 0.0
            for k in range(c, i):
                x[i] -= L[i, k] * x[k]
            x[i] /= L[i, i]
            total += x[i] * x[i]
    return total


@njit(cache=True)
def _value(N: Array, L: Array, wanted: int) -> float:
    return _trace(L, wanted) if _factor(N, L) else np.inf


@njit(cache=True)
def exhaustive(start: Array, pieces: Array, count: int, wanted: int) -> tuple[float, Integers, int]:
    """Try every choice, in lexicographic order; sums of the first members are kept."""
    n, m = len(pieces), len(start)
    chosen, best = np.arange(count), np.arange(count)
    sums, L = np.empty((count + 1, m, m)), np.zeros((m, m))
    sums[0] = start
    least, tried, changed = np.inf, 0, 0
    while True:
        for d in range(changed, count):
            sums[d + 1] = sums[d] + pieces[chosen[d]]
        tried += 1
        value = _value(sums[count], L, wanted)
        if value < least * (1.0 - _TIE):
            least, best = value, chosen.copy()
        changed = count - 1
        while changed >= 0 and chosen[changed] == n - count + changed:
            changed -= 1
        if changed < 0:
            return least, best, tried
        chosen[changed] += 1
        for d in range(changed + 1, count):
            chosen[d] = chosen[d - 1] + 1


@njit(cache=True)
def _gradient(L: Array, pieces: Array, wanted: int, g: Array) -> None:
    """Fill g_i = -df/dw_i = tr(M N_i), M = N^-1 E'E N^-1 and E the wanted rows."""
    m = len(L)
    X, M = np.zeros((wanted, m)), np.zeros((m, m))
    for c in range(wanted):  # X[c] = N^-1 e_c
        for i in range(m - wanted + c, m):
            X[c, i] = 1.0 if i == m - wanted + c else 0.0
            for k in range(i):
                X[c, i] -= L[i, k] * X[c, k]
            X[c, i] /= L[i, i]
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                X[c, i] -= L[k, i] * X[c, k]
            X[c, i] /= L[i, i]
    for c in range(wanted):
        for i in range(m):
            for j in range(m):
                M[i, j] += X[c, i] * X[c, j]
    for i in range(len(pieces)):
        g[i] = 0.0
        for j in range(m):
            for k in range(m):
                g[i] += M[j, k] * pieces[i, j, k]


@njit(cache=True)
def _lower_bound(start: Array, pieces: Array, state: Array, count: int, wanted: int, w: Array) -> float:
    """The larger of Eqs. (1) and (2) for a node; w is improved on the way.

    Args:
        start: prior.
        pieces: landmarks.
        state: (n,) 1 in, -1 out, 0 open.
        count: how many are to be in.
        wanted: size of the minimised block, the last.
        w: (n,) weights to begin with.
    """
    n, m = len(pieces), len(start)
    L, g, N, taken = np.zeros((m, m)), np.empty(n), start.copy(), 0
    for i in range(n):
        taken += state[i] == 1
        if state[i] >= 0:
            N += pieces[i]
    bound, rest = _value(N, L, wanted), count - taken
    if bound == np.inf:
        return bound
    for _ in range(_SHIFTS):
        _feasible(state, rest, w)
        N[:] = start
        for i in range(n):
            N += w[i] * pieces[i]
        if not _factor(N, L):
            return bound
        value = _trace(L, wanted)
        _gradient(L, pieces, wanted, g)
        at_w, steepest = 0.0, np.empty(n)
        for i in range(n):
            at_w += w[i] * g[i] if state[i] == 0 else 0.0
            steepest[i] = g[i] if state[i] == 0 else -np.inf
        steepest.sort()
        bound = max(bound, value + at_w - steepest[n - rest :].sum())
        for i in range(n):
            w[i] *= np.sqrt(max(g[i], 0.0))  # of landmarks nearly on a line rounding may leave less than nothing
    _feasible(state, rest, w)
    return bound


@njit(cache=True)
def _feasible(state: Array, rest: int, w: Array) -> None:
    """Make w fit a node: 1 in, 0 out, the open ones scaled to sum up to `rest` with none beyond 1."""
    full = np.zeros(len(w), np.bool_)
    for i in range(len(w)):
        if state[i] != 0:
            w[i] = 1.0 if state[i] == 1 else 0.0
    for _ in range(len(w)):
        total, left, over = 0.0, float(rest), False
        for i in range(len(w)):
            if state[i] == 0 and full[i]:
                left -= 1.0
            elif state[i] == 0:
                w[i] = max(w[i], 1e-12)
                total += w[i]
        for i in range(len(w)):
            if state[i] == 0 and not full[i]:
                w[i] *= left / total
                if w[i] > 1.0:
                    w[i], full[i], over = 1.0, True, True
        if not over:
            return


@njit(cache=True)
def _exchange(start: Array, pieces: Array, chosen: Integers, wanted: int) -> float:
    """Improve a choice by the best single exchanges until there is none; return its value."""
    n, m, count = len(pieces), len(start), len(chosen)
    L, N, inside = np.zeros((m, m)), start.copy(), np.zeros(n, np.bool_)
    for i in chosen:
        N += pieces[i]
        inside[i] = True
    value, better = _value(N, L, wanted), True
    while better:
        better, least, leave, enter = False, value, 0, 0
        for d in range(count):
            N[:] = start  # summed anew: of what nearly cancels, a difference would promise what no choice keeps
            for e in range(count):
                if e != d:
                    N += pieces[chosen[e]]
            for i in range(n):
                if not inside[i]:
                    new = _value(N + pieces[i], L, wanted)
                    if new < least * (1.0 - _TIE):
                        better, least, leave, enter = True, new, d, i
        if better:
            inside[chosen[leave]], inside[enter] = False, True
            chosen[leave], value = enter, least
    return value


@njit(cache=True)
def branch_and_bound(
    start: Array, pieces: Array, count: int, wanted: int, max_nodes: int
) -> tuple[float, Integers, int, float]:
    """Search depth first, the likelier branch first; return value, choice, nodes, and what no choice can beat."""
    n = len(pieces)
    states, weights = np.zeros((2 * n + 2, n), np.int8), np.ones((2 * n + 2, n))
    bounds = np.empty(2 * n + 2)
    bounds[0] = _lower_bound(start, pieces, states[0], count, wanted, weights[0])
    best = np.argsort(-weights[0])[:count]
    least = _exchange(start, pieces, best, wanted)
    depth, nodes = 1, 1
    while depth > 0 and nodes < max_nodes:
        depth -= 1
        if not bounds[depth] < least * (1.0 - _TIE):
            continue
        state, w = states[depth].copy(), weights[depth].copy()
        branch, largest = -1, 0.0
        for i in range(n):
            if state[i] == 0 and (branch < 0 or w[i] > largest):  # one of them also where no w is a number
                branch, largest = i, w[i]
        for into in (-1, 1):  # out below, in on top of the stack: searched first
            state[branch] = into
            taken, open_ = (state == 1).sum(), (state == 0).sum()
            if taken > count or taken + open_ < count:
                continue
            nodes += 1
            if taken == count:
                members = np.flatnonzero(state == 1)
                N, L = start.copy(), np.zeros_like(start)
                for member in members:
                    N += pieces[member]
                value = _value(N, L, wanted)
                if value < least * (1.0 - _TIE):
                    least, best = value, members
                continue
            states[depth], weights[depth] = state, w
            bounds[depth] = _lower_bound(start, pieces, states[depth], count, wanted, weights[depth])
            if bounds[depth] < least * (1.0 - _TIE):
                depth += 1
    bound = least
    for d in range(depth):
        bound = min(bound, bounds[d])
    return least, best, nodes, bound
