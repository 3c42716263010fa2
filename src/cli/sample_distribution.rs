//! `lanesweep sample --distribution`: samples random parameters of an OpenSCENARIO file as lanes.

use std::fmt::Write;
use std::path::Path;

use super::configured::Configured;
use super::console::Total;
use super::sample::Sample;
use super::sample_options::only_crude;
use super::{Exit, Output};
use crate::cli::settings::EstimatorKind;
use crate::engine::Headway;
use crate::report::openscenario::{DistributionSamples, SampledFile};
use crate::report::sampling::{DensityRecord, DrawRecord, SampleReport};
use crate::report::sampling_tables::convergence_csv;
use crate::run::reopen::DISTRIBUTION_FILE;
use crate::run::sampling::{Estimator, SampleHeadways, SampleOptions, SampleSource, WorstLane, sample_crude};
use crate::scenario::Category;
use crate::stats::density::Provenance;
use crate::support::plain_text::sha256;
use crate::support::plausibility::Doubts;
use crate::support::readable;
use crate::support::run_folder::{ESTIMATE_RECORD, RunFolder};
use crate::{Error, Place, Result};

/// A smaller fraction is shown as 0.
const NOTHING: f64 = 5e-6;

/// A range that keeps less of its distribution is rather a mistake.
const FEW: f64 = 1e-3;

/// Samples the distributions of a file.
pub(super) fn run(flags: &Sample, configured: &Configured, path: &Path) -> Result<Output> {
    let settings = &flags.settings;
    if settings.estimator == EstimatorKind::Is {
        return Err(only_crude("--distribution"));
    }
    if settings.points == SampleSource::Sobol {
        let help = "leave it out: draws of a distribution file are independent";
        return Err(Error::usage(
            Place::item("sample.points"),
            "Sobol points are not available for a distribution file",
            help,
        ));
    }
    let category = Category::named(flags.category.as_deref().unwrap_or_default(), Place::item("--category"))?;
    let sampled = SampledFile::read(path, category, &flags.rename, &flags.set)?;
    let samples = sampled.samples()?;
    samples.ignored_texts.iter().for_each(|ignored| tracing::warn!("{ignored}"));
    for p in samples.parameters.iter().filter(|p| p.range_fraction < FEW) {
        tracing::warn!(
            "the Range of {} keeps {} of its distribution: check the units of both",
            p.parameter.key,
            readable::value(p.range_fraction)
        );
    }
    check_plausible(&samples, Doubts::new(flags.plausibility.policy()))?;
    for p in samples.parameters.iter().filter(|p| 1.0 - p.kept_fraction > NOTHING) {
        tracing::warn!(
            "{:.3} % of the distribution of {} are outside {} … {} {} and are not drawn",
            100.0 * (1.0 - p.kept_fraction),
            p.parameter.key,
            readable::value(p.parameter.min),
            readable::value(p.parameter.max),
            p.parameter.unit
        );
    }
    let listed = flags.listed_headways()?;
    if listed.is_some() && samples.has_distance() {
        let problem = "the initial distance is a parameter already";
        return Err(Error::usage(Place::item("--thw"), problem, "leave out --thw"));
    }
    let headways = listed.unwrap_or_else(Headway::paper);
    let (profile, models, criterion) = (configured.profile()?, flags.models()?, settings.criterion);
    let of_file = samples.seed.filter(|_| !configured.is_set("sample.seed"));
    let seed = of_file.unwrap_or(settings.seed);
    let count = settings.samples.unwrap_or(samples.runs);
    let opened = configured.open()?;
    let folder = RunFolder::open(&flags.out, ESTIMATE_RECORD)?;
    let (plan, tries) = samples.plan((count, seed), &profile, &models, &headways)?;
    let executor = opened.executor().with_recheck(seed);
    let headways = match samples.has_distance() {
        true => SampleHeadways::Sampled,
        false => SampleHeadways::Each(plan.headways.clone()),
    };
    let options = SampleOptions {
        stop: flags.stop(count),
        models,
        criterion,
        seed,
        level: settings.level,
        worst: settings.worst,
        ..SampleOptions::new(Estimator::Crude { interval: flags.interval() }, count, headways)
    };
    let options = if flags.simultaneous { options.together(settings.level) } else { options };
    tracing::info!("{} samples on {}", readable::count(count), executor.backend.describe());
    // The frequency of such scenarios is unknown, so there is no exposure.
    let crude = configured.with_progress(Total::Exact(count), "sampling", &executor, |executor| {
        sample_crude(&plan, 0..count, executor, &options, None, None)
    })?;
    let host = configured.host(&opened, crude.summary.rechecked_lanes, false);
    let record = record(&sampled, &samples);
    let mut report = SampleReport::of(record, samples.has_distance(), (&profile, &options), crude.rows.clone(), host);
    report.plan_headways = plan.headways.clone();
    report.plan_sha256 = Some(plan.hash().to_owned());
    let mut draws = DrawRecord::of(&crude.tally, &plan);
    if draws.samples == count {
        draws.tries = tries;
        draws.rejected_share = (tries - count) as f64 / tries as f64;
    }
    report.draws = Some(draws);
    let mut results = folder.results()?;
    results.add("convergence.csv", convergence_csv(&crude.convergence).as_bytes())?;
    let names: Vec<String> = samples.parameters.iter().map(|p| p.parameter.key.to_owned()).collect();
    let worst = WorstLane::of_tally(&plan, &crude.tally, |key| {
        let point = samples.draw(seed, key.unit, &plan.profile)?.values;
        Ok((point, samples.has_distance().then(|| "sampled".to_owned())))
    })?;
    report.add_worst(&mut results, &worst, &names)?;
    results.add(DISTRIBUTION_FILE, &sampled.to_json()?)?;
    let files = report.publish(results, Vec::new())?;
    flags.format.output_in(&flags.out, Exit::Ok, || report.text(), || report.json(&files))
}

/// Checks the fixed values and the quartiles of the distributions; the tails are truncated anyway.
fn check_plausible(samples: &DistributionSamples, mut doubts: Doubts) -> Result<()> {
    for (parameter, value) in &samples.fixed {
        parameter.check_plausible(*value, &mut doubts)?;
    }
    for p in &samples.parameters {
        for share in [0.25, 0.75] {
            p.parameter.check_plausible(p.draw.value(share) * p.factor, &mut doubts)?;
        }
    }
    doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
    Ok(())
}

fn record(sampled: &SampledFile, samples: &DistributionSamples) -> DensityRecord {
    let mut data = sampled.data();
    for (parameter, value) in &samples.fixed {
        let _ = write!(data, ", {} = {value}", parameter.key);
    }
    let sha = sha256(&sampled.text);
    DensityRecord {
        sha256: sha.clone(),
        category: sampled.category,
        parameterization: "distribution".to_owned(),
        parameters: samples.parameters.iter().map(|p| p.parameter.key.to_owned()).collect(),
        kernels: 0,
        form: None,
        provenance: Provenance {
            program: format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
            data,
            synthetic: false,
            scenarios_sha256: sha,
            found: 0,
            kept: 0,
            left_out: 0,
        },
    }
}
