"""A Hangprinter's line lengths: anchors, spools, line build-up, and no elasticity.

    python -m examples.hangprinter.study [--data DIR] [-o hangprinter_study]

Scored are the lengths of the four lines, on twenty random hold-outs of ten samples, and
on each fifth of the file in turn, predicted from the rest.
"""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from examples.hangprinter.convert import (
    ADVANTAGE,
    ANCHORS,
    LINES,
    RADIUS,
    Samples,
    convert,
    read_samples,
)
from examples.study_output import arguments, print_table, run, write_results

POSITION = np.array([2.0e-3, 1.2e-3, 2.7e-3])  # [m] of the camera, from what is left
LENGTH = 0.5e-3  # [m] of a line's length, likewise
SPLITS, HELD_OUT, BLOCKS = 20, 10, 5
OUTLIER = 0.01  # chance that the worst of all rows is that far off by chance

# prior spreads: of anchors and of the zero of each line [m], then of what a step adds
ANCHOR, ZERO = 0.05, 5e-3
SPREADS = {
    "spool radius": 2e-3,  # [m]
    "build-up": 3e-4,  # [m/rad] of all spools
    "own build-up": 3e-4,  # [m/rad] of each spool
    "tracking offset": 0.05,  # [m] from the camera's mark to where the lines meet
    "elasticity": 1e-4,  # [1/N]
}
COUNTS = {
    "spool radius": 4, "build-up": 1, "own build-up": 4, "tracking offset": 3,
    "elasticity": 1,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Model:
    """Line lengths of a machine.

    Attributes:
        effects: those it has, beside anchors and zeros.
        values: (16 + ...,) shifts of anchors, zeros of lines, then the effects'.
    """

    effects: tuple[str, ...]
    values: NDArray

    @property
    def anchors(self) -> NDArray:
        """(4, 3) [m]."""
        return ANCHORS + self.values[:12].reshape(4, 3)


def columns_of(effect: str, model: Model, samples: Samples) -> NDArray:
    """(k, 4, m) [m] how the lines' lengths change with an effect's unknowns."""
    k = len(samples.position)
    if effect == "spool radius":  # pays out more for each turn
        return np.eye(4) * (samples.spool / ADVANTAGE)[:, None, :]
    # layers unwind: r^2 falls with the length paid out, so r with the turn
    layers = -(samples.spool**2) / 2 / ADVANTAGE
    if effect == "build-up":
        return layers[..., None]
    if effect == "own build-up":
        return np.eye(4) * layers[:, None, :]
    if effect == "tracking offset":
        return -directions(model, samples)
    length = np.linalg.norm(samples.position[:, None] - model.anchors, axis=2)
    return (samples.force * length).reshape(k, 4, 1)


def residuals(model: Model, samples: Samples) -> NDArray:
    """(k, 4) [m] length between anchor and camera position minus length paid out."""
    lengths = np.linalg.norm(samples.position[:, None] - model.anchors, axis=2)
    start = np.linalg.norm(model.anchors, axis=1) + model.values[12:16]
    predicted = start + RADIUS * samples.spool / ADVANTAGE
    place = 16
    for effect in model.effects:
        C = columns_of(effect, model, samples)
        predicted = predicted + C @ model.values[place : place + C.shape[2]]
        place += C.shape[2]
    return lengths - predicted


def fit(effects: tuple[str, ...], samples: Samples) -> tuple[Model, NDArray]:
    """A model of some effects, and one sigma of its values.

    Errors of the camera move all four lengths at once: rows are whitened by both.
    """
    prior = np.array([ANCHOR] * 12 + [ZERO] * 4)
    for effect in effects:
        prior = np.append(prior, [SPREADS[effect]] * COUNTS[effect])
    values = np.zeros(len(prior))
    for _ in range(6):
        model = Model(effects, values)
        A, b = whitened(model, samples)
        normal = A.T @ A + np.diag(prior**-2)
        values = values + np.linalg.solve(normal, A.T @ b - values * prior**-2)
    return Model(effects, values), np.sqrt(np.diag(np.linalg.inv(normal)))


def whitened(model: Model, samples: Samples) -> tuple[NDArray, NDArray]:
    """(4k, m) derivatives of the predicted lengths and (4k,) residuals, in sigmas."""
    W = whitening(model, samples)
    k, a = len(samples.position), model.anchors
    J = np.zeros((k, 4, 16))
    towards = directions(model, samples)
    at_origin = a / np.linalg.norm(a, axis=1)[:, None]
    for line in range(4):
        J[:, line, 3 * line : 3 * line + 3] = at_origin[line] + towards[:, line]
        J[:, line, 12 + line] = 1.0
    J = np.concatenate([J, *(columns_of(e, model, samples) for e in model.effects)], 2)
    r = residuals(model, samples)[..., None]
    return (W @ J).reshape(4 * k, -1), (W @ r).reshape(-1)


def directions(model: Model, samples: Samples) -> NDArray:
    """(k, 4, 3) unit vectors along the lines, away from the anchors."""
    away = samples.position[:, None] - model.anchors
    return away / np.linalg.norm(away, axis=2)[..., None]


def whitening(model: Model, samples: Samples) -> NDArray:
    """(k, 4, 4) W with W' W the inverse covariance of a row's lengths."""
    u = directions(model, samples)
    covariance = (u * POSITION**2) @ np.swapaxes(u, 1, 2) + LENGTH**2 * np.eye(4)
    return np.linalg.inv(np.linalg.cholesky(covariance))


def consistency(model: Model, samples: Samples) -> NDArray:
    """(k,) [m] the part of four lengths that no position of the effector explains."""
    u, r = directions(model, samples), residuals(model, samples)
    normals = np.linalg.svd(u)[0][:, :, 3]
    return np.einsum("kl,kl->k", normals, r)


@dataclass(frozen=True)
class Score:
    """Errors [m] of line lengths that played no part in fitting.

    Attributes:
        pooled: rms over all random hold-outs together.
        mean: of the hold-outs' own rms.
        median: of the samples' rms.
        blocks: rms over the fifths of the file.
        consistency: rms of the part that no position of the effector explains.
    """

    pooled: float
    mean: float
    median: float
    blocks: float
    consistency: float


def score(effects: tuple[str, ...], samples: Samples) -> Score:
    """Errors of a model of some effects on samples it was not fitted to."""
    count = len(samples.position)
    orders = [np.random.default_rng(k).permutation(count) for k in range(SPLITS)]
    lengths, closing = [], []
    for order in orders:
        model, test = _left_out(effects, samples, order[:HELD_OUT])
        lengths.append(residuals(model, test) ** 2)
        closing.append(consistency(model, test) ** 2)
    squares = np.array(lengths)
    spans = np.array_split(np.arange(count), BLOCKS)
    blocks = [residuals(*_left_out(effects, samples, span)) ** 2 for span in spans]
    return Score(
        pooled=float(np.sqrt(squares.mean())),
        mean=float(np.sqrt(squares.mean(axis=(1, 2))).mean()),
        median=float(np.sqrt(np.median(squares.mean(axis=2)))),
        blocks=float(np.sqrt(np.concatenate(blocks).mean())),
        consistency=float(np.sqrt(np.mean(closing))),
    )


def _left_out(
    effects: tuple[str, ...], samples: Samples, rows: NDArray
) -> tuple[Model, Samples]:
    """A model fitted without some samples, and those samples."""
    rest = np.setdiff1d(np.arange(len(samples.position)), rows)
    return fit(effects, samples.take(rest))[0], samples.take(rows)


def outside(effect: str, model: Model, samples: Samples) -> float:
    """[-] part of an effect's signature, in sigmas, that the model cannot imitate."""
    A, _ = whitened(model, samples)
    W = whitening(model, samples)
    s = (W @ columns_of(effect, model, samples)).reshape(len(A), -1)[:, 0]
    left = s - A @ np.linalg.lstsq(A, s, rcond=None)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(s))


