//! Histograms of the parameters of mined scenarios: a plan carries them to whoever writes the report, without the
//! scenarios.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::scenario::parameterization::{Parameter, Parameterization, ParameterizationOptions, SpeedProfile};
use crate::scenario::{Category, Scenario};
use crate::stats::density::ParameterSpace;
use crate::support::readable::plain_step;

/// Most bins of a histogram.
const MAX_BINS: f64 = 40.0;

/// Counts of one parameter in equal bins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterHistogram {
    /// Name with its unit, as in density files: `v_target_mps`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lower end of the first bin, a multiple of the width.
    pub low: f64,
    /// Width of a bin, a plain number.
    pub width: f64,
    /// Scenarios per bin.
    pub counts: Vec<u64>,
}

/// Histograms of the parameters of the kinematic parameterization that has most of them: cut-in 2, cut-out b, LVD i.
/// Without scenarios there are none.
///
/// # Errors
/// Of a scenario that has no such parameters.
pub fn parameter_histograms(
    category: Category,
    scenarios: &[&Scenario],
    options: &ParameterizationOptions,
) -> Result<Vec<ParameterHistogram>> {
    // Of cut-ins with a recorded start only those without a gradual lane change have a density.
    let accelerates = |id: &Parameterization| {
        id.features().is_some_and(|features| features.speed == SpeedProfile::ConstantAcceleration)
    };
    let ids = Parameterization::of(category).filter(accelerates);
    let Some(space) = ids.filter_map(|id| ParameterSpace::new(id, options, None, false).ok()).next() else {
        return Ok(Vec::new());
    };
    let points = scenarios.iter().map(|scenario| space.point(scenario)).collect::<Result<Vec<_>>>()?;
    let of = |(at, parameter): (usize, &Parameter)| {
        let values: Vec<f64> = points.iter().map(|point| point[at]).collect();
        let (low, width, counts) = bins(values)?;
        Some(ParameterHistogram { name: parameter.name.clone(), unit: parameter.unit.clone(), low, width, counts })
    };
    Ok(space.parameters().iter().enumerate().filter_map(of).collect())
}

/// Lower end, width and counts by the rule of Freedman and Diaconis (1981), the width a plain number; `None` without a
/// finite value.
fn bins(mut values: Vec<f64>) -> Option<(f64, f64, Vec<u64>)> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    let (&first, &last) = (values.first()?, values.last()?);
    let n = values.len();
    let quartiles = values[n * 3 / 4] - values[n / 4];
    let rule = 2.0 * quartiles / libm::cbrt(n as f64);
    let least = ((last - first) / MAX_BINS).max(1e-9 * first.abs().max(last.abs())).max(1e-9);
    // From half the rule's width on: the next plain number is up to 2.5 times as large.
    let width = plain_step((0.5 * rule).max(least));
    let (from, to) = ((first / width).floor(), (last / width).floor());
    let mut counts = vec![0_u64; (to - from) as usize + 1];
    for value in values {
        counts[(((value / width).floor() - from) as usize).min((to - from) as usize)] += 1;
    }
    Some((from * width, width, counts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_one_bin_and_there_are_few_of_them() {
        for n in [1_usize, 2, 10, 1000, 100_000] {
            let values: Vec<f64> = (0..n).map(|i| libm::sin(i as f64) * 20.0 + 7.0).collect();
            let (low, width, counts) = bins(values.clone()).unwrap();
            assert_eq!(counts.iter().sum::<u64>(), n as u64);
            assert!(counts.len() <= 42, "{}", counts.len());
            assert!(values.iter().all(|v| *v >= low && *v <= low + width * counts.len() as f64 + 1e-9));
        }
        assert_eq!(bins(vec![3.0; 5]).unwrap().2, [5], "all alike are one bin");
        let far = bins(vec![0.0, 0.0, 0.0, 0.0, 1e6]).unwrap();
        assert!(far.2.len() <= 42, "an outlier makes bins wider, not more");
        assert!(bins(vec![f64::NAN]).is_none() && bins(Vec::new()).is_none());
    }
}
