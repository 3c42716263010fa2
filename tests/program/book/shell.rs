//! Our commands in the blocks and code spans of a document, as far as their verb and flags go.

use super::markdown::Document;

pub struct Called {
    pub verb: String,
    /// The verb of a verb: `show` of `config show`.
    pub inner: Option<String>,
    pub flags: Vec<String>,
}

/// Every command of the program that a document prints, with the line of its block or code span.
pub fn commands(document: &Document) -> Vec<(usize, Called)> {
    let mut found = Vec::new();
    for block in document.blocks().filter(|block| ["sh", "bash", "console", ""].contains(&block.language)) {
        let text = block.content.replace("\\\n", " ");
        // In console blocks the other lines are output.
        let lines = text.lines().filter(|line| block.language != "console" || line.starts_with("$ "));
        found.extend(lines.flat_map(calls).map(|called| (block.line, called)));
    }
    // Code spans that are a whole command, not only the program's or a verb's name.
    for (at, line) in document.unfenced() {
        let spans = line.split('`').skip(1).step_by(2);
        let whole = spans.filter(|span| span.starts_with("lanesweep ") && !span.contains('<'));
        found.extend(whole.flat_map(calls).map(|called| (at, called)));
    }
    found
}

/// The calls of one line: after pipes, `&&` and `;`, without comments.
fn calls(line: &str) -> Vec<Called> {
    let code = line.split(" #").next().unwrap_or_default().trim_start_matches("$ ");
    code.split(['|', ';', '&', '(', ')']).filter_map(called).collect()
}

/// Verb and flags; `None` for other programs, for the program's own flags and for placeholders.
fn called(command: &str) -> Option<Called> {
    let is_assignment = |word: &&str| {
        word.split_once('=').is_some_and(|(key, _)| key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))
    };
    let mut words = command.split_whitespace().skip_while(is_assignment).peekable();
    match words.next()? {
        "lanesweep" => {}
        // Launchers before the program.
        "srun" => drop(words.find(|word| *word == "lanesweep")?),
        "cargo" if words.peek() == Some(&"run") => drop(words.find(|word| *word == "--")?),
        _ => return None,
    }
    let words: Vec<&str> = words.take_while(|word| *word != "--").collect();
    let at = words.iter().position(|word| !word.starts_with('-'))?;
    if words[at].contains(|c: char| !c.is_ascii_lowercase()) {
        return None;
    }
    let is_number = |word: &str| word.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit() || c == '.');
    let flags = words.iter().filter(|word| word.len() > 1 && word.starts_with('-') && !is_number(word));
    let flags = flags.map(|word| word.split('=').next().unwrap_or_default().to_owned()).collect();
    let inner = words.get(at + 1).filter(|_| words[at] == "config").map(|word| (*word).to_owned());
    Some(Called { verb: words[at].to_owned(), inner, flags })
}
