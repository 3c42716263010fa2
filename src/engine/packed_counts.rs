//! Confusions in files. A unit of a study has a hundred of them, each with four small counts: where all are below 64
//! they are one text with a character per count, else a list of numbers. A tenth of the time and a third of the size of
//! numbers, in journals and parts that are written while lanes wait.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::confusion::Confusion;

/// Characters of the counts 0 … 63, as in base 64.
const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Packed {
    Text(String),
    Numbers(Vec<Confusion<u32>>),
}

pub(super) fn serialize<S: Serializer>(cells: &[Confusion<u32>], serializer: S) -> Result<S::Ok, S::Error> {
    let counts = || cells.iter().flat_map(|cell| <[u32; 4]>::from(*cell));
    let text: Option<String> = counts().map(|count| DIGITS.get(count as usize).map(|&digit| digit as char)).collect();
    match text {
        Some(text) => serializer.serialize_str(&text),
        None => cells.serialize(serializer),
    }
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Confusion<u32>>, D::Error> {
    let text = match Packed::deserialize(deserializer)? {
        Packed::Numbers(cells) => return Ok(cells),
        Packed::Text(text) => text,
    };
    let (cells, rest) = text.as_bytes().as_chunks::<4>();
    if !rest.is_empty() {
        return Err(D::Error::custom("the counts of a cell are not complete"));
    }
    let count = |byte: u8| {
        let found = DIGITS.iter().position(|&digit| digit == byte);
        found.map(|count| count as u32).ok_or_else(|| D::Error::custom("a character stands for no count"))
    };
    cells.iter().map(|&[a, b, c, d]| Ok([count(a)?, count(b)?, count(c)?, count(d)?].into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Unit {
        #[serde(with = "super")]
        cells: Vec<Confusion<u32>>,
    }

    fn unit(counts: &[[u32; 4]]) -> Unit {
        Unit { cells: counts.iter().map(|&counts| counts.into()).collect() }
    }

    #[test]
    fn counts_come_back_whatever_their_size() {
        for counts in [vec![], vec![[0, 10, 63, 1]], vec![[0; 4], [64, 0, 0, 0]], vec![[u32::MAX; 4]; 3]] {
            let unit = unit(&counts);
            let text = serde_json::to_string(&unit).unwrap();
            assert_eq!(serde_json::from_str::<Unit>(&text).unwrap(), unit, "{text}");
        }
        assert_eq!(serde_json::to_string(&unit(&[[0, 1, 25, 63]])).unwrap(), r#"{"cells":"ABZ/"}"#);
    }

    #[test]
    fn what_stands_for_no_counts_is_refused() {
        for text in [
            r#"{"cells":"ABZ"}"#,
            r#"{"cells":"AB-/"}"#,
            r#"{"cells":"ABZé"}"#,
            r#"{"cells":[[1,2,3]]}"#,
            r#"{"cells":3}"#,
        ] {
            assert!(serde_json::from_str::<Unit>(text).is_err(), "{text}");
        }
    }
}
