"""Limit states as functions of points."""

from __future__ import annotations

import lanesweep
import numpy as np
import pytest


def test_the_sign_is_the_verdict_and_the_share_of_failures_is_the_estimate(density) -> None:
    limit_state = lanesweep.LimitState(density, model="RSS", criterion="ttc", thw=0.4)
    points = limit_state.draw(4000, np.random.default_rng(1))
    values = limit_state(points)
    assert values.shape == (4000,) and np.isfinite(values).all()
    sample = lanesweep.sample(density, models="RSS", criterion="ttc", thw=0.4, samples=4000, backend="cpu")
    rows = [row for row in sample.table("estimates").rows() if row["criterion"] == "ttc"]
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


def test_a_mixture_is_a_density_as_kernels_are(scenarios, tmp_path) -> None:
    for form in ("mixture", "copula"):
        fitted = tmp_path / f"{form}.json"
        lanesweep.fit(scenarios=scenarios, parameterizations=2, density=form, no_comparison=True, out=fitted)
        limit_state = lanesweep.LimitState(fitted, model="RSS", criterion="ttc", thw=0.4)
        points = limit_state.draw(4000, rng=2)
        share = (limit_state(points) <= 0).mean()
        itself = limit_state.estimate(points, limit_state.log_density(points))
        assert itself["probability"] == pytest.approx(share) and itself["mean_weight"] == pytest.approx(1)
