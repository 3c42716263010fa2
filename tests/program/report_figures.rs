//! Sample figures of every kind, for looking at: what a test cannot see is whether a picture is clear.

use lanesweep::report::convergence::{ConvergenceFigure, ConvergencePoint, ConvergenceSeries};
use lanesweep::report::failure_map::{FailureMap, MapAxis};
use lanesweep::report::forest::{ForestFigure, ForestGroup, ForestRow};
use lanesweep::report::plot::AxisScale;
use std::path::PathBuf;

const MODELS: [&str; 4] = ["Reg157", "RSS", "CC human driver", "FSM"];
const CRITERIA: [&str; 3] = ["Collision", "TTC", "BTN"];

fn estimate(samples: u64, truth: f64, wave: f64) -> ConvergencePoint {
    let n = samples as f64;
    let probability = ((truth + 1.3 * wave.sin() * (truth / n).sqrt()) * n).round().max(0.0) / n;
    let half = 1.96 * (probability.max(1.0 / n) / n).sqrt();
    ConvergencePoint {
        samples,
        probability,
        lower: (probability - half).max(0.0),
        upper: probability + half,
        outer: Some((0.6 * probability, 1.7 * probability)),
        failing_scenarios: Some(6.0 + n.log10()),
    }
}

fn convergence(panels: &[&str], names: &[&str], points: u32, truth: f64) -> ConvergenceFigure {
    let mut series = Vec::new();
    for (m, panel) in panels.iter().enumerate() {
        for (c, name) in names.iter().enumerate() {
            let truth = truth * 10_f64.powi(-(m as i32)) * 2_f64.powi(c as i32);
            let samples = |k: u32| 10_f64.powf(2.0 + 5.0 * f64::from(k) / f64::from(points)).round() as u64;
            let points = (0..points).map(|k| estimate(samples(k), truth, f64::from(k) + (m * 3 + c) as f64)).collect();
            series.push(ConvergenceSeries { panel: (*panel).into(), name: (*name).into(), points });
        }
    }
    let subtitle = Some("SYNTHETIC DATA; Monte Carlo from the density, 95 % intervals".into());
    ConvergenceFigure { title: "Cut-in: how the failure probability settles".into(), subtitle, level: 0.95, series }
}

fn map(nx: usize, ny: usize, count: impl Fn(usize, usize) -> (u64, u64)) -> FailureMap {
    let edges = |n: usize, low: f64, high: f64| (0..=n).map(|k| low + (high - low) * k as f64 / n as f64).collect();
    let counts: Vec<_> = (0..nx * ny).map(|c| count(c % nx, c / nx)).collect();
    FailureMap {
        title: "Cut-in: where RSS collides".into(),
        subtitle: Some("SYNTHETIC DATA; 100 000 scenarios from the density".into()),
        x: MapAxis { name: "initial gap".into(), unit: "m".into(), edges: edges(nx, 0.0, 60.0) },
        y: MapAxis { name: "ego speed less lead speed".into(), unit: "m/s".into(), edges: edges(ny, -5.0, 17.5) },
        samples: counts.iter().map(|c| c.0).collect(),
        failures: counts.iter().map(|c| c.1).collect(),
    }
}

fn hill(nx: usize, ny: usize) -> FailureMap {
    map(nx, ny, |i, j| {
        let (x, y) = ((i as f64 + 0.5) / nx as f64, (j as f64 + 0.5) / ny as f64);
        let samples = (400.0 * (-((x - 0.5) / 0.22).powi(2) - ((y - 0.4) / 0.25).powi(2)).exp()) as u64;
        (samples, (samples as f64 * (1.6 * y - 2.5 * x).clamp(0.0, 0.9)) as u64)
    })
}

fn row(name: &str, estimate: Option<f64>, spread: f64) -> ForestRow {
    let middle = estimate.unwrap_or(f64::NAN);
    ForestRow {
        name: name.into(),
        estimate,
        lower: middle / spread,
        upper: middle * spread,
        outer: Some((middle / spread / spread, middle * spread * spread)),
        failing_scenarios: Some(if spread > 1.4 { 7 } else { 20 }),
    }
}

