//! Maps: a grid's arithmetic, its cells against single lanes, and what is known of the JRC's grids.

use crate::common::dice::cases;
use crate::common::lane_sets::run_case;
use crate::common::program::{json, ran, table};

use lanesweep::engine::{Start, Verdicts};
use lanesweep::prelude::*;
use lanesweep::run::grid::presets::{self, Presets};
use lanesweep::run::grid::{
    CaseQuantity, CellOutcome, Grid, GridAxis, GridMap, GridParts, GridPlan, MapGrids, MapParameter, boundary,
};

fn axis(category: Category, text: &str) -> GridAxis {
    GridAxis::parse(category, text, "--x").unwrap()
}

/// A grid of these axes (x, then y), panels and fixed values.
fn grid(category: Category, axes: &str, panels: &str, fixed: &str) -> Grid {
    let (x, y) = axes.split_once(' ').unwrap();
    let fixed = fixed.split_whitespace().map(|text| {
        let (key, number) = text.split_once('=').unwrap();
        (MapParameter::find(category, key, "--set").unwrap(), number.parse().unwrap())
    });
    let panel_axes = panels.split_whitespace().map(|text| axis(category, text)).collect();
    Grid::new(GridParts { panel_axes, fixed: fixed.collect(), ..parts(category, x, y) }).unwrap()
}

fn failed(map: &GridMap, model: usize) -> Vec<bool> {
    (0..map.cell_count()).map(|cell| map.verdicts(model, cell).failed(Criterion::Collision)).collect()
}

fn parts(category: Category, x: &str, y: &str) -> GridParts {
    GridParts::new(category.key(), category, axis(category, x), axis(category, y))
}

fn profile(name: &str) -> Profile {
    Profile::load(name).unwrap()
}

fn swept(plan: &GridPlan) -> GridMap {
    let backend = CpuBackend::lane_arithmetic();
    GridMap::sweep(plan, &Executor::new(&backend)).unwrap().0
}

fn mapped(grid: Grid, profile: &Profile, models: &[ModelId]) -> GridMap {
    swept(&GridPlan::new(grid, profile, models).unwrap())
}

#[test]
fn a_range_holds_its_ends_and_its_steps() {
    cases(200, |dice| {
        let [from, steps, step] = [dice.below(500), dice.below(200), 1 + dice.below(49)];
        let (from, step) = (from as f64 / 10.0, step as f64 / 10.0);
        let to = from + steps as f64 * step;
        let axis = axis(Category::CutIn, &format!("gap_m={from}..{to}/{step}"));
        assert_eq!((axis.len(), axis.values[0]), (steps + 1, from));
        assert!((axis.values[steps] - to).abs() < 1e-9);
        // Decimals, as they would be typed.
        assert!(axis.values.iter().all(|v| v.to_string().len() <= 6));
        let edges = axis.edges();
        assert_eq!(edges.len(), axis.len() + 1);
        assert!(axis.values.iter().enumerate().all(|(k, v)| edges[k] < *v && *v < edges[k + 1]));
    });
}

#[test]
fn a_cell_and_its_places_are_one_to_one() {
    cases(50, |dice| {
        let [nx, ny, egos, others] = [8, 6, 4, 3].map(|max| 1 + dice.below(max));
        let panels = format!("ego_speed_mps=21..{}/1 other_speed_mps=11..{}/1", 20 + egos, 10 + others);
        let grid = grid(Category::CutIn, &format!("gap_m=1..{nx}/1 lateral_speed_mps=1..{ny}/1"), &panels, "");
        assert_eq!(grid.cell_count(), nx * ny * egos * others);
        for cell in 0..grid.cell_count() {
            let (panel, i, j) = grid.places(cell);
            assert_eq!(grid.cell(panel, i, j), cell);
            let of = [CaseQuantity::Gap, CaseQuantity::LateralSpeed, CaseQuantity::EgoSpeed, CaseQuantity::OtherSpeed];
            let [ego, other] = grid.panels()[panel][..] else { panic!("two panel axes") };
            let values = [grid.x.values[i], grid.y.values[j], ego, other].map(Some);
            assert_eq!(of.map(|quantity| grid.point(cell).get(quantity)), values);
        }
    });
}

