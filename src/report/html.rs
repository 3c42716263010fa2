//! One self-contained page: texts, tables and figures of a run in one file, without external resources. The caller fills
//! a `Page` with content; `templates` have its style and the one script, which sorts tables and shows values.

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::plot::Figure;
use super::records::PROGRAM;
use lanesweep_support::Result;
use lanesweep_support::plain_text::escape_markup;
use lanesweep_support::run_folder::{FIGURES, Results, TABLES};
use lanesweep_support::table::Table;

const STYLE: &str = include_str!("templates/style.css");
const SCRIPT: &str = include_str!("templates/script.js");

/// Figures wider than this fill the page; others, of a paper's column, are two abreast.
const NARROW_PX: f64 = 700.0;

/// A figure with the names of its files beside the page.
#[derive(Debug, Clone)]
pub(crate) struct PageFigure {
    svg: String,
    files: Vec<String>,
    is_wide: bool,
}

impl PageFigure {
    /// From a complete SVG document.
    pub(crate) fn new(svg: &str, files: &[&str]) -> PageFigure {
        let (svg, width_px) = inline(svg);
        PageFigure { svg, files: files.iter().map(|file| (*file).to_owned()).collect(), is_wide: width_px > NARROW_PX }
    }

    /// Adds a figure to the results as figures/NAME.svg, and its values as tables/NAME.csv; a plain one with its texts as
    /// figures/NAME.txt.
    pub(super) fn add(results: &mut Results, name: &str, figure: &Figure, is_plain: bool) -> Result<PageFigure> {
        let [numbers, file] = [format!("{TABLES}{name}.csv"), format!("{FIGURES}{name}.svg")];
        let svg = figure.svg();
        results.add_table(&numbers, figure.numbers())?;
        if is_plain {
            let (plain, texts) = figure.plain();
            results.add(&file, plain.as_bytes())?;
            results.add(&format!("{FIGURES}{name}.txt"), texts.as_bytes())?;
        } else {
            results.add(&file, svg.as_bytes())?;
        }
        Ok(PageFigure::new(&svg, &[&file, &numbers]))
    }
}

/// A chapter of the page, or a part at the end of one.
#[derive(Debug, Clone, Default)]
pub(super) struct Section {
    id: String,
    title: String,
    intro: String,
    text: String,
    tables: Vec<Table>,
    figures: Vec<PageFigure>,
    facts: Vec<(String, String)>,
    host: Vec<(String, String)>,
    is_folded: bool,
    parts: Vec<Section>,
}

/// The page.
#[derive(Debug, Clone, Default)]
pub(super) struct Page {
    /// Heading.
    pub title: String,
    /// What was run on which data, in one sentence.
    pub lead: String,
    /// Whether the data are synthetic, which the page then says first.
    pub synthetic: bool,
    /// Warnings at the top of the page.
    pub warnings: Vec<String>,
    /// A program before the chapters.
    pub app: Option<App>,
    /// The chapters.
    pub sections: Vec<Section>,
}

/// What a page computes where it is read: markup, style, script, and its data as JSON.
#[derive(Debug, Clone, Default)]
pub(super) struct App {
    pub markup: &'static str,
    pub style: &'static str,
    pub script: String,
    pub data: String,
}

impl Section {
    /// An empty chapter. Its anchor has lower-case letters and dashes; a part needs none.
    pub(super) fn new(id: &str, title: impl Into<String>) -> Section {
        Section { id: id.to_owned(), title: title.into(), ..Section::default() }
    }

    /// A profile or options, as a part.
    pub(super) fn options(title: impl Into<String>, options: &impl Serialize) -> Section {
        // Texts and numbers, which JSON always has.
        Section::new("", title).text(serde_json::to_string_pretty(options).unwrap_or_default())
    }

    /// What the chapter shows; may be empty.
    pub(super) fn intro(self, intro: impl Into<String>) -> Section {
        Section { intro: intro.into(), ..self }
    }

    /// A monospaced text with aligned columns; may be empty.
    pub(super) fn text(self, text: impl Into<String>) -> Section {
        Section { text: text.into(), ..self }
    }

