//! `--dry-run`: number of lanes, memory and time; nothing is written.

use super::Exit;
use super::console::with_flags;
use super::format::FormatFlag;
use crate::Result;
use crate::report::records::document;
use crate::run::forecast::{ForecastPart, RunForecast};
use crate::support::readable::{count, value};

/// Forecast of a run.
pub(super) struct DryRun {
    pub run: RunForecast,
    pub backend: String,
    /// Duration of reading, mining and planning, s; the run repeats them.
    pub before_s: Option<f64>,
}

impl DryRun {
    /// Prints the forecast.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if standard output cannot be written to.
    pub fn print(&self, format: FormatFlag) -> Result<Exit> {
        format.print(|| self.text(peak_bytes()), || self.json(peak_bytes()))?;
        Ok(Exit::Ok)
    }

    fn json(&self, now: Option<u64>) -> Result<String> {
        let part = |ForecastPart { of, what, units, lanes }: &ForecastPart| serde_json::json!({"of": of, "what": what, "units": units, "lanes": lanes});
        document(&serde_json::json!({
            "data": self.run.data,
            "lanes": self.run.parts.iter().map(|part| part.lanes).fold(0, u64::saturating_add),
            "at_most": self.run.is_at_most,
            "parts": self.run.parts.iter().map(part).collect::<Vec<_>>(),
            "peak_bytes": now.map(|now| now + self.run.more_bytes),
            "lanes_s": self.run.lanes.as_ref().map(|forecast| forecast.seconds),
            "measured_lanes": self.run.lanes.as_ref().map(|forecast| forecast.measured_lanes),
            "before_s": self.before_s,
            "backend": self.backend,
        }))
    }

    fn text(&self, now: Option<u64>) -> String {
        let mut text = format!("Dry run: nothing is written.\nData    {}\n", self.run.data);
        let lanes: u64 = self.run.parts.iter().map(|part| part.lanes).fold(0, u64::saturating_add);
        let at_most = if self.run.is_at_most { "at most " } else { "" };
        text += &format!("Lanes   {at_most}{}\n", count(lanes));
        let wide = |of: &dyn Fn(&ForecastPart) -> usize| self.run.parts.iter().map(of).max().unwrap_or(0);
        let (a, b) = (wide(&|part| part.of.chars().count()), wide(&|part| part.what.chars().count()));
        let c = wide(&|part| count(part.units).len());
        let d = wide(&|part| count(part.lanes).len());
        for ForecastPart { of, what, units, lanes } in &self.run.parts {
            let (count, lanes) = (count(*units), count(*lanes));
            text += &format!("        {of:a$}  {what:b$}  {count:>c$} {}  {lanes:>d$} lanes\n", self.run.units);
        }
        let more = size(self.run.more_bytes);
        text += &match now {
            Some(now) => format!(
                "Memory  about {} at the peak: {} resident so far (with the plan and some of its lanes run), {more} for {}\n",
                size(now + self.run.more_bytes),
                size(now),
                self.run.more
            ),
            None => format!("Memory  {more} for {}, beside the program and the plan\n", self.run.more),
        };
        text += &match &self.run.lanes {
            Some(forecast) => format!(
                "Time    {at_most}{} for the lanes, from {} of them run just now ({:.3} \u{b5}s each): an estimate, on this \
                 machine as it is loaded now\n        on {}\n",
                time(forecast.seconds),
                count(forecast.measured_lanes),
                1e6 * forecast.seconds / forecast.lanes.max(1) as f64,
                self.backend
            ),
            None => format!(
                "Time    not estimated: each step of this estimator follows from the last\n        on {}\n",
                self.backend
            ),
        };
        if let Some(seconds) = self.before_s {
            text += &format!("        reading, mining and planning took {}, and will again\n", time(seconds));
        }
        if !self.run.besides.is_empty() {
            text += &format!("        not counted: {}\n", with_flags(self.run.besides));
        }
        text
    }
}

fn size(bytes: u64) -> String {
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    match mebibytes {
        m if m < 10.0 => format!("{m:.1} MiB"),
        m if m < 10_240.0 => format!("{m:.0} MiB"),
        m => format!("{} GiB", value(m / 1024.0)),
    }
}

pub(super) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.2} s"),
        s if s < 600.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{} days", value(s / 86_400.0)),
    }
}

/// Peak resident memory of this process, bytes, if the system reports it (Linux).
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_a_person_writes_them() {
        assert_eq!([0.3, 61.0, 900.0, 36_000.0].map(time), ["0.30 s", "61 s", "15 min", "10.0 h"]);
        assert_eq!([1 << 20, 200 << 20, 20 << 30].map(size), ["1.0 MiB", "200 MiB", "20 GiB"]);
    }
}
