//! How help is laid out: verbs by what people want, flags by what they are about. `-h` fits on one screen; flags that
//! are seldom used are told by `--help` alone.

use clap::{Arg, ArgAction, Command};

/// Verbs by what people want.
const VERBS: [(&str, &[&str]); 5] = [
    ("Study a data set", &["study", "mine", "compare", "justify"]),
    ("Probabilities", &["fit", "sample"]),
    ("Single cases and grids", &["check", "simulate", "map", "export"]),
    ("More machines", &["cluster"]),
    ("Tools", &["verify", "config", "synth"]),
];

/// A heading, the flags below it by their ids, and those that only `--help` tells.
type Group = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Headings of flags, in order. The same flag stands below the same heading in every verb.
const FLAGS: [Group; 5] = [
    (
        "Data",
        &[
            "dir",
            "density",
            "study",
            "run",
            "tables",
            "file",
            "of",
            "shell",
            "scenarios",
            "distribution",
            "from",
            "lane",
            "case_file",
            "table",
            "row",
            "scenario",
            "hours",
            "km",
            "proposal",
            "kept",
            "golden_lanes",
        ],
        &["accept_implausible", "synth_recordings"],
    ),
    (
        "Scenario",
        &[
            "category",
            "categories",
            "parameterizations",
            "parameterization",
            "with_thw",
            "preset",
            "x",
            "y",
            "panel",
            "ego_speed",
            "speed",
            "gap",
            "thw",
            "lateral_speed",
            "acceleration",
            "ahead_speed",
            "ahead_gap",
            "given",
            "compare",
            "variant",
        ],
        &[
            "lateral_distance",
            "end_speed",
            "length",
            "width",
            "rename",
            "set",
            "closing",
            "native_gap",
            "side",
            "lane_width",
            "ego",
            "duration",
        ],
    ),
    (
        "Models and criteria",
        &[
            "models",
            "criterion",
            "against",
            "robust",
            "profile",
            "profiles",
            "estimator",
            "samples",
            "half_width",
            "random_lanes",
        ],
        &[
            "dt",
            "points",
            "interval",
            "level",
            "time_limit",
            "reference",
            "compare_reference",
            "bandwidth_rule",
            "no_comparison",
            "without_scenarios",
            "published",
            "threshold_units",
        ],
    ),
    (
        "Output",
        &["out", "rows", "map", "worst", "plot", "sheet", "series", "format", "changed", "scripts"],
        &["plot_end", "keep_plan", "author", "date"],
    ),
    (
        "Run",
        &[
            "array",
            "time",
            "gpus",
            "cpus",
            "mem",
            "partition",
            "account",
            "backend",
            "device",
            "seed",
            "shard",
            "dry_run",
            "no_self_check",
            "config",
            "help",
            "version",
        ],
        &["plan", "plan_only", "stop_after", "qos", "signal_before", "program", "threads", "quiet", "verbose"],
    ),
];

/// Flags that are seldom used, but by this verb.
const OFTEN: [(&str, &[&str]); 4] = [
    ("synth", &["synth_recordings"]),
    ("study", &["published", "reference"]),
    ("map", &["set", "rename"]),
    ("xosc", &["ego"]),
];

/// Flags that this verb uses seldom.
const SELDOM: [(&str, &[&str]); 4] = [
    ("sample", &["category", "worst"]),
    ("simulate", &["ahead_speed"]),
    ("check", &["ahead_speed"]),
    ("xosc", &["ahead_speed", "variant"]),
];

/// The command with its help laid out.
pub(super) fn laid_out(command: Command) -> Command {
    let flags = root_flags();
    let command = with_groups(command, "");
    let mut text = String::from("{about-with-newline}\n{usage-heading} {usage}\n");
    for (heading, verbs) in VERBS {
        text += &format!("\n{heading}:\n");
        for verb in verbs {
            let about = command.find_subcommand(verb).and_then(Command::get_about);
            text += &format!("  {verb:<12} {}\n", about.map_or(String::new(), ToString::to_string));
        }
    }
    command.help_template(format!("{text}\nFlags of every verb:\n{flags}{{after-help}}"))
}

/// The flags that every verb has, in a line each.
fn root_flags() -> String {
    [
        ("-h, --help", "Print help; VERB -h lists the flags of a verb, VERB --help all of them"),
        ("-V, --version", "Print version"),
        ("-q, --quiet", "Errors only"),
        ("-v, --verbose", "More messages"),
        ("    --threads <N>", "Threads; results do not depend on it [default: all cores]"),
        ("    --config <FILE|KEY=VALUE>", "Configuration file, or one key of it; repeatable"),
    ]
    .map(|(flag, help)| format!("  {flag:<30} {help}\n"))
    .concat()
}

/// Headings for the flags of a verb and of those below it.
fn with_groups(mut command: Command, verb: &str) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|verb| verb.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(&name, |inner| with_groups(inner, &name));
    }
    let help = Arg::new("help").short('h').long("help").action(ArgAction::Help).help("Print help; --help has more");
    command = command.disable_help_flag(true).arg(help);
    let ids = |of: &[(&str, &'static [&'static str])]| of.iter().find(|of| of.0 == verb).map_or(&[][..], |of| of.1);
    let (often, seldom_here) = (ids(&OFTEN), ids(&SELDOM));
    for (heading, shown, seldom) in FLAGS {
        for (order, id) in shown.iter().chain(seldom).enumerate() {
            if command.get_arguments().any(|arg| arg.get_id() == id) {
                let is_seldom = (seldom.contains(id) || seldom_here.contains(id)) && !often.contains(id);
                command = command
                    .mut_arg(id, |arg| arg.help_heading(heading).display_order(order).hide_short_help(is_seldom));
            }
        }
    }
    command
}
