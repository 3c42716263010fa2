//! The layout of help: verbs grouped by purpose, flags grouped by subject. `-h` fits on one screen; only `--help` shows
//! rarely used flags.

use clap::{Arg, ArgAction, Command};

/// Verbs by purpose.
const VERBS: [(&str, &[&str]); 5] = [
    ("Study a data set", &["tracks", "study", "mine"]),
    ("Probabilities", &["fit", "sample"]),
    ("Single cases and grids", &["check", "simulate", "map"]),
    ("More machines", &["merge"]),
    ("Tools", &["verify", "devices", "config"]),
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

/// The flags of every verb, one line each.
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
