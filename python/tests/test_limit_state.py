"""Limit states as functions of points."""

from __future__ import annotations

import os
import signal
import threading
import time

import lanesweep
import numpy as np
import pytest


def test_the_sign_is_the_verdict_and_the_share_of_failures_is_the_estimate(density) -> None:
    limit_state = lanesweep.LimitState(density, model="RSS", criterion="ttc", thw=0.4)
    points = limit_state.draw(4000, np.random.default_rng(1))
    values = limit_state(points)
    assert values.shape == (4000,) and np.isfinite(values).all()
    sample = lanesweep.sample(density, models="RSS", criterion="ttc", thw=0.4, samples=4000, backend="cpu")
    rows = [row for row in sample.table("estimates").to_polars().rows(named=True) if row["criterion"] == "ttc"]
    assert (values <= 0).mean() == pytest.approx(rows[0]["probability"], abs=0.03)
    assert np.isfinite(limit_state.log_density(points)).all()


def test_a_driver_has_a_limit_state_too(density) -> None:
    driver = lanesweep.drivers.Reg157()
    ours = lanesweep.LimitState(density, model=driver, criterion="collision", thw=0.6)
    theirs = lanesweep.LimitState(density, model="Reg157", criterion="collision", thw=0.6)
    points = ours.draw(500, np.random.default_rng(2))
    assert np.array_equal(ours(points), theirs(points))


def test_wrong_points_and_arguments_are_refused(density, tmp_path) -> None:
    limit_state = lanesweep.LimitState(density, thw=1.2)
    d = len(limit_state.parameters)
    assert limit_state(np.asarray(limit_state.points[0])).shape == (1,)
    with pytest.raises(lanesweep.InputError, match=f"give {d} columns"):
        limit_state(np.zeros((3, d + 1)))
    with pytest.raises(lanesweep.InputError, match="row 1 has NaN"):
        limit_state(np.array([np.zeros(d), np.full(d, np.nan)]))
    import pickle

    import pandas as pd

    invalid = np.full(d, -1000.0)
    assert limit_state(invalid) == [np.inf] and limit_state.log_density(invalid) == [-np.inf]
    points = limit_state.draw(20, rng=3)
    frame = pd.DataFrame(points, columns=limit_state.parameters)
    assert np.array_equal(limit_state(frame[limit_state.parameters[::-1]]), limit_state(points))
    assert np.array_equal(pickle.loads(pickle.dumps(limit_state))(points), limit_state(points))
    with pytest.raises(lanesweep.InputError, match="no column"):
        limit_state(frame.iloc[:, 1:])
    with pytest.raises(lanesweep.InputError, match="3 dimensions"):
        limit_state(np.zeros((1, 1, d)))
    with pytest.raises(lanesweep.UsageError, match="headway"):
        lanesweep.LimitState(density)
    with pytest.raises(lanesweep.UsageError, match="criterion"):
        lanesweep.LimitState(density, criterion="speed", thw=1)
    with pytest.raises(lanesweep.LanesweepError):
        lanesweep.LimitState(tmp_path / "none.json", thw=1)


def test_points_of_a_foreign_model_give_its_risk_and_with_their_density_that_of_ours(density) -> None:
    limit_state = lanesweep.LimitState(density, model="RSS", criterion="ttc", thw=0.4)
    centres = np.asarray(limit_state.points)
    rng = np.random.default_rng(5)
    mean, covariance = centres.mean(axis=0), 1.5 * np.cov(centres.T)
    # A foreign model: one wide Gaussian.
    drawn = rng.multivariate_normal(mean, covariance, size=20_000)
    away = drawn - mean
    square = np.einsum("ij,jk,ik->i", away, np.linalg.inv(covariance), away)
    logs = -0.5 * (square + np.linalg.slogdet(2 * np.pi * covariance)[1])
    truth = (limit_state(limit_state.draw(20_000, rng=1)) <= 0).mean()
    ours = limit_state.estimate(drawn, logs)
    assert ours["low"] < truth * 1.1 and ours["high"] > truth * 0.9 and ours["mean_weight"] == pytest.approx(1, abs=0.2)
    theirs = limit_state.estimate(drawn)
    valid = limit_state.is_valid(drawn)
    assert theirs["valid"] == valid.sum() and theirs["probability"] == (limit_state(drawn)[valid] <= 0).mean()
    with pytest.raises(lanesweep.InputError, match="densities for"):
        limit_state.estimate(drawn, logs[1:])


