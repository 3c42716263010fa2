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
