//! One self-contained page: texts, tables and figures of a run in one file, without external resources. The caller fills
//! a `Page` with content; `templates` define its look and the one script, which sorts tables and shows values.

use base64::prelude::{BASE64_STANDARD, Engine};
use minijinja::value::{Serde, Value};
use minijinja::{Environment, escape_formatter};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::records::PROGRAM;
use crate::model::profile::Profile;
use crate::support::plain_text::shown;
use crate::support::table::Table;
use crate::{Error, Result};

const TEMPLATE: &str = include_str!("templates/report.html");
const STYLE: &str = include_str!("templates/style.css");
const SCRIPT: &str = include_str!("templates/script.js");

/// Figures wider than this fill the page; others, of a paper's column, are two abreast.
const NARROW_PX: f64 = 700.0;

/// A figure with the names of its files beside the page.
#[derive(Debug, Clone, Serialize)]
pub struct PageFigure {
    svg: String,
    files: Vec<String>,
    is_wide: bool,
}

impl PageFigure {
    /// From a complete SVG document.
    pub fn new(svg: &str, files: &[&str]) -> PageFigure {
        let (svg, width_px) = inline(svg);
        PageFigure { svg, files: files.iter().map(|file| (*file).to_owned()).collect(), is_wide: width_px > NARROW_PX }
    }
}

/// A chapter of the page.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Section {
    /// Anchor: lower-case letters and dashes.
    pub id: String,
    /// Heading.
    pub title: String,
    /// What the chapter shows; may be empty.
    pub intro: String,
    /// A monospaced text with aligned columns; may be empty.
    pub text: String,
    /// Tables, before the figures.
    pub tables: Vec<Table>,
    /// Figures.
    pub figures: Vec<PageFigure>,
    /// Names and values.
    pub facts: Vec<(String, String)>,
    /// Names and values that depend on the machine and differ between runs.
    pub host: Vec<(String, String)>,
    /// Whether it opens on a click.
    pub is_folded: bool,
    /// Parts at its end, which open on a click; they need no anchor.
    pub parts: Vec<Section>,
}

/// The page.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Page {
    /// Heading.
    pub title: String,
    /// What was run on which data, in one sentence.
    pub lead: String,
    /// Whether the data are synthetic, which the page then says first.
    pub synthetic: bool,
    /// Warnings at the top of the page.
    pub warnings: Vec<String>,
    /// The chapters.
    pub sections: Vec<Section>,
}

impl Section {
    /// An empty chapter.
    pub(super) fn new(id: &str, title: &str) -> Section {
        Section { id: id.to_owned(), title: title.to_owned(), ..Section::default() }
    }

    /// A profile that opens on a click.
    pub(super) fn of_profile(title: impl Into<String>, profile: &Profile) -> Result<Section> {
        let text = serde_json::to_string_pretty(profile);
        let text = text.map_err(|e| Error::Internal(format!("a profile cannot be written: {e}")))?;
        Ok(Section::folded(title, text))
    }

    /// A long text that opens on a click.
    pub(super) fn folded(title: impl Into<String>, text: String) -> Section {
        Section { title: title.into(), text, ..Section::default() }
    }
}

impl Page {
    /// The page as a complete HTML document. The same page gives the same bytes.
    ///
    /// # Errors
    /// [`Error::Internal`] if the template does not match: a defect of this program.
    pub(super) fn html(&self) -> Result<String> {
        #[derive(Serialize)]
        struct Context<'a> {
            style: &'a str,
            script: &'a str,
            script_sha256: String,
            program: &'a str,
            #[serde(flatten)]
            page: &'a Page,
        }
        let broken = |e: minijinja::Error| Error::Internal(format!("the report's page cannot be made: {e:#}"));
        let mut environment = Environment::new();
        // In addition to HTML escapes, which follow from the template's name: characters that reverse or hide text are
        // made visible.
        environment.set_formatter(|out, state, value| match value.as_str() {
            Some(text) if !value.is_safe() => escape_formatter(out, state, &Value::from(shown(text).as_ref())),
            _ => escape_formatter(out, state, value),
        });
        environment.add_template("report.html", TEMPLATE).map_err(broken)?;
        let template = environment.get_template("report.html").map_err(broken)?;
        let script_sha256 = BASE64_STANDARD.encode(Sha256::digest(SCRIPT));
        template
            .render(Serde(Context { style: STYLE, script: SCRIPT, script_sha256, program: PROGRAM, page: self }))
            .map_err(broken)
    }
}

