"""Coefficients of the quarter wave in crates/sagnac-core/src/harmonic.rs (and its C and Verilog ports).

    sin(pi z / 2) = z + z·R(z^2),   0 <= z <= 1,   R of degree 5: an odd polynomial of degree 11

Remez exchange on the absolute error of the sine with R(1) = 0, so that the quarter is 1 exactly. The coefficients are rounded to Q32; what
that leaves of R(1) goes to the largest one. Needs mpmath (run with 1.4.1); prints the table of the source and the error before and after rounding.

    python3 testdata/sine/quarter_wave.py
"""

from mpmath import floor, lu_solve, matrix, mp, mpf, pi, sin

mp.dps = 50
DEGREE = 5


def wanted(z):
    return sin(pi * z / 2) - z


def basis(z):
    """z^(2k+1) - z, k = 1 … 5: what is zero at z = 1, so that R(1) = 0 whatever the coefficients."""
    return [z ** (2 * k + 1) - z for k in range(1, DEGREE + 1)]


def remez():
    # One more place than there are coefficients; the error is equal there but for its sign.
    places = [sin(pi * (2 * k + 1) / (4 * (DEGREE + 2))) for k in range(DEGREE + 1)]
    for _ in range(20):
        rows = [basis(z) + [(-1) ** k] for k, z in enumerate(places)]
        solved = lu_solve(matrix(rows), matrix([wanted(z) for z in places]))
        free, level = [solved[k] for k in range(DEGREE)], abs(solved[DEGREE])

        def error(z):
            return wanted(z) - sum(c * b for c, b in zip(free, basis(z)))

        grid = [mpf(k) / 8000 for k in range(8001)]
        values = [error(z) for z in grid]
        turns = [k for k in range(1, 8000) if (values[k] - values[k - 1]) * (values[k + 1] - values[k]) <= 0]
        turns = sorted(turns, key=lambda k: -abs(values[k]))[: DEGREE + 1]
        assert len(turns) == DEGREE + 1
        places = sorted(grid[k] for k in turns)
        if max(abs(value) for value in values) < level * (1 + mpf(10) ** -5):
            break
    return [-sum(free)] + free, max(abs(value) for value in values)


def rounded(coefficients):
    """To Q32, R(1) = 0 kept."""
    table = [int(floor(c * 2**32 + mpf(1) / 2)) for c in coefficients]
    table[0] -= sum(table)
    return table


if __name__ == "__main__":
    exact, level = remez()
    table = rounded(exact)
    assert sum(table) == 0
    print("Q32, from the constant on:", table)
    of_table = max(
        abs(wanted(z) - sum(mpf(c) / 2**32 * z ** (2 * k + 1) for k, c in enumerate(table)))
        for z in (mpf(k) / 8000 for k in range(8001))
    )
    print("largest error, LSB of Q31: %s exact, %s rounded" % (mp.nstr(level * 2**31, 3), mp.nstr(of_table * 2**31, 3)))
