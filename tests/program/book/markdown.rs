//! As much of Markdown as the book uses: fenced blocks, headings, links.

use std::collections::BTreeSet;
use std::path::Path;

pub struct Document {
    pub path: String,
    pub text: String,
}

pub struct Block<'a> {
    /// Line of its first line of content, from 1.
    pub line: usize,
    /// First word after the fence; empty for a bare one.
    pub language: &'a str,
    /// What follows it.
    pub attributes: &'a str,
    pub content: String,
}

pub struct Link {
    pub line: usize,
    pub target: String,
}

impl Document {
    pub fn read(root: &Path, path: &str) -> Document {
        let text = std::fs::read_to_string(root.join(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
        Document { path: path.to_owned(), text }
    }

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

    /// Lines outside of blocks, with their numbers from 1.
    pub fn unfenced(&self) -> impl Iterator<Item = (usize, &str)> {
        let mut inside = false;
        self.text.lines().enumerate().filter_map(move |(at, line)| {
            let is_fence = line.trim_start().starts_with("```");
            inside ^= is_fence;
            (!inside && !is_fence).then_some((at + 1, line))
        })
    }

    /// Names of the headings in addresses, as mdBook and forges make them.
    pub fn anchors(&self) -> BTreeSet<String> {
        let headings = self.unfenced().filter(|(_, line)| line.starts_with('#'));
        let name = |(_, line): (usize, &str)| -> String {
            let heading = line.trim_start_matches('#').trim();
            let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
            kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
        };
        headings.map(name).collect()
    }

    /// Inline links and images, addresses in angle brackets, and `src`, `srcset` and `href` of HTML.
    pub fn links(&self) -> Vec<Link> {
        let mut links = Vec::new();
        for (line, text) in self.unfenced() {
            // Code spans emptied.
            let text = text.split('`').step_by(2).collect::<Vec<_>>().join("``");
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
}