#[test]
fn a_boundary_has_a_line_between_two_neighbours_exactly_where_they_differ() {
    let grid = grid(Category::Lvd, "deceleration_mps2=1..6/1 ego_speed_mps=11..15/1", "", "thw_s=1");
    cases(200, |dice| {
        let kinds = dice.list([30, 30], |dice| dice.below(3));
        let kind = |i: usize, j: usize| kinds[j * 6 + i];
        let lines = boundary(&grid, &kind);
        let length: usize = lines.iter().map(|((a, b), (c, d))| (c - a) + (d - b)).sum();
        let across = (0..5).flat_map(|j| (1..6).map(move |i| (i, j))).filter(|&(i, j)| kind(i - 1, j) != kind(i, j));
        let up = (1..5).flat_map(|j| (0..6).map(move |i| (i, j))).filter(|&(i, j)| kind(i, j - 1) != kind(i, j));
        assert_eq!(length, across.count() + up.count());
    });
}

/// One lane of a cell by itself, in the lane arithmetic: the case, encoded alone, from its gap or headway.
fn alone(grid: &Grid, cell: usize, model: ModelId, profile: &Profile) -> Verdicts {
    let start: Start<f32> = match grid.point(cell).get(CaseQuantity::Thw) {
        Some(thw_s) => Headway::ThwS(thw_s).start(),
        None => Headway::GapM(grid.gap_m(cell, model, profile)).start(),
    };
    run_case(profile, &grid.case(cell, profile).unwrap(), model, start, &mut |_| ()).verdicts
}

#[test]
fn every_cell_is_the_lane_that_its_numbers_say() {
    let (cut_in, cut_out, lvd) = (Category::CutIn, Category::CutOut, Category::Lvd);
    let native =
        GridParts { native_gap: true, ..parts(lvd, "deceleration_mps2=5..10/0.5", "ego_speed_kmh=30..130/20") };
    for grid in [
        // The gap across, upwards, in the panels and fixed; headways likewise.
        grid(cut_in, "gap_m=2..50/4 lateral_speed_mps=0..1.5/0.3", "", "ego_speed_kmh=100 other_speed_kmh=60"),
        grid(cut_in, "lateral_speed_mps=0.3..1.5/0.3 thw_s=0.2..2/0.2", "ego_speed_mps=20,30", "other_speed_mps=15"),
        grid(cut_out, "ahead_gap_m=5..95/10 lateral_speed_mps=0.5..2/0.5", "gap_m=10,30", "ego_speed_kmh=100"),
        grid(lvd, "deceleration_mps2=1..9/1 ego_speed_kmh=30..130/20", "", "thw_s=0.8 end_speed_kmh=20"),
        Grid::new(native).unwrap(),
    ] {
        for name in ["paper", "jrc-2021", "un-r157"] {
            let profile = profile(name);
            let map = mapped(grid.clone(), &profile, &ModelId::ALL);
            for (at, &model) in ModelId::ALL.iter().enumerate() {
                for cell in 0..grid.cell_count() {
                    let (ours, single) = (map.verdicts(at, cell), alone(&grid, cell, model, &profile));
                    assert_eq!(ours, single, "{name}, {}, {:?}", model.name(), grid.values(cell));
                }
            }
        }
    }
}

#[test]
fn the_presets_have_the_size_of_the_evidence() {
    let jrc = profile("jrc-2021");
    let presets: Vec<_> = Category::ALL.into_iter().flat_map(|c| Presets::Jrc.of(c, &jrc).unwrap()).collect();
    let cells: Vec<usize> = presets.iter().map(|p| p.grid.cell_count()).collect();
    assert_eq!(cells, [15_930, 14_040, 6_762, 209]);
    // Of the models of the evidence: one that is added is mapped besides.
    let of_evidence = [ModelId::Reg157, ModelId::Cchdm, ModelId::Rss, ModelId::Fsm];
    let lanes = |preset: &presets::Preset| {
        let models: Vec<ModelId> = preset.models.iter().copied().filter(|m| of_evidence.contains(m)).collect();
        GridPlan::new(preset.grid.clone(), &jrc, &models).unwrap().lane_count()
    };
    assert_eq!(presets.iter().map(lanes).sum::<u64>(), 140_793);
}