fn forest(scale: AxisScale, groups: usize, rows: usize) -> ForestFigure {
    let groups = (0..groups).map(|g| {
        let middle = 2e-4 / 4_f64.powi(g as i32);
        let mut list: Vec<_> = (0..rows)
            .map(|k| row(&format!("parameterization {}", k + 1), Some(middle * (1.0 + 0.3 * (k as f64).sin())), 1.5))
            .collect();
        list.push(row("importance sampling from a mixture fitted to the failures", None, 1.0));
        list.push(ForestRow { name: "plain".into(), estimate: Some(0.0), upper: middle, ..ForestRow::default() });
        ForestGroup {
            name: format!("{} Collision", MODELS[g % 4]),
            reference: Some(row("recorded scenarios", Some(middle), 1.3)),
            rows: list,
        }
    });
    ForestFigure {
        title: "Failure rates by method".into(),
        subtitle: Some("SYNTHETIC DATA; 95 % intervals".into()),
        axis: "Failures per hour (1/h)".into(),
        scale,
        intervals: "Line: 95 % interval over the draws; thin: over draws and scenarios.".into(),
        groups: groups.collect(),
    }
}

/// `FIGURES_OUT=folder cargo test --release --test program report_figures:: -- --ignored` writes the samples to `folder`.
#[test]
#[ignore = "writes pictures for looking at"]
fn samples_of_every_figure() {
    let folder = std::env::var_os("FIGURES_OUT").map_or(PathBuf::from(env!("CARGO_TARGET_TMPDIR")), PathBuf::from);
    std::fs::create_dir_all(&folder).unwrap();
    let long = "a very long name of a driver model with all its settings ".repeat(4);
    let endless = "x".repeat(150);
    let mut one_point = convergence(&["RSS"], &["Collision"], 1, 0.3);
    one_point.series.push(ConvergenceSeries { panel: "RSS".into(), name: "TTC".into(), points: vec![] });
    let convergences = [
        ("twelve", convergence(&MODELS, &CRITERIA, 20, 2e-2)),
        ("one_panel", convergence(&[""], &CRITERIA, 25, 4e-4)),
        ("six_panels", convergence(&["A", "B", "C", "D", &long, &endless], &CRITERIA[..2], 12, 3e-2)),
        ("one_panel_of_twelve", convergence(&["All"], &["a", "b", "c", "d", "e", "f", "g", "h"], 200, 1e-3)),
        ("one_point", one_point),
        ("zero", convergence(&MODELS[..2], &CRITERIA[..1], 8, 0.0)),
    ];
    let mut sparse = hill(20, 9);
    sparse.failures[0] = 5;
    sparse.x.name = long.clone();
    sparse.y.name = long.clone();
    let maps = [
        ("hill", hill(24, 18)),
        ("fine", hill(100, 80)),
        ("sparse", sparse),
        ("zero", map(6, 6, |i, _| (3 * i as u64, 0))),
        ("one_cell", map(1, 1, |_, _| (40, 12))),
        ("wrong", map(0, 1, |_, _| (0, 0))),
    ];
    let mut named = forest(AxisScale::Logarithmic, 2, 2);
    named.groups[0].name = long.clone();
    named.groups[1].rows[0].name = endless;
    named.axis = long;
    let forests = [
        ("logarithmic", forest(AxisScale::Logarithmic, 4, 4)),
        ("linear", forest(AxisScale::Linear, 2, 4)),
        ("hundred", forest(AxisScale::Logarithmic, 1, 100)),
        ("long_names", named),
        ("empty", forest(AxisScale::Linear, 0, 0)),
    ];
    let files = convergences.iter().map(|(name, f)| (format!("convergence_{name}.svg"), f.figure().svg()));
    let files = files.chain(maps.iter().map(|(name, f)| (format!("map_{name}.svg"), f.figure().svg())));
    for (name, svg) in files.chain(forests.iter().map(|(name, f)| (format!("forest_{name}.svg"), f.figure().svg()))) {
        std::fs::write(folder.join(name), svg).unwrap();
    }
    println!("figures written to {}", folder.display());
}
