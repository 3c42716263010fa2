//! How the parameters of mined scenarios are distributed, as a figure.

use super::panels::{Mark, Panel, PanelFigure, PanelSeries};
use crate::run::study::ParameterHistogram;
use crate::scenario::Category;

/// The histograms as a figure.
pub fn distributions(category: Category, histograms: &[ParameterHistogram], data: &str) -> PanelFigure {
    let panel = |histogram: &ParameterHistogram| {
        let middle = |k: usize| histogram.low + (k as f64 + 0.5) * histogram.width;
        let values = histogram.counts.iter().enumerate().map(|(k, count)| (middle(k), *count as f64)).collect();
        let mark = Mark::Bars(histogram.width);
        Panel {
            heading: histogram.name.clone(),
            x: histogram.unit.clone(),
            y: "scenarios".to_owned(),
            series: vec![PanelSeries { name: String::new(), mark, values, labels: Vec::new() }],
            ..Panel::default()
        }
    };
    PanelFigure {
        title: format!("{}: parameters of the mined scenarios", category.label()),
        subtitle: Some(data.to_owned()),
        caption: "Scenarios that passed the filters; bins about as wide as the rule of Freedman and Diaconis has \
                  them, at plain numbers."
            .to_owned(),
        panels: histograms.iter().map(panel).collect(),
    }
}