def test_standard_normal_numbers_become_the_density_and_its_probability_is_theirs_over_the_valid_share(density) -> None:
    limit_state = lanesweep.LimitState(density, model="RSS", criterion="ttc", thw=0.4)
    u = np.random.default_rng(3).standard_normal((20_000, len(limit_state.parameters)))
    points = limit_state.from_standard_normal(u)
    assert points.shape == u.shape and np.isfinite(points).all()
    valid = limit_state.is_valid(points)
    assert valid.mean() == pytest.approx(limit_state.valid_share, abs=0.015)
    drawn = limit_state.draw(20_000, rng=4)
    assert points[valid].mean(axis=0) == pytest.approx(drawn.mean(axis=0), abs=5 * drawn.std(axis=0).max() / 100)
    probability = (limit_state(points) <= 0).mean() / limit_state.valid_share
    assert probability == pytest.approx((limit_state(drawn) <= 0).mean(), abs=0.015)
    # Increasing in the first parameter, whatever the others are.
    line = np.zeros((50, u.shape[1]))
    line[:, 0] = np.linspace(-5, 5, 50)
    assert (np.diff(limit_state.from_standard_normal(line)[:, 0]) > 0).all()
    with pytest.raises(lanesweep.InputError, match="give"):
        limit_state.from_standard_normal(u[:, 1:])


def test_subset_simulation_of_another_library_gives_our_probability(density) -> None:
    ot = pytest.importorskip("openturns")
    limit_state = lanesweep.LimitState(density, model="RSS", criterion="ttc", thw=0.8)
    dimension = len(limit_state.parameters)
    truth = (limit_state(limit_state.draw(40_000, rng=4)) <= 0).mean()

    def values(u: object) -> np.ndarray:
        return np.minimum(limit_state(limit_state.from_standard_normal(np.asarray(u))), 1e3)[:, np.newaxis]

    function = ot.PythonFunction(dimension, 1, func_sample=values)
    vector = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(dimension)))
    event = ot.ThresholdEvent(vector, ot.LessOrEqual(), 0.0)
    for algorithm in (ot.SubsetSampling(event), ot.NAIS(event, 0.1)):
        ot.RandomGenerator.SetSeed(1)
        algorithm.setMaximumOuterSampling(2000)
        algorithm.setBlockSize(1)
        algorithm.run()
        found = algorithm.getResult().getProbabilityEstimate() / limit_state.valid_share
        assert found == pytest.approx(truth, rel=0.35), (algorithm.getClassName(), found, truth)


def test_draws_weighted_by_their_own_density_are_the_crude_estimate(density) -> None:
    limit_state = lanesweep.LimitState(density, model="RSS", criterion="ttc", thw=0.4)
    points = limit_state.draw(4000, rng=2)
    share = (limit_state(points) <= 0).mean()
    itself = limit_state.estimate(points, limit_state.log_density(points))
    assert itself["probability"] == pytest.approx(share) and itself["mean_weight"] == pytest.approx(1)


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("call", ["__call__", "from_standard_normal", "log_density"])
def test_an_interrupt_ends_millions_of_points_within_seconds(density, call) -> None:
    limit_state = lanesweep.LimitState(density, thw=1.0)
    points = np.tile(limit_state.draw(1000, rng=1), (3000, 1))
    threading.Timer(0.3, lambda: signal.raise_signal(signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        getattr(limit_state, call)(points)
    assert time.monotonic() - start < 4
    assert np.isfinite(limit_state(points[:10])).all()
