//! Our commands in the blocks and code spans of a document, as far as their verb and flags go.

use super::markdown::Document;

/// A command line of the program.
#[derive(Debug, PartialEq)]
pub struct Called {
    /// `study`, …
    pub verb: String,
    /// The verb of a verb: `show` of `config show`.
    pub inner: Option<String>,
    /// `--out`, `-q`, …
    pub flags: Vec<String>,
}

/// Every command of the program that a document prints, with its line.
pub fn commands(document: &Document) -> Vec<(usize, Called)> {
    let mut found = Vec::new();
    for block in document.blocks().filter(|block| ["sh", "bash", "console", ""].contains(&block.language)) {
        let mut pending = String::new();
        for (at, line) in block.content.lines().enumerate() {
            let is_prompt = line.starts_with("$ ") || line.starts_with("> ");
            // In console blocks the other lines are output.
            if block.language == "console" && !is_prompt && pending.is_empty() {
                continue;
            }
            let line = line.strip_prefix("$ ").or_else(|| line.strip_prefix("> ")).unwrap_or(line);
            let continued = line.strip_suffix('\\');
            pending.push_str(continued.unwrap_or(line));
            if continued.is_none() {
                found.extend(calls(&pending).into_iter().map(|called| (block.line + at, called)));
                pending.clear();
            }
        }
    }
    // Code spans that are a whole command, not only the program's or a verb's name.
    let mut inside = false;
    for (at, line) in document.text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            let spans = line.split('`').skip(1).step_by(2);
            let whole = spans.filter(|span| span.starts_with("lanesweep ") && !span.contains('<'));
            found.extend(whole.flat_map(calls).map(|called| (at + 1, called)));
        }
    }
    found
}

/// The calls of one line: after pipes, `&&` and `;`, without comments.
fn calls(line: &str) -> Vec<Called> {
    let words = words(line);
    let mut calls = Vec::new();
    for command in words.split(|word| matches!(word.as_str(), "|" | "&&" | ";" | "||" | "(" | ")")) {
        let assignments = command.iter().take_while(|word| word.split_once('=').is_some_and(|(key, _)| is_name(key)));
        let words = &command[assignments.count()..];
        let arguments = match words.first().map(String::as_str) {
            Some("lanesweep") => &words[1..],
            // A launcher before the program.
            Some("srun") => {
                let Some(at) = words.iter().position(|word| word == "lanesweep") else { continue };
                &words[at + 1..]
            }
            Some("cargo") if words.get(1).is_some_and(|word| word == "run") => {
                let Some(at) = words.iter().position(|word| word == "--") else { continue };
                &words[at + 1..]
            }
            _ => continue,
        };
        for arguments in arguments.split(|word| word == "--") {
            calls.extend(called(arguments));
        }
    }
    calls
}

/// Verb and flags; `None` for the program's own flags and for placeholders.
fn called(arguments: &[String]) -> Option<Called> {
    let verb = arguments.iter().find(|word| !word.starts_with('-'))?;
    if verb.contains(|c: char| !c.is_ascii_lowercase()) {
        return None;
    }
    let is_number = |word: &str| word.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit() || c == '.');
    let flags = arguments.iter().filter(|word| word.len() > 1 && word.starts_with('-') && !is_number(word));
    let flags = flags.map(|word| word.split('=').next().unwrap_or_default().to_owned()).collect();
    let inner = arguments.iter().skip_while(|word| *word != verb).nth(1).filter(|_| verb == "config").cloned();
    Some(Called { verb: verb.clone(), inner, flags })
}

fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Words of a line; quotes hold words together, `#` begins a comment, `;` and `|` are words of their own.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    let mut finish = |word: &mut String| {
        if !word.is_empty() {
            words.push(std::mem::take(word));
        }
    };
    for c in line.chars() {
        match (quote, c) {
            (Some(mark), c) if c == mark => quote = None,
            (Some(_), c) => word.push(c),
            (None, '"' | '\'') => quote = Some(c),
            (None, '#') if word.is_empty() => break,
            (None, c) if c.is_whitespace() => finish(&mut word),
            (None, ';') => {
                finish(&mut word);
                word.push(';');
                finish(&mut word);
            }
            (None, c) => word.push(c),
        }
    }
    finish(&mut word);
    words
}
