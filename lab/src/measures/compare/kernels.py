"""Kernels and trees of the ring laser literature on Sagnac's inputs: temperature and its rate behind a lag.

usage: kernels.py simulated FIT.csv RETEST.csv OUT.csv     correction at every second of the retest, a column per method
       kernels.py real LOG.tsv [AXES]                      held-out error of each axis, method by method

  LS-SVM          [0 1'; 1 K + I/g] [b; a] = [0; y]       RBF kernel (Suykens); numpy
  RBF network     k-means centres, Gaussians, ridge       scikit-learn's KMeans; numpy
  random forest   RandomForestRegressor
  Gaussian process RBF with a length per input + white, by marginal likelihood
  series          Chebyshev in T times 1 and the rate: Sagnac's family, for the same folds

Every number of a method, the lag too, comes from inner folds (five contiguous blocks) of the training set alone; those of the
Gaussian process from its marginal likelihood. Seeds are fixed.
"""

import sys
import time
import warnings

import numpy as np
from sklearn.cluster import KMeans
from sklearn.ensemble import RandomForestRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

warnings.simplefilter("ignore", ConvergenceWarning)
INNER, OUTER = 5, 12
LAGS_S = (1.0, 60.0, 150.0, 300.0, 600.0, 1000.0)
DPH_PER_RADPS = 206264.80624709636


def rate_cpm(celsius, dt_s, lag_s):
    """Rate of the temperature behind a one-pole lag, degC/min."""
    alpha = 1.0 - np.exp(-dt_s / lag_s)
    lagged, out = celsius[0], np.empty(len(celsius))
    for row, now in enumerate(celsius):
        step = alpha * (now - lagged)
        lagged += step
        out[row] = 60.0 * step / dt_s
    return out


def blocks(n, count):
    return np.arange(n) * count // n


class Scaled:
    """Inputs and target about their means, in their sigmas."""

    def __init__(self, x, y):
        self.x_mean, self.x_sigma = x.mean(0), x.std(0) + 1e-12
        self.y_mean, self.y_sigma = y.mean(), y.std() + 1e-12

    def x(self, x):
        return (x - self.x_mean) / self.x_sigma

    def y(self, y):
        return (y - self.y_mean) / self.y_sigma

    def back(self, y):
        return self.y_mean + self.y_sigma * y


