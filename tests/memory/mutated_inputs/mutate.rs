//! How a valid input is spoilt: one to four changes, drawn from a number.

use crate::common::dice::Dice;

const NUMBERS: &str = "NaN inf -inf Infinity 1e308 -1e308 1e400 5e-324 1e-300 1e-9 1e-3 -1 0 -0.0 1 \
    2 3 1.0 0.5 63 64 65 255 256 65536 1000000 1000000.0 2147483647 \
    2147483648 4000000000 4294967295 4294967296 9007199254740993 9223372036854775807 -9223372036854775808 18446744073709551615 18446744073709551616 null 1e6 1e15";

const FRAGMENTS: [&str; 18] = [
    "[", "]", "{", "}", ",", ":", "\"", "\n", "\r\n", "\u{feff}", "\0", "null", "true", "[]", "{}", "\\u0000", "\t",
    ";",
];

/// A changed copy of one of `seeds`, sometimes with a part of one of `others`.
pub fn mutated(dice: &mut Dice, seeds: &[Vec<u8>], others: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[dice.below(seeds.len())].clone();
    for _ in 0..=dice.below(8).saturating_sub(4) {
        change(dice, &mut bytes, others);
    }
    bytes
}

fn change(dice: &mut Dice, bytes: &mut Vec<u8>, others: &[Vec<u8>]) {
    let at = dice.below(bytes.len());
    let to = (at + 1 + dice.below(40)).min(bytes.len());
    match dice.below(24) {
        0 => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << dice.below(8);
            }
        }
        1 => drop(bytes.drain(at.min(to)..to)),
        2 => {
            let part = bytes[at.min(to)..to].to_vec();
            insert(bytes, at, &part);
        }
        3 => insert(bytes, at, FRAGMENTS[dice.below(FRAGMENTS.len())].as_bytes()),
        4 => bytes.truncate(at),
        5 => change_lines(dice, bytes),
        6 => {
            let depth = [10, 127, 128, 1000, 100_000][dice.below(5)];
            let nested = if dice.below(2) == 0 { "[".repeat(depth) } else { "{\"a\":".repeat(depth) };
            let values = numbers(bytes);
            let at = if values.is_empty() { at } else { values[dice.below(values.len())].start };
            insert(bytes, at, nested.as_bytes());
        }
        7 => {
            let other = &others[dice.below(others.len())];
            let from = dice.below(other.len());
            bytes.truncate(at);
            bytes.extend_from_slice(&other[from.min(other.len())..]);
        }
        8 | 9 => remove_field(dice, bytes),
        10 => insert(bytes, at, &[0xff, 0xc3, 0x28][..1 + dice.below(3)]),
        11 => {
            let text: Vec<u8> =
                bytes.iter().flat_map(|&b| if b == b'\n' { vec![b'\r', b'\n'] } else { vec![b] }).collect();
            *bytes = text;
        }
        12 => insert(bytes, 0, "\u{feff}".as_bytes()),
        13 => {
            let digits: Vec<usize> = (0..bytes.len()).filter(|&k| bytes[k].is_ascii_digit()).collect();
            if !digits.is_empty() {
                bytes[digits[dice.below(digits.len())]] = b'0' + dice.below(10) as u8;
            }
        }
        _ => {
            let values = numbers(bytes);
            if !values.is_empty() {
                let new = NUMBERS.split(' ').nth(dice.below(40)).unwrap();
                bytes.splice(values[dice.below(values.len())].clone(), new.bytes());
            }
        }
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, part: &[u8]) {
    bytes.splice(at..at, part.iter().copied());
}

fn change_lines(dice: &mut Dice, bytes: &mut Vec<u8>) {
    let mut lines: Vec<Vec<u8>> = bytes.split(|&b| b == b'\n').map(<[u8]>::to_vec).collect();
    let (a, b) = (dice.below(lines.len()), dice.below(lines.len()));
    match dice.below(3) {
        0 => lines.swap(a, b),
        1 => lines.insert(a, lines[b].clone()),
        _ => drop(lines.remove(a)),
    }
    *bytes = lines.join(&b'\n');
}

fn numbers(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let part = |b: u8| b.is_ascii_digit() || matches!(b, b'-' | b'+' | b'.' | b'e' | b'E');
    let mut found = Vec::new();
    let mut k = 0;
    while k < bytes.len() {
        let starts = (bytes[k].is_ascii_digit() || bytes[k] == b'-')
            && k.checked_sub(1).is_none_or(|p| !bytes[p].is_ascii_alphanumeric());
        let from = k;
        k += 1;
        if starts {
            while k < bytes.len() && part(bytes[k]) {
                k += 1;
            }
            found.push(from..k);
        }
    }
    found
}

/// Removes from one comma to the next: a field of an object, an element of a series, a cell of a table.
fn remove_field(dice: &mut Dice, bytes: &mut Vec<u8>) {
    let commas: Vec<usize> = (0..bytes.len()).filter(|&k| bytes[k] == b',').collect();
    if commas.len() > 1 {
        let k = dice.below(commas.len() - 1);
        drop(bytes.drain(commas[k]..commas[k + 1]));
    }
}