/// The JRC's grids with every gap and lateral speed moved by much less than anything in them.
fn moved(grid: &Grid, gap_m: f64, lateral_mps: f64) -> Grid {
    let shifted = |axis: &GridAxis| {
        let by = match axis.parameter.quantity {
            CaseQuantity::Gap => gap_m,
            CaseQuantity::LateralSpeed => lateral_mps,
            _ => 0.0,
        };
        GridAxis { parameter: axis.parameter, values: axis.values.iter().map(|v| (v + by).max(0.0)).collect() }
    };
    Grid::new(GridParts {
        panel_axes: grid.panel_axes.to_vec(),
        fixed: grid.fixed.to_vec(),
        style: grid.style,
        native_gap: grid.native_gap,
        closing_only: grid.category == Category::CutIn,
        ..GridParts::new(&grid.name, grid.category, shifted(&grid.x), shifted(&grid.y))
    })
    .unwrap()
}

/// The grids are of round numbers, so that vehicles meet bumper to bumper at a step exactly, or are beside one another
/// exactly: there the rounding of a program decides, and two programs differ. What lies between the cells that fail
/// however the numbers are moved by 0.1 mm and 0.01 mm/s, and those that fail for some such move, cannot be told.
#[test]
fn crash_shares_of_the_jrc_are_known_as_far_as_rounding_does_not_decide() {
    let jrc = profile("jrc-2021");
    let mut compared = 0;
    for preset in [Category::CutIn, Category::Lvd].into_iter().flat_map(|c| Presets::Jrc.of(c, &jrc).unwrap()) {
        let plan = |grid: Grid| GridPlan::new(grid, &jrc, &preset.models).unwrap();
        let map = |grid: Grid| swept(&plan(grid));
        let nominal = map(preset.grid.clone());
        let moves = [(1e-4, 1e-5), (1e-4, -1e-5), (-1e-4, 1e-5), (-1e-4, -1e-5)];
        let moved: Vec<GridMap> = if preset.grid.native_gap {
            // A distance that depends on the speed is no axis: another arithmetic decides ties in another way.
            let backend = CpuBackend::reference();
            let executor = Executor::new(&backend);
            vec![GridMap::sweep(&plan(preset.grid.clone()), &executor).unwrap().0]
        } else {
            moves.iter().map(|&(gap, lateral)| map(moved(&preset.grid, gap, lateral))).collect()
        };
        for (at, &model) in preset.models.iter().enumerate() {
            let Some(known) = preset.known(model) else { continue };
            let of_moved: Vec<Vec<bool>> = moved.iter().map(|m| failed(m, at)).collect();
            let ours = failed(&nominal, at);
            let cells = || (0..ours.len()).map(|cell| (ours[cell], of_moved.iter().map(move |m| m[cell])));
            let always = cells().filter(|(ours, others)| *ours && others.clone().all(|f| f)).count();
            let ever = cells().filter(|(ours, others)| *ours || others.clone().any(|f| f)).count();
            let [always, ever] = [always, ever].map(|n| 100.0 * n as f64 / ours.len() as f64);
            let share = 100.0 * nominal.failures(at, Criterion::Collision) as f64 / ours.len() as f64;
            println!(
                "{:12} {:7} {share:6.2} %, known {known:4.1} %, rounding decides between {always:6.2} and {ever:6.2} %",
                preset.grid.name,
                model.name()
            );
            assert!((always - 0.05..ever + 0.05).contains(&known), "{} {}", preset.grid.name, model.name());
            assert!((share - known).abs() < 0.5, "{} {}", preset.grid.name, model.name());
            compared += 1;
        }
    }
    assert_eq!(compared, 11);
}