def square_distances(a, b):
    return ((a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2.0 * a @ b.T).clip(0.0)


def ls_svm(x, y, length, gamma):
    n = len(x)
    system = np.ones((n + 1, n + 1))
    system[0, 0] = 0.0
    system[1:, 1:] = np.exp(-square_distances(x, x) / (2.0 * length**2)) + np.eye(n) / gamma
    solution = np.linalg.solve(system, np.append(0.0, y))
    return lambda at: solution[0] + np.exp(-square_distances(at, x) / (2.0 * length**2)) @ solution[1:]


def rbf_network(x, y, centres, width, ridge):
    found = KMeans(centres, n_init=2, random_state=1).fit(x).cluster_centers_
    apart = np.sqrt(square_distances(found, found))
    sigma = width * apart[apart > 0.0].mean() / np.sqrt(2.0)

    def columns(at):
        return np.column_stack([np.ones(len(at)), np.exp(-square_distances(at, found) / (2.0 * sigma**2))])

    design = columns(x)
    weights = np.linalg.solve(design.T @ design + ridge * np.eye(centres + 1), design.T @ y)
    return lambda at: columns(at) @ weights


def forest(x, y, leaf):
    made = RandomForestRegressor(30, min_samples_leaf=leaf, random_state=1, n_jobs=1).fit(x, y)
    return made.predict


GRIDS = {
    "LS-SVM": (ls_svm, [(length, gamma) for length in (0.5, 1.0, 2.0, 4.0) for gamma in (1.0, 10.0, 100.0, 1e4)]),
    "RBF network": (rbf_network, [(c, w, r) for c in (5, 10, 20) for w in (1.0, 2.0) for r in (1e-4, 1e-2, 1.0)]),
    "random forest": (forest, [(leaf,) for leaf in (2, 10, 40)]),
}


def by_inner_folds(method, grid, inputs, y):
    """The method at the lag and the settings of least inner error: (lag, fitted function of scaled inputs)."""
    inner = blocks(len(y), INNER)
    best = (np.inf, None, None)
    for lag, x in inputs.items():
        for setting in grid:
            squares = 0.0
            for fold in range(INNER):
                train, held = inner != fold, inner == fold
                scaled = Scaled(x[train], y[train])
                fitted = method(scaled.x(x[train]), scaled.y(y[train]), *setting)
                squares += ((scaled.back(fitted(scaled.x(x[held]))) - y[held]) ** 2).sum()
            if squares < best[0]:
                best = (squares, lag, setting)
    _, lag, setting = best
    scaled = Scaled(inputs[lag], y)
    fitted = method(scaled.x(inputs[lag]), scaled.y(y), *setting)
    return lag, lambda at: scaled.back(fitted(scaled.x(at)))


def gaussian_process(inputs, y):
    best = (-np.inf, None, None)
    for lag, x in inputs.items():
        scaled = Scaled(x, y)
        width = x.shape[1]
        kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(np.ones(width), [(0.05, 50.0)] * width)
        kernel += WhiteKernel(0.1, (1e-6, 10.0))
        made = GaussianProcessRegressor(kernel, random_state=1).fit(scaled.x(x), scaled.y(y))
        if made.log_marginal_likelihood_value_ > best[0]:
            best = (made.log_marginal_likelihood_value_, lag, (scaled, made))
    _, lag, (scaled, made) = best

    def predict(at):
        pieces = np.array_split(scaled.x(at), max(1, len(at) // 4000))
        return scaled.back(np.concatenate([made.predict(piece) for piece in pieces]))

    return lag, predict


def fit_method(name, inputs, y):
    if name == "Gaussian process":
        return gaussian_process(inputs, y)
    method, grid = GRIDS[name]
    return by_inner_folds(method, grid, inputs, y)


METHODS = ["LS-SVM", "RBF network", "random forest", "Gaussian process"]


def windows_of(values, rows):
    """Means over so many rows; a shorter rest is dropped."""
    return values[: len(values) // rows * rows].reshape(-1, rows).mean(1)


def simulated(fit_path, retest_path, out):
    def read(path):
        rows = np.genfromtxt(path, delimiter=",", names=True)
        known = np.isfinite(rows["temperature_c"]) & np.isfinite(rows["rate_dph"])
        return rows["temperature_c"][known], rows["rate_dph"][known]

    (t, y), (at, _) = read(fit_path), read(retest_path)
    lags = LAGS_S
    rates = {lag: rate_cpm(t, 1.0, lag) for lag in lags}
    inputs = {lag: np.column_stack([windows_of(t, 100), windows_of(r, 100)]) for lag, r in rates.items()}
    y = windows_of(y, 100)
    columns = []
    for name in METHODS:
        start = time.process_time()
        lag, predict = fit_method(name, inputs, y)
        columns.append(predict(np.column_stack([at, rate_cpm(at, 1.0, lag)])))
        print(f"{name}: lag {lag} s, {time.process_time() - start:.0f} s", file=sys.stderr)
    np.savetxt(out, np.column_stack(columns), delimiter=",", fmt="%.9g")


def series_columns(x, rates, order, rate_order):
    """Chebyshev series of x, and of each rate times a series."""
    powers = np.polynomial.chebyshev.chebvander(x, max(order, rate_order))
    columns = [powers[:, : order + 1]]
    columns += [rate[:, None] * powers[:, : rate_order + 1] for rate in rates]
    return np.column_stack(columns)


def series_error(x, rate_sets, extra_of, y, orders=range(1, 9), rate_orders=range(4)):
    """Held-out squares of the series over the outer folds; orders and lags by inner folds. `extra_of`: columns by lags."""
    designs = {}
    for lags, rates in rate_sets.items():
        extra = extra_of(lags)
        for order in orders:
            for rate_order in rate_orders:
                design = series_columns(x, rates, order, rate_order)
                designs[lags, order, rate_order] = design if extra is None else np.column_stack([design, extra])

    def held(design, train, test):
        norm = np.sqrt((design[train] ** 2).sum(0)) + 1e-300
        scaled = design[train] / norm
        # A ridge of rounding size alone.
        gram = scaled.T @ scaled + 1e-10 * np.eye(len(norm))
        weights = np.linalg.solve(gram, scaled.T @ y[train]) / norm
        return ((design[test] @ weights - y[test]) ** 2).sum()

    outer, total, chosen = blocks(len(y), OUTER), 0.0, []
    for fold in range(OUTER):
        train = np.flatnonzero(outer != fold)
        inner = blocks(len(train), INNER)

        def score(design):
            return sum(held(design, train[inner != part], train[inner == part]) for part in range(INNER))

        best = min(designs, key=lambda key: score(designs[key]))
        chosen.append(best)
        total += held(designs[best], train, np.flatnonzero(outer == fold))
    return np.sqrt(total / len(y)), chosen


def outer_error(name, inputs, y):
    outer, total = blocks(len(y), OUTER), 0.0
    for fold in range(OUTER):
        train, held = outer != fold, outer == fold
        lag, predict = fit_method(name, {lag: x[train] for lag, x in inputs.items()}, y[train])
        total += ((predict(inputs[lag][held]) - y[held]) ** 2).sum()
    return np.sqrt(total / len(y))


def real(path, axes="xyz"):
    rows, dt_s = 20, 0.505403
    table = np.genfromtxt(path, delimiter="\t", names=True, deletechars="")[1:]
    celsius = table["imu.temperature"]
    rates = {lag: windows_of(rate_cpm(celsius, dt_s, lag), rows) for lag in LAGS_S}
    t = windows_of(celsius, rows)
    lo, hi = t.min(), t.max()
    x = (2.0 * t - lo - hi) / (hi - lo)
    hours = np.arange(len(t)) / len(t)
    inputs = {lag: np.column_stack([t, rate]) for lag, rate in rates.items()}
    pairs = {(a, b): [rates[a], rates[b]] for a in LAGS_S for b in LAGS_S if a < b}
    singles = {(lag,): [rate] for lag, rate in rates.items()}
    sign = np.sign(rates[60.0])
    low = dict(orders=range(1, 6), rate_orders=range(3))
    for axis in axes:
        y = windows_of(table["imu.gyro." + axis], rows) * DPH_PER_RADPS

        def say(what, value):
            print(f"real: {axis}|{what}|{value:.6g}", flush=True)

        none = {(): []}
        say("cubic", series_error(x, none, lambda _: None, y, orders=[3], rate_orders=[0])[0])
        say("series", series_error(x, singles, lambda _: None, y)[0])
        for name in METHODS:
            start = time.process_time()
            say(name, outer_error(name, inputs, y))
            print(f"{axis} {name}: {time.process_time() - start:.0f} s", file=sys.stderr)
        say("term second lag", series_error(x, pairs, lambda _: None, y, **low)[0])
        say("term direction", series_error(x, singles, lambda _: np.column_stack([sign, sign * x]), y, **low)[0])
        squared = lambda lags: np.column_stack([rates[lags[0]] ** 2, rates[lags[0]] * abs(rates[lags[0]])])
        say("term rate squared", series_error(x, singles, squared, y, **low)[0])
        say("term time", series_error(x, singles, lambda _: hours[:, None], y, **low)[0])


if sys.argv[1] == "simulated":
    simulated(*sys.argv[2:5])
else:
    real(*sys.argv[2:4])
