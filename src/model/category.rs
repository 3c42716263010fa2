//! Kinds of scenario.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use lanesweep_support::{Error, Place, Result};

/// The three kinds of scenario of UN R157, Annex 3.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// Another vehicle changes into the ego's lane in front of it.
    #[default]
    CutIn,
    /// The leader leaves the ego's lane and uncovers a slower vehicle.
    CutOut,
    /// The leader decelerates.
    Lvd,
}

impl Category {
    /// All categories, in the order of every table.
    pub const ALL: [Category; 3] = [Category::CutIn, Category::CutOut, Category::Lvd];

    /// Name in files and keys: `cut_in`, `cut_out`, `lvd`.
    pub fn key(self) -> &'static str {
        match self {
            Category::CutIn => "cut_in",
            Category::CutOut => "cut_out",
            Category::Lvd => "lvd",
        }
    }

    /// Name in running text and tables: `cut-in`, `cut-out`, `LVD`.
    pub fn label(self) -> &'static str {
        match self {
            Category::CutIn => "cut-in",
            Category::CutOut => "cut-out",
            Category::Lvd => "LVD",
        }
    }

    /// Parses either name.
    pub fn parse(text: &str) -> Option<Category> {
        let folded = text.to_ascii_lowercase().replace('-', "_");
        Category::ALL.into_iter().find(|c| c.key() == folded)
    }

    /// Parses the name that stands at a place.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown name.
    pub fn named(text: &str, place: Place) -> Result<Category> {
        let names = Category::ALL.map(Category::label);
        Category::parse(text).ok_or_else(|| Error::unknown(place, "category", text, names, ""))
    }
}