    /// Tables, before the figures.
    pub(super) fn tables(mut self, tables: impl IntoIterator<Item = Table>) -> Section {
        self.tables.extend(tables);
        self
    }

    /// Figures.
    pub(super) fn figures(mut self, figures: impl IntoIterator<Item = PageFigure>) -> Section {
        self.figures.extend(figures);
        self
    }

    /// A name and its value.
    pub(super) fn fact(self, name: &str, value: impl Into<String>) -> Section {
        self.facts([(name, value)])
    }

    /// Names and values.
    pub(super) fn facts<N: Into<String>, V: Into<String>>(
        mut self,
        facts: impl IntoIterator<Item = (N, V)>,
    ) -> Section {
        self.facts.extend(facts.into_iter().map(|(name, value)| (name.into(), value.into())));
        self
    }

    /// Names and values that depend on the machine and differ between runs.
    pub(super) fn host(mut self, host: impl IntoIterator<Item = (&'static str, String)>) -> Section {
        self.host.extend(host.into_iter().map(|(name, value)| (name.to_owned(), value)));
        self
    }

    /// Parts at its end, which open on a click.
    pub(super) fn parts(mut self, parts: impl IntoIterator<Item = Section>) -> Section {
        self.parts.extend(parts);
        self
    }

    /// The same chapter, which opens on a click.
    pub(super) fn folded(self) -> Section {
        Section { is_folded: true, ..self }
    }
}

impl Page {
    /// The page as a complete HTML document. The same page gives the same bytes.
    pub(super) fn html(&self) -> String {
        let title = escape_markup(&self.title);
        let App { markup, style, script, data } = self.app.clone().unwrap_or_default();
        let script = format!("{SCRIPT}{script}");
        let script_sha256 = BASE64_STANDARD.encode(Sha256::digest(&script));
        let data = if data.is_empty() {
            data
        } else {
            format!("\n<script type=\"application/json\" id=\"explorer-data\">{data}</script>")
        };
        let synthetic = "SYNTHETIC DATA: nothing on this page is a statement about real traffic.";
        let warnings = self.synthetic.then_some(synthetic).into_iter().chain(self.warnings.iter().map(String::as_str));
        let warnings: String =
            warnings.map(|warning| format!("\n<p class=\"warning\">{}</p>", escape_markup(warning))).collect();
        let sections: String = self
            .sections
            .iter()
            .enumerate()
            .map(|(at, section)| {
                let contents = if at == 0 { self.contents() } else { String::new() };
                format!("\n<section id=\"{}\">{}{contents}\n</section>", escape_markup(&section.id), section.html())
            })
            .collect();
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
             script-src 'sha256-{script_sha256}'; img-src data:; base-uri 'none'; form-action 'none'\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"generator\" content=\"{program}\">\n<title>{title}</title>\n<link rel=\"icon\" href=\"data:,\">\n\
             <style>\n{STYLE}\n{style}{footer}\n</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n<p>{lead}</p>{warnings}\n</header>\n\
             <main>{markup}{sections}\n</main>\n<div id=\"tip\" role=\"status\" hidden></div>{data}\n<script>{script}</script>\n</body>\n</html>",
            program = escape_markup(PROGRAM),
            footer = self.footer(),
            lead = escape_markup(&self.lead),
        )
    }

    /// Every printed page has the title and its number, so that a loose one can be told from others.
    fn footer(&self) -> String {
        let title: String = self.title.chars().map(|c| format!("\\{:x} ", u32::from(c))).collect();
        let box_of =
            |side: &str, content: &str| format!("@bottom-{side} {{ content: {content}; font: 7pt sans-serif; }}");
        let (title, page) =
            (box_of("left", &format!("\"{title}\"")), box_of("right", "counter(page) \" of \" counter(pages)"));
        format!("@page {{ {title} {page} }}")
    }

