"""A nonlinear autoencoder as parameterization: `python autoencoder.py recordings`. Needs `lanesweep[recipes]` and `scikit-learn`.

Each scenario is a vector of its series and numbers. A network with a bottleneck of a few numbers learns to reproduce the vectors
of the other folds; the folds are those of `study`. The reproduced scenarios go back as S' by `study(external=…)`. The
decompositions beside them have seen none of the scenarios that they replay either.
"""

from __future__ import annotations

import argparse
import warnings

import lanesweep
import numpy as np
import numpy.typing as npt
import polars as pl
from lanesweep import recipes
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

Array = npt.NDArray[np.float64]


def reproduce(train: Array, test: Array, weights: Array, size: int) -> Array:
    """The test vectors from `size` numbers each, by a network trained on others."""
    centre = train.mean(axis=0)
    x = (train - centre) * weights
    network = MLPRegressor(
        hidden_layer_sizes=(32, size, 32), activation="tanh", solver="lbfgs", alpha=1e-3, max_iter=1500, random_state=157
    )
    with warnings.catch_warnings():
        # The number of iterations is the early stopping.
        warnings.simplefilter("ignore", ConvergenceWarning)
        network.fit(x, x)
    return np.asarray(network.predict((test - centre) * weights) / weights + centre)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", help="folder of recordings")
    parser.add_argument("--category", default="cut-in", help="cut-in, cut-out or lvd")
    parser.add_argument("--size", type=int, default=4, help="numbers of the bottleneck")
    parser.add_argument("--out", help="folder of the study")
    given = parser.parse_args()
    mined = lanesweep.mine(given.recordings)
    folds = lanesweep.study(scenarios=mined, categories=given.category).table("folds").to_polars()
    rows = mined.table("scenarios").to_polars().join(folds.select("id", "fold"), on="id", maintain_order="left")
    z, of = recipes.vectors(rows), rows["fold"].to_numpy()
    reproduced = np.empty_like(z)
    for fold in np.unique(of):
        weights = recipes.fit_description(rows.filter(pl.Series(of != fold)), given.size).weights
        reproduced[of == fold] = reproduce(z[of != fold], z[of == fold], weights, given.size)
    external = {f"autoencoder-{given.size}": recipes.of_vectors(reproduced, rows)}
    study = lanesweep.study(scenarios=mined, categories=given.category, external=external, out=given.out)
    # Mean F1 over drivers and criteria, of every description.
    scores = study.table("results").to_polars().filter(pl.col("f1").is_not_null(), headway="all")
    print(scores.group_by("variant", maintain_order=True).agg(pl.mean("f1")))


if __name__ == "__main__":
    main()