/// The page holds the cells of cells.csv in run lengths, for browsers that compute none.
fn assert_page(html: &str, rows: &[std::collections::BTreeMap<String, String>]) {
    assert!(html.len() < 500_000, "{} bytes", html.len());
    let (_, data) = html.split_once("id=\"explorer-data\">").unwrap();
    let data: serde_json::Value = serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap();
    let (grids, criterion) = (data["grids"].as_array().unwrap(), data["criterion"].as_str().unwrap());
    assert!(!grids.is_empty(), "the page has no maps");
    for grid in grids {
        let runs = grid["outcomes"][criterion].as_array().unwrap();
        for (model, runs) in grid["models"].as_array().unwrap().iter().zip(runs) {
            let words = runs.as_str().unwrap().split_inclusive(|c: char| c.is_ascii_lowercase()).flat_map(|run| {
                let (count, letter) = run.split_at(run.len() - 1);
                let word = data["outcomes"][usize::from(letter.as_bytes()[0] - b'a')]["label"].as_str().unwrap();
                std::iter::repeat_n(word, if count.is_empty() { 1 } else { count.parse().unwrap() })
            });
            let own = rows.iter().filter(|row| grid["name"] == *row["map"] && *model == *row["model"]);
            assert!(words.eq(own.map(|row| row["outcome"].as_str())), "{model}");
        }
    }
}

#[test]
fn a_cell_is_undecided_where_the_single_case_is() {
    use lanesweep::run::check::{Check, RunEnd, Subject};
    let speeds = "other_speed_kmh=30 ego_speed_kmh=60";
    let grid = grid(Category::CutIn, "gap_m=8..20/0.5 lateral_speed_mps=0.5..1.5/0.25", "", speeds);
    let profile = profile("un-r157");
    let options = MapOptions {
        grids: MapGrids::Own(Box::new(grid.clone())),
        models: Some(vec![ModelId::Cchdm]),
        criterion: Criterion::Collision,
        robust: true,
    };
    let map = Map::plan(options, &profile).unwrap();
    let result = map.run(&Executor::new(CpuBackend::lane_arithmetic())).unwrap();
    let map = &result.grids[0].map;
    for cell in 0..map.cell_count() {
        let point = grid.point(cell);
        let gap_m = point.get(CaseQuantity::Gap).unwrap();
        let subject = Subject::plain(&point.plain_case(Category::CutIn, &profile).unwrap(), Headway::GapM(gap_m));
        let check = Check { subject, profiles: vec![profile.clone()], models: vec![ModelId::Cchdm] };
        let judged = &check.run_without_boundaries().unwrap()[0];
        let flips = &judged.models[0].flips;
        assert_eq!(judged.verdicts.unreacting == RunEnd::Contact, map.is_conflict(0, cell), "cell {cell}");
        // A perturbation may change the driver's collision, or whether there is a conflict.
        let is_undecided = map.is_undecided(0, cell, Criterion::Collision);
        assert!(is_undecided || flips.is_empty(), "cell {cell}: {flips:?}");
        assert!(!is_undecided || !flips.is_empty() || !judged.flips.is_empty(), "cell {cell}: {:?}", judged.flips);
    }
    assert!(map.outcomes(0, Criterion::Collision)[CellOutcome::Undecided as usize] > 0);
}

/// Every preset: a cell without a conflict is one whose single case `check` answers with the same word, from the same gap.
#[test]
fn a_cell_without_a_conflict_is_a_case_without_one() {
    use lanesweep::run::check::{Answer, Check, Subject};
    let mut compared = [0; 2];
    for category in Category::ALL {
        let profile = profile("un-r157");
        for presets in Presets::ALL {
            for preset in presets.of(category, &profile).unwrap() {
                let models = [ModelId::Cchdm, ModelId::Fsm];
                let grid = preset.grid;
                let map = mapped(grid.clone(), &profile, &models);
                for (at, &model) in models.iter().enumerate() {
                    // A prime number of cells apart: all panels, gaps and speeds.
                    for cell in (0..grid.cell_count()).step_by(997) {
                        let point = grid.point(cell);
                        let plain = point.plain_case(category, &profile).unwrap();
                        let headway = Headway::GapM(grid.gap_m(cell, model, &profile));
                        let (subject, profiles) = (Subject::plain(&plain, headway), vec![profile.clone()]);
                        let check = Check { subject, profiles, models: vec![model] };
                        let judged = check.run_without_boundaries().unwrap().remove(0);
                        let outcome = map.outcome(at, cell, Criterion::Collision);
                        let is_no_conflict = judged.verdicts.answer() == Answer::NoConflict;
                        let says_so = matches!(outcome, CellOutcome::NoConflict | CellOutcome::FailByReaction);
                        assert_eq!(is_no_conflict, says_so, "{}, {:?}", grid.name, grid.values(cell));
                        if outcome == CellOutcome::NoConflict {
                            assert_eq!(outcome.label(), judged.verdicts.answer().label());
                        }
                        compared[usize::from(is_no_conflict)] += 1;
                    }
                }
            }
        }
    }
    assert!(compared.iter().all(|cases| *cases > 25), "{compared:?}");
}