/// An SVG document as an element that scales with the page, and its width, px: a view box replaces width and height.
fn inline(svg: &str) -> (String, f64) {
    let svg = &svg[svg.find("<svg").unwrap_or(0)..];
    let size = |name: &str| {
        let (_, value) = svg.split_once('>')?.0.split_once(&format!(" {name}=\""))?;
        value.split_once('"').map(|(value, _)| value.to_owned())
    };
    let (Some(width), Some(height)) = (size("width"), size("height")) else { return (svg.to_owned(), 0.0) };
    let view_box = format!(" viewBox=\"0 0 {width} {height}\" role=\"img\"");
    let scaled =
        svg.replacen(&format!(" width=\"{width}\""), &view_box, 1).replacen(&format!(" height=\"{height}\""), "", 1);
    (scaled.trim_end().to_owned(), width.parse().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::table::NumberText;

    fn page() -> Page {
        let table = Table::of([("<script>alert(1)</script>\u{202e}\u{1b}", "1\n[0 2]")])
            .column("name", |row| row.0)
            .column("value", |row| NumberText(row.1.into()))
            .build();
        let svg = "<?xml version=\"1.0\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1000\" height=\"50\" \
                   fill=\"#000\"><rect width=\"100%\" height=\"100%\"/></svg>\n";
        let section = Section {
            id: "a".into(),
            title: "Part".into(),
            tables: vec![table.captioned("A & B")],
            figures: vec![PageFigure::new(svg, &["a.svg", "a.csv"])],
            facts: vec![("seed".into(), "1".into())],
            host: vec![("device".into(), "none".into())],
            parts: vec![Section::folded("all", "x < y".into())],
            ..Section::default()
        };
        Page { title: "T".into(), sections: vec![section], warnings: vec!["W".into()], ..Page::default() }
    }

    #[test]
    fn texts_are_escaped_and_figures_are_not() {
        let html = page().html().unwrap();
        assert_eq!(html.matches("<script").count(), 1, "{html}");
        assert!(html.contains("\\u{202e}\\u{1b}") && !html.contains(['\u{202e}', '\u{1b}']), "{html}");
        assert!(html.contains("&lt;script&gt;") && html.contains("A &amp; B") && html.contains("x &lt; y"));
        assert!(
            html.contains("viewBox=\"0 0 1000 50\" role=\"img\" fill=\"#000\"><rect width=\"100%\" height=\"100%\"/>")
        );
        assert!(!html.contains("<?xml"));
        assert_eq!(html, page().html().unwrap());
    }

    #[test]
    fn nothing_is_fetched_from_elsewhere() {
        let html = page().html().unwrap().replace("http://www.w3.org/2000/svg", "");
        let html: String = html.lines().filter(|line| !line.starts_with("//")).collect();
        for outside in ["http:", "https:", "//", "@import", "url(", "src="] {
            assert!(!html.contains(outside), "{outside}");
        }
    }

    #[test]
    fn the_page_forbids_other_scripts_and_everything_from_elsewhere() {
        let html = page().html().unwrap();
        let head = html.split_once("</head>").unwrap().0;
        let policy = head.split_once("http-equiv=\"Content-Security-Policy\" content=\"").unwrap().1;
        let policy = policy.split_once('"').unwrap().0;
        assert!(policy.starts_with("default-src 'none';"), "{policy}");
        // Styles are inline, the icon is empty, and the script is known by its hash; the policy allows nothing else.
        let script = html.split_once("<script>").unwrap().1.split_once("</script>").unwrap().0;
        let script = format!("script-src 'sha256-{}'", BASE64_STANDARD.encode(Sha256::digest(script)));
        let allowed: Vec<&str> = policy.split("; ").skip(1).collect();
        let none = ["base-uri 'none'", "form-action 'none'"];
        assert_eq!(allowed, [&["style-src 'unsafe-inline'", script.as_str(), "img-src data:"][..], &none].concat());
        assert!(head.find("Content-Security-Policy") < head.find("<style"), "before what it rules");
    }

    #[test]
    fn what_belongs_to_the_machine_can_be_cut_out() {
        let html = page().html().unwrap();
        let (before, after) = html.split_once("<!-- host -->").unwrap();
        let (host, after) = after.split_once("<!-- end of host -->").unwrap();
        let name = "<dt>device<";
        assert!(host.contains(name) && !before.contains(name) && !after.contains(name));
    }
}