def main() -> None:
    """Convert, fit, score, draw."""
    options = arguments(__doc__, "hangprinter_study")
    convert(options.output, options.data)
    samples = read_samples(options.data)
    chosen = ("spool radius", "own build-up")
    model, std = fit(chosen, samples)
    _, w = whitened(model, samples)
    large = np.sum(w.reshape(-1, 4) ** 2, axis=1)
    bad = np.flatnonzero(large > chi2.isf(OUTLIER / len(large), 4))
    rest = np.setdiff1d(np.arange(len(large)), bad)
    shared, own = ("spool radius", "build-up"), ("spool radius", "own build-up")
    ladder = (
        (), shared[:1], shared, own, (*own, "tracking offset"), (*own, "elasticity"),
    )  # fmt: skip
    steps = {}
    for effects in ladder:
        name = " + ".join(("anchors", *effects))
        kept = samples.take(rest)
        steps[name] = score(effects, samples), score(effects, kept)
    for k, which in enumerate(("all samples", "outlier left out")):
        print_table(
            f"held-out line lengths [mm], {which}",
            (
                "model",
                "pooled",
                "mean of splits",
                "median row",
                "blocks",
                "consistency",
            ),
            [
                (name, *(1e3 * x for x in asdict(both[k]).values()))
                for name, both in steps.items()
            ],
        )
    print("\noutliers (sample, chi2 of 4):", [(f"m{i + 1:05d}", large[i]) for i in bad])
    _parameters(model, std)
    stretched, stretched_std = fit(ladder[-1], samples.take(rest))
    away = outside("elasticity", model, samples.take(rest))
    same = Samples(samples.position, samples.spool, np.ones_like(samples.force))
    even = outside("elasticity", model, same.take(rest))
    print(
        f"elasticity 1/EA = {stretched.values[-1]:.1e} +- {stretched_std[-1]:.0e} 1/N; "
        f"{away:.2f} of its signature is its own, {even:.2f} if all forces were equal"
    )
    write_results(options.output, {
        "unit": "m",
        "steps": [
            {"model": n, "all_rows": asdict(a), "without_outliers": asdict(b)}
            for n, (a, b) in steps.items()
        ],
        "outliers": [f"m{i + 1:05d}" for i in bad],
        "anchors": model.anchors, "values": model.values, "std": std,
        "elasticity": {"value": stretched.values[-1], "std": stretched_std[-1],
                       "own_part": away, "own_part_equal_forces": even},
    })  # fmt: skip
    from examples.hangprinter.figure import draw

    names = ("anchors", "+ spool radius", "+ build-up", "+ each spool's own")
    models = [fit(effects, samples)[0] for effects in ladder[:4]]
    left = [residuals(m, samples) for m in models]
    draw(dict(zip(names, left, strict=True)), samples, options.output)


def _parameters(model: Model, std: NDArray) -> None:
    """What was found, all rows."""
    shift = (model.anchors - ANCHORS) * 1e3
    for k, line in enumerate(LINES):
        radius, spread = model.values[16 + k] * 1e3, std[16 + k] * 1e3
        growth, wide = model.values[20 + k] * 1e6, std[20 + k] * 1e6
        print(
            f"  {line}: anchor moved {shift[k].round(1)} mm, spool radius "
            f"{RADIUS * 1e3 + radius:.2f} +- {spread:.2f} mm, build-up "
            f"{growth:.0f} +- {wide:.0f} um of radius per radian"
        )


if __name__ == "__main__":
    run(main)