/// Terminal, `map.json`, the sheet's legend and `cells.csv` count the same cells with the same words. Cells
/// of cut-outs without possible traffic count in no share.
#[test]
fn tables_files_and_legends_of_a_map_count_the_same_cells() {
    let dir = tempfile::tempdir().unwrap();
    // In the others the ego runs into a vehicle that stands or comes to a standstill.
    let cut_outs = "--x ahead_gap_m=5..95/5 --y lateral_speed_mps=0.25..2/0.25 --set ego_speed_kmh=100 --set gap_m=30";
    for (what, has_no_conflict) in [
        ("cut-in --preset r157", true),
        ("cut-out --preset r157", false),
        (&format!("cut-out {cut_outs} --robust"), false),
        ("lvd --preset jrc --criterion ttc --robust", false),
    ] {
        let stdout = ran(dir.path(), &format!("-q map {what} --models CCHDM,FSM --out ."));
        let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
        let record = json(&dir.path().join("map.json"));
        let rows = table(&dir.path().join("cells.csv"));
        if !has_no_conflict {
            assert_page(&read("report.html"), &rows);
        }
        // What is undecided counts as it was computed.
        if let Some(plain) = what.strip_suffix(" --robust") {
            ran(dir.path(), &format!("-q map {plain} --models CCHDM,FSM --out plain"));
            let failures = |of: &serde_json::Value| {
                of["grids"][0]["shares"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|share| share["failures"].clone())
                    .collect::<Vec<_>>()
            };
            assert_eq!(failures(&record), failures(&json(&dir.path().join("plain/map.json"))), "{what}");
        }
        let mut no_conflict = 0;
        for grid in record["grids"].as_array().unwrap() {
            let (name, all) = (grid["name"].as_str().unwrap(), grid["cells"].as_u64().unwrap());
            let possible = all - grid["drives_through"].as_u64().unwrap();
            let failures = grid["shares"].as_array().unwrap().iter().map(|share| share["failures"].as_u64().unwrap());
            match name {
                "cut_out_to_60" => assert_eq!((possible, failures.collect()), (1904, vec![0, 0])),
                "cut_out_to_130" => assert_eq!((possible, failures.collect()), (1923, vec![104, 265])),
                "cut_out" => {
                    assert!(possible < all && grid["shares"][1]["outcomes"]["undecided"].as_u64() > Some(0), "{grid}")
                }
                _ => assert_eq!(possible, all, "{what}"),
            }
            for share in grid["shares"].as_array().unwrap() {
                let model = share["model"].as_str().unwrap();
                let svg = read(&format!("figures/{name}_{}.svg", model.to_lowercase()));
                let line = stdout.lines().map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
                let words = line.clone().find(|words| words.contains(&"share %")).unwrap();
                let line = line.clone().find(|words| words.contains(&name) && words.contains(&model)).unwrap();
                let mut sum = 0;
                for (word, count) in share["outcomes"].as_object().unwrap() {
                    let count = count.as_u64().unwrap();
                    let in_file = rows
                        .iter()
                        .filter(|row| row["map"] == name && row["model"] == model && row["outcome"] == *word);
                    assert_eq!(in_file.count() as u64, count, "{what}, {name}, {model}: {word}");
                    let of = if word == "no such traffic" { all } else { possible };
                    let drawn = svg.contains(&format!(">{word}: {count} of {of}<"));
                    assert_eq!(drawn, count > 0, "{what}, {name}, {model}: {word}");
                    let at = words.iter().position(|other| other == word).expect(word);
                    assert_eq!(line[at].replace(',', ""), count.to_string(), "{what}, {name}, {model}: {word}");
                    sum += count;
                    no_conflict += if word == "no conflict" { count } else { 0 };
                }
                assert_eq!(sum, all, "{what}, {name}, {model}");
                assert_eq!(share["share"], share["failures"].as_u64().unwrap() as f64 / possible as f64);
                // Dashes and their words are on the same sheets.
                let words = svg.contains("around what is not preventable");
                assert_eq!(words, svg.contains("class=\"not-preventable\""), "{what}, {name}, {model}");
            }
        }
        assert_eq!(no_conflict > 0, has_no_conflict, "{what}: {no_conflict}");
    }
}

