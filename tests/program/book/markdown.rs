//! As much of Markdown as the book uses: fenced blocks, headings, links.

use std::collections::BTreeSet;
use std::path::Path;

/// A bare fence means a command to trycmd; with this language it does not.
const BARE: &str = "```bare-fence";

/// A Markdown file.
pub struct Document {
    /// From the crate's root.
    pub path: String,
    /// All of it.
    pub text: String,
}

/// A fenced block.
pub struct Block<'a> {
    /// Line of its first line of content, from 1.
    pub line: usize,
    /// First word after the fence; empty for a bare one.
    pub language: &'a str,
    /// What follows it.
    pub attributes: &'a str,
    /// Its lines.
    pub content: String,
}

/// A link of the prose.
pub struct Link {
    /// From 1.
    pub line: usize,
    /// As it is written.
    pub target: String,
}

impl Document {
    pub fn read(root: &Path, path: &str) -> Document {
        let text = std::fs::read_to_string(root.join(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
        Document { path: path.to_owned(), text }
    }

    /// The fenced blocks, in order.
    pub fn blocks(&self) -> impl Iterator<Item = Block<'_>> {
        let mut blocks = Vec::new();
        let mut lines = self.text.lines().enumerate();
        while let Some((at, line)) = lines.next() {
            let Some(info) = line.trim_start().strip_prefix("```") else { continue };
            let info = info.trim();
            let end = info.find([' ', ',']).unwrap_or(info.len());
            let inside = lines.by_ref().take_while(|(_, line)| !line.trim_start().starts_with("```"));
            let content = inside.map(|(_, line)| format!("{line}\n")).collect();
            blocks.push(Block { line: at + 2, language: &info[..end], attributes: &info[end..], content });
        }
        blocks.into_iter()
    }

    /// Files that the chapter shows and its commands use: name and content.
    pub fn files(&self) -> Vec<(String, String)> {
        let name =
            |block: &Block| Some(block.attributes.split([' ', ',']).find_map(|a| a.strip_prefix("file="))?.to_owned());
        self.blocks().filter_map(|block| Some((name(&block)?, block.content))).collect()
    }

    /// Lines of prose with their numbers from 1: no blocks, and code spans emptied.
    pub fn prose(&self) -> Vec<(usize, String)> {
        let mut inside = false;
        let mut prose = Vec::new();
        for (at, line) in self.text.lines().enumerate() {
            if line.trim_start().starts_with("```") {
                inside = !inside;
            } else if !inside {
                let outside_of_spans: Vec<&str> = line.split('`').step_by(2).collect();
                prose.push((at + 1, outside_of_spans.join("``")));
            }
        }
        prose
    }

    /// Texts of the headings.
    pub fn headings(&self) -> Vec<String> {
        let mut inside = false;
        let mut headings = Vec::new();
        for line in self.text.lines() {
            if line.trim_start().starts_with("```") {
                inside = !inside;
            } else if !inside && line.starts_with('#') {
                headings.push(line.trim_start_matches('#').trim().to_owned());
            }
        }
        headings
    }

    /// Names of the headings in addresses, as mdBook and forges make them.
    pub fn anchors(&self) -> BTreeSet<String> {
        let name = |heading: &String| -> String {
            let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
            kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
        };
        self.headings().iter().map(name).collect()
    }

    /// Inline links and images, addresses in angle brackets, and `src`, `srcset` and `href` of HTML.
    pub fn links(&self) -> Vec<Link> {
        let mut links = Vec::new();
        for (line, text) in self.prose() {
            let marks =
                [("](", ')'), ("<https:", '>'), ("<http:", '>'), ("src=\"", '"'), ("srcset=\"", '"'), ("href=\"", '"')];
            for (open, close) in marks {
                for (at, _) in text.match_indices(open) {
                    let begin = if open.starts_with('<') { at + 1 } else { at + open.len() };
                    let Some(end) = text[begin..].find(close) else { continue };
                    links.push(Link { line, target: text[begin..begin + end].to_owned() });
                }
            }
        }
        links
    }

    /// The same as trycmd wants it: bare fences, which it would take for commands, get a language; and every output of a
    /// command ends as it does on the terminal, which a reader does not have to see: with a newline, and a report of an
    /// error with an empty line besides.
    pub fn for_trycmd(&self) -> String {
        let ending = |output: &[&str]| match output.last() {
            None | Some(&"...") => "",
            Some(_) if output.rsplit(|line| line.is_empty()).next().is_some_and(is_report) => "\n\n",
            Some(_) => "\n",
        };
        self.rewritten(|text, fence| if text == "```" { BARE.to_owned() } else { fence.to_owned() }, ending)
    }

    /// The chapter with its fences as `fence` says (trimmed and as it is) and something after each command's output.
    fn rewritten(&self, fence: impl Fn(&str, &str) -> String, ending: impl Fn(&[&str]) -> &'static str) -> String {
        let (mut text, mut output, mut block) = (String::new(), Vec::new(), None);
        for line in self.text.lines() {
            let is_fence = line.trim_start().starts_with("```");
            let is_console = block.is_some_and(|info: &str| info.starts_with("```console"));
            if is_console && !is_fence && !line.starts_with("$ ") {
                output.push(line);
                continue;
            }
            while output.last().is_some_and(|line| line.is_empty()) {
                output.pop();
            }
            let printed: Vec<&str> =
                output.iter().copied().filter(|l| !l.starts_with("> ") && !l.starts_with("? ")).collect();
            output.iter().for_each(|line| text.push_str(&format!("{line}\n")));
            text.push_str(ending(&printed));
            output.clear();
            if is_fence && block.is_none() {
                text.push_str(&fence(line.trim(), line));
            } else {
                text.push_str(line);
            }
            text.push('\n');
            if is_fence {
                block = if block.is_none() { Some(line.trim_start()) } else { None };
            }
        }
        text
    }
}

/// Lines that end with an error's report.
fn is_report(lines: &[&str]) -> bool {
    lines.iter().any(|line| line.starts_with("  × "))
}

/// Back from [`Document::for_trycmd`].
pub fn from_trycmd(text: String) -> String {
    let document = Document { path: String::new(), text };
    document.rewritten(|text, fence| if text == BARE { "```".to_owned() } else { fence.to_owned() }, |_| "")
}