    /// Links to all chapters but the first.
    fn contents(&self) -> String {
        let others = self.sections.get(1..).unwrap_or_default();
        if others.is_empty() {
            return String::new();
        }
        let link = |of: &Section| {
            format!("\n<li><a href=\"#{}\">{}</a></li>", escape_markup(&of.id), escape_markup(&of.title))
        };
        let links: String = others.iter().map(link).collect();
        format!("\n<nav aria-label=\"Contents\">\n<ul>{links}\n</ul>\n</nav>")
    }
}

impl Section {
    fn html(&self) -> String {
        let (title, content) = (escape_markup(&self.title), self.content());
        match (self.is_folded, self.title.is_empty()) {
            (true, _) => format!("\n<details>\n<summary><h2>{title}</h2></summary>{content}\n</details>"),
            (false, true) => content,
            (false, false) => format!("\n<h2>{title}</h2>{content}"),
        }
    }

    fn content(&self) -> String {
        let mut html = String::new();
        if !self.intro.is_empty() {
            html += &format!("\n<p>{}</p>", escape_markup(&self.intro));
        }
        if !self.text.is_empty() {
            html += &format!("\n<pre>{}</pre>", escape_markup(&self.text));
        }
        html.extend(self.tables.iter().map(table));
        if !self.figures.is_empty() {
            let figures: String = self.figures.iter().map(PageFigure::html).collect();
            html += &format!("\n<div class=\"figures\">{figures}\n</div>");
        }
        if !self.facts.is_empty() {
            html += &format!("\n<dl>{}\n</dl>", facts(&self.facts));
        }
        if !self.host.is_empty() {
            let host = facts(&self.host);
            html += &format!("\n<dl class=\"host\">\n<!-- host -->{host}\n<!-- end of host -->\n</dl>");
        }
        html.extend(self.parts.iter().map(|part| {
            let (title, content) = (escape_markup(&part.title), part.content());
            format!("\n<details class=\"part\">\n<summary>{title}</summary>{content}\n</details>")
        }));
        html
    }
}

impl PageFigure {
    fn html(&self) -> String {
        let class = if self.is_wide { " class=\"wide\"" } else { "" };
        let files: Vec<String> =
            self.files.iter().map(|file| format!("<code>{}</code>", escape_markup(file))).collect();
        let caption = match files.is_empty() {
            true => String::new(),
            false => format!("\n<figcaption>Files: {}</figcaption>", files.join(", ")),
        };
        format!("\n<figure{class}>\n{}{caption}\n</figure>", self.svg)
    }
}

fn table(table: &Table) -> String {
    let (header, rows) = table.shown();
    let class = |at: usize| if at < table.words() { " class=\"text\"" } else { "" };
    let cells = |tag: &str, end: &str, row: &[String]| -> String {
        let cell = |(at, cell): (usize, &String)| format!("<{tag}{}>{}</{end}>", class(at), escape_markup(cell));
        row.iter().enumerate().map(cell).collect()
    };
    let body: String = rows.iter().map(|row| format!("\n<tr>{}</tr>", cells("td", "td", row))).collect();
    format!(
        "\n<div class=\"scroll\">\n<table>\n<caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>{body}\n</tbody>\n\
         </table>\n</div>",
        escape_markup(&table.caption),
        cells("th scope=\"col\"", "th", &header),
    )
}

fn facts(facts: &[(String, String)]) -> String {
    let fact = |(name, value): &(String, String)| {
        format!("\n<div><dt>{}</dt><dd>{}</dd></div>", escape_markup(name), escape_markup(value))
    };
    facts.iter().map(fact).collect()
}

/// An SVG document as an element that scales with the page, and its width, px: a view box replaces width and height.
fn inline(svg: &str) -> (String, f64) {
    let svg = svg[svg.find("<svg").unwrap_or(0)..].trim_end();
    let size = svg.split_once(" width=\"").and_then(|(before, after)| {
        let (width, after) = after.split_once("\" height=\"")?;
        let (height, after) = after.split_once('"')?;
        Some((before, width, height, after))
    });
    let Some((before, width, height, after)) = size else { return (svg.to_owned(), 0.0) };
    let scaled = format!("{before} viewBox=\"0 0 {width} {height}\" role=\"img\"{after}");
    (scaled, width.parse().unwrap_or(0.0))
}