/// How many verdicts of the JRC's grids differ from `jrc-2021`, while the options of `un-r157` become those of `jrc-2021`
/// one after another. docs/src/for-assessors.md names it: run it with `--nocapture`.
#[test]
fn named_options_explain_every_cell_between_the_readings() {
    let (mut reading, jrc) = (profile("un-r157"), profile("jrc-2021"));
    let collisions = |profile: &Profile| -> Vec<Vec<bool>> {
        let maps = Category::ALL.map(|category| {
            let presets = Presets::Jrc.of(category, profile).unwrap();
            let of = |preset: presets::Preset| {
                let map = mapped(preset.grid, profile, &ModelId::ALL);
                (0..ModelId::ALL.len()).flat_map(|model| failed(&map, model)).collect::<Vec<_>>()
            };
            presets.into_iter().flat_map(of).collect()
        });
        maps.to_vec()
    };
    let goal = collisions(&jrc);
    let row = |what: &str, profile: &Profile| -> usize {
        let ours = collisions(profile);
        let pairs = ours.iter().zip(&goal).map(|(ours, theirs)| ours.iter().zip(theirs));
        let differing: Vec<usize> = pairs.map(|pairs| pairs.filter(|(a, b)| a != b).count()).collect();
        println!("| {what} | {} | {} | {} |", differing[0], differing[1], differing[2]);
        differing.iter().sum()
    };
    let total: usize = goal.iter().map(Vec::len).sum();
    println!("verdicts: {:?} of {total}", goal.iter().map(Vec::len).collect::<Vec<_>>());
    row("`un-r157`", &reading);
    macro_rules! step {
        ($what:literal, $($table:ident.$key:ident)+) => {{
            $(
                assert_ne!(reading.$table.$key, jrc.$table.$key, "{}.{}", stringify!($table), stringify!($key));
                reading.$table.$key = jrc.$table.$key.clone();
            )+
            row($what, &reading)
        }};
    }
    step!("`reg157.margin_steps`, `margin_s`", reg157.margin_s reg157.margin_steps);
    step!(
        "`reg157.visible_lateral_movement_s`, `lane_intrusion_m`",
        reg157.visible_lateral_movement_s reg157.lane_intrusion_m
    );
    step!("`ttc_only_while_closing`", reg157.ttc_only_while_closing cchdm.ttc_only_while_closing);
    step!("`reg157.always_unsafe`", reg157.always_unsafe);
    step!("`cchdm.perception_time_s`", cchdm.perception_time_s);
    step!("`cchdm.wandering_m`, `lateral_gate_m`", cchdm.wandering_m cchdm.lateral_gate_m);
    step!("`cchdm.cut_in_braking`", cchdm.cut_in_braking);
    step!(
        "`cchdm.cut_out_headway_s`, its tolerance, `always_unsafe`",
        cchdm.cut_out_headway_s cchdm.cut_out_headway_tolerance_m cchdm.always_unsafe
    );
    step!("`cchdm.lead_deceleration_trigger_mps2`", cchdm.lead_deceleration_trigger_mps2);
    step!("`fsm.cfs_step`", fsm.cfs_step);
    step!("`frame.cut_out_target`", frame.cut_out_target);
    step!("`frame.dt_s`", frame.dt_s);
    step!("`frame.end_when_settled`, `time_cap_s`", frame.end_when_settled frame.time_cap_s);
    step!("`frame.start_shift` (with it the JRC's cases and starts)", frame.start_shift);
    assert_eq!(step!("`criteria.gate`", criteria.gate), 0, "nothing else tells the readings apart");
    (reading.name, reading.description, reading.reg157.clause) =
        (jrc.name.clone(), jrc.description.clone(), jrc.reg157.clause.clone());
    assert_eq!(reading, jrc, "every difference is a named option");
}
