//! The layout of help: verbs grouped by purpose, flags grouped by subject. `-h` fits on one screen; only `--help` shows
//! rarely used flags.

use clap::{Arg, ArgAction, Command};

/// Verbs by purpose.
const VERBS: [(&str, &[&str]); 4] = [
    ("Study a data set", &["tracks", "study", "mine"]),
    ("Probabilities", &["fit", "sample"]),
    ("Single cases and grids", &["check", "simulate", "map"]),
    ("More machines", &["merge", "verify", "devices", "config"]),
];

/// Flags of the verbs that `-h` shows; it shows all flags of other verbs.
const SHOWN: [(&str, &[&str]); 8] = [
    ("study", &["recordings", "scenarios", "categories", "thw", "models", "profile", "out", "rows"]),
    ("fit", &["recordings", "scenarios", "hours", "km", "categories", "parameterizations", "with_thw", "out"]),
    ("sample", &["density", "thw", "models", "samples", "estimator", "half_width", "out", "rows"]),
    ("check", &["file", "category", "ego_speed", "speed", "gap", "thw", "lateral_speed", "acceleration", "sheet"]),
    (
        "simulate",
        &["from", "lane", "category", "ego_speed", "speed", "gap", "thw", "lateral_speed", "acceleration", "plot"],
    ),
    ("map", &["category", "preset", "x", "y", "panel", "set", "models", "profile", "out"]),
    ("tracks", &["paths", "preset", "out", "convert"]),
    ("verify", &["recordings", "random_lanes", "profile", "backend", "device"]),
];

pub(super) const DATA: &str = "Data";
pub(super) const MODELS: &str = "Models and criteria";
pub(super) const OUTPUT: &str = "Output";
pub(super) const RUN: &str = "Run";

/// Headings of flags, in order. A flag has the same heading in every verb; flags shown only by `--help` are last.
const HEADINGS: [&str; 5] = [DATA, "Scenario", MODELS, OUTPUT, RUN];

/// Applies the layout to the command.
pub(super) fn laid_out(command: Command) -> Command {
    let flags = root_flags();
    let command = with_groups(command);
    let command =
        SHOWN.iter().fold(command, |command, (verb, shown)| command.mut_subcommand(verb, |of| shortened(of, shown)));
    let mut text = String::from("{about-with-newline}{usage-heading} {usage}\n");
    for (heading, verbs) in VERBS {
        text += &format!("{heading}:\n");
        for verb in verbs {
            let about = command.find_subcommand(verb).and_then(Command::get_about);
            text += &format!("  {verb:<12} {}\n", about.map_or(String::new(), ToString::to_string));
        }
    }
    command.help_template(format!("{text}Flags of every verb:\n{flags}{{after-help}}"))
}

/// The flags of every verb, one line each.
fn root_flags() -> String {
    [
        ("-h, --help; -V, --version", "Print help: VERB -h has the usual flags, VERB --help all; version"),
        ("-q, --quiet; -v, --verbose", "Errors only; more messages"),
        ("    --threads <N>", "Threads; results do not depend on it [default: all cores]"),
        ("    --config <FILE|KEY=VALUE>", "Configuration file, or one key of it; repeatable"),
    ]
    .map(|(flag, help)| format!("  {flag:<30} {help}\n"))
    .concat()
}

/// Leaves the help of `-h` some flags and the first example.
fn shortened(command: Command, shown: &[&str]) -> Command {
    let examples = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let first = examples.lines().find(|line| line.starts_with("  lanesweep") && !line.ends_with('\\'));
    let first = first.map_or(String::new(), |line| format!("Example: {}", line.trim()));
    let all = command.get_after_long_help().map_or(examples, ToString::to_string);
    let is_hidden = |arg: &Arg| !shown.contains(&arg.get_id().as_str()) && arg.get_id() != "help";
    let command = command.mut_args(|arg| {
        let is_hidden = is_hidden(&arg);
        arg.hide_short_help(is_hidden)
    });
    command.after_help(first).after_long_help(all)
}

/// Sorts the flags of a verb and its subverbs by their headings.
fn with_groups(mut command: Command) -> Command {
    let help = Arg::new("help").short('h').long("help").action(ArgAction::Help).help("Print help; --help has more");
    command = command.mut_subcommands(with_groups).disable_help_flag(true).arg(help.help_heading(RUN));
    for heading in HEADINGS {
        let ids = |is_seldom: bool| {
            let of_heading = command.get_arguments().filter(|arg| arg.get_help_heading() == Some(heading));
            of_heading.filter(move |arg| arg.is_hide_short_help_set() == is_seldom).map(|arg| arg.get_id().clone())
        };
        let ids: Vec<clap::Id> = ids(false).chain(ids(true)).collect();
        for (at, id) in ids.into_iter().enumerate() {
            // Flags shown only by `--help` also follow the global flags.
            let order = |arg: &Arg| if arg.is_hide_short_help_set() { 100 + at } else { at };
            command = command.mut_arg(id, |arg| {
                let order = order(&arg);
                arg.display_order(order)
            });
        }
    }
    command
}
