//! The page of a run: whole, readable and small, however little or much the run has to say.

use std::path::{Path, PathBuf};

use lanesweep::prelude::*;

use crate::common::mined::{kept, scenarios_of, write_cut_in_density};
use crate::common::program::ran;
use crate::runs::parts::whole;

fn quietly(dir: &Path, line: &str) {
    ran(dir, &format!("-q {line}"));
}

/// The page in a folder, after what holds of every page.
fn page(dir: &Path) -> String {
    let html = std::fs::read_to_string(dir.join("report.html")).unwrap();
    assert!(html.len() < 1_000_000, "{} bytes", html.len());
    let (mut open, mut ids) = (Vec::new(), Vec::new());
    let without = |html: &str, element: &str| {
        let (before, rest) = html.split_once(element)?;
        let (inside, after) = rest.split_once("</script>").unwrap();
        Some((format!("{before}{after}"), inside.to_owned()))
    };
    // A map's page has data for its script.
    let data = without(&html, "<script type=\"application/json\" id=\"explorer-data\">");
    data.iter().for_each(|(_, data)| assert!(serde_json::from_str::<serde_json::Value>(data).is_ok()));
    let html = data.map_or(html, |(html, _)| html);
    let (content, script) = without(&html, "<script>").unwrap();
    for part in content.split('<').skip(1) {
        let Some((tag, _)) = part.split_once('>') else { panic!("`<{part}` has no end") };
        let name = tag.split_whitespace().next().unwrap();
        if let Some((_, id)) = tag.split_once(" id=\"") {
            ids.push(id.split('"').next().unwrap());
        }
        match name.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name), "in {tag}"),
            None if name.starts_with('!') || tag.ends_with('/') || ["meta", "link", "br"].contains(&name) => {}
            None => open.push(name),
        }
    }
    assert!(open.is_empty(), "{open:?} are not closed");
    let mut distinct = ids.clone();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), ids.len(), "anchors of the same name");
    for anchor in html.split("href=\"#").skip(1).map(|rest| rest.split('"').next().unwrap()) {
        assert!(ids.contains(&anchor), "{anchor} leads nowhere");
    }
    let local = html.replace("http://www.w3.org/2000/svg", "");
    for outside in ["http:", "https:", "@import", "url(", "src=", "fetch", "import("] {
        assert!(!local.contains(outside), "{outside}");
    }
    assert!(["<script", "</script", "<!--"].iter().all(|end| !script.contains(end)), "it ends where it ends");
    assert!(!content.contains("NaN") && !content.contains(">inf<") && !content.contains("<script"));
    html
}

fn study(dir: &Path, name: &str, scenarios: &[Scenario]) -> (PathBuf, String) {
    write_scenarios(&dir.join("some.jsonl"), scenarios).unwrap();
    quietly(dir, &format!("study --scenarios some.jsonl --backend cpu --out {name}"));
    let out = dir.join(name);
    let html = page(&out);
    (out, html)
}

#[test]
fn a_study_says_everything_on_its_page_and_every_figure_has_its_files() {
    let (out, _) = whole();
    let html = page(out);
    let plan = "<dt>SHA-256 of the plan</dt>";
    for said in ["SYNTHETIC DATA", "Failed simulations of S", "published", plan, "seed", "Claims"] {
        assert!(html.contains(said), "{said}");
    }
    for figure in ["f1", "radar"] {
        for category in ["cut-in", "cut-out", "lvd"] {
            let name = format!("figures/{figure}-{category}.svg");
            assert!(html.contains(&format!("<code>{name}</code>")), "{name}");
        }
    }
    let files: Vec<&str> = html.split("<code>").skip(1).map(|rest| rest.split('<').next().unwrap()).collect();
    assert!(files.len() >= 12);
    assert!(html.matches("<details>").count() > 6, "all but the answer is folded");
    for file in files {
        assert!(std::fs::metadata(out.join(file)).unwrap().len() > 0, "{file}");
    }
    assert_eq!(html.matches("<svg").count(), 6);
}

#[test]
fn little_data_makes_a_readable_page_too() {
    let dir = tempfile::tempdir().unwrap();
    let of = |category| kept(scenarios_of(2), category).into_iter().cloned().collect::<Vec<_>>();
    // One scenario: too few for a decomposition; nothing of the other categories.
    let (out, html) = study(dir.path(), "one", &of(Category::CutIn)[..1]);
    assert!(html.contains("cut-in: agreement") && !html.contains("LVD: agreement"));
    assert!(out.join("figures/f1-cut-in.svg").exists());
    // Where nothing fails F1 is undefined, and said to be.
    assert!(html.contains("<td>-</td>"), "an undefined F1 has a dash");
    // None of one category.
    let (out, html) = study(dir.path(), "two", &[of(Category::CutIn), of(Category::Lvd)].concat());
    assert!(html.contains("LVD: agreement") && !html.contains("cut-out: agreement"));
    assert!(!out.join("figures/radar-cut-out.svg").exists());
}

#[test]
fn sampling_runs_maps_and_comparisons_have_their_page() {
    let dir = &*crate::common::folder();
    write_cut_in_density(&dir.join("d.json"));
    let sample = "sample d.json --backend cpu --samples 3000";
    quietly(dir, &format!("{sample} --thw 1,0.6,0.2 --out mc"));
    let html = page(&dir.join("mc"));
    for said in ["<dt>SHA-256 of the density</dt>", "usable"] {
        assert!(html.contains(said), "{said}");
    }
    quietly(dir, &format!("{sample} --estimator is --thw 0.2 --models RSS --out is"));
    assert!(page(&dir.join("is")).contains("effective failures"));
    let case = "--set ego_speed_kmh=90 --set other_speed_kmh=50";
    quietly(dir, &format!("map cut-in --x gap_m=5..60/5 --y lateral_speed_mps=0.2..1.8/0.4 {case} --out map"));
    let html = page(&dir.join("map"));
    for said in ["id=\"ex-map\"", "Cells that fail Collision under"] {
        assert!(html.contains(said), "{said}");
    }
}
