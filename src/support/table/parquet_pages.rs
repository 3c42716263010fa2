//! Checks a Parquet file's claims before decoding: the nesting of its schema and the size of its pages. The decoder
//! reserves the memory that page headers name, and a run of one value can name any number of values in a few bytes.
//! Only headers are read here; nothing is decompressed.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use parquet::file::metadata::ColumnChunkMetaData;

/// Maximum nesting of groups: a list in a record in the root has four.
const DEEPEST: usize = 8;
/// Maximum footer size, bytes.
const MAX_FOOTER: u64 = 64 << 20;
/// Maximum page header size, bytes.
const MAX_HEADER: u64 = 1 << 20;
/// Maximum page size, bytes.
const MAX_PAGE: i64 = 256 << 20;
/// Decompressed bytes allowed for a file of any size, plus an allowance per byte of the file.
const BYTES: u64 = 16 << 20;
const BYTES_PER_BYTE: u64 = 256;
/// Values allowed for a file of any size, plus an allowance per byte of the file.
const VALUES: u64 = 1 << 20;
const VALUES_PER_BYTE: u64 = 64;

/// Why a file is refused.
pub(super) type Refusal = &'static str;

const DAMAGED: Refusal = "its footer or a page header is damaged";

/// Checks the footer.
pub(super) fn check_footer(file: &mut File, size: u64) -> Result<(), Refusal> {
    let mut tail = [0_u8; 8];
    if size < 12 {
        return Err("it is too short for a Parquet file");
    }
    read_at(file, size - 8, &mut tail)?;
    if &tail[4..] != b"PAR1" {
        return Err(if &tail[4..] == b"PARE" { "it is encrypted" } else { "it does not end as a Parquet file does" });
    }
    let length = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
    if length > size - 8 || length > MAX_FOOTER {
        return Err(DAMAGED);
    }
    let mut footer = vec![0; length as usize];
    read_at(file, size - 8 - length, &mut footer)?;
    let mut is_flat = true;
    let mut compact = Compact { bytes: &footer, at: 0 };
    // Field 2 of the file's metadata is the schema, depth first.
    compact
        .fields(&mut |compact, id, kind| {
            if id != 2 || kind != LIST {
                return Some(false);
            }
            let (count, _) = compact.list()?;
            let mut open: Vec<i64> = Vec::new();
            for _ in 0..count {
                let mut children = 0;
                compact.fields(&mut |compact, id, kind| {
                    let is_count = id == 5 && kind == I32;
                    if is_count {
                        children = compact.zigzag()?;
                    }
                    Some(is_count)
                })?;
                if let Some(left) = open.last_mut() {
                    *left -= 1;
                }
                if children > 0 {
                    open.push(children);
                    is_flat &= open.len() <= DEEPEST;
                }
                while open.last().is_some_and(|left| *left <= 0) {
                    open.pop();
                }
                if !is_flat {
                    return None;
                }
            }
            Some(true)
        })
        .ok_or(if is_flat { DAMAGED } else { "its columns are nested too deeply" })
}

/// Checks the pages of the columns to be read; returns the size of the largest, bytes.
pub(super) fn check_pages<'a>(
    file: &mut File,
    size: u64,
    chunks: impl Iterator<Item = &'a ColumnChunkMetaData>,
) -> Result<u64, Refusal> {
    let (mut bytes, mut values, mut largest) = (0_u64, 0_u64, 0_u64);
    for chunk in chunks {
        let (start, length) = chunk.byte_range();
        let end = start.checked_add(length).filter(|end| *end <= size).ok_or(DAMAGED)?;
        let mut at = start;
        while at < end {
            let page = page(file, at, (end - at).min(MAX_HEADER))?;
            bytes += page.uncompressed;
            values += page.values;
            largest = largest.max(page.uncompressed);
            if bytes > BYTES.saturating_add(BYTES_PER_BYTE.saturating_mul(size))
                || values > VALUES.saturating_add(VALUES_PER_BYTE.saturating_mul(size))
            {
                return Err("it claims to hold far more than a file of its size can");
            }
            at = at.saturating_add(page.length);
        }
    }
    Ok(largest)
}

struct Page {
    /// Including its header, bytes, > 0.
    length: u64,
    uncompressed: u64,
    values: u64,
}

fn page(file: &mut File, at: u64, max_bytes: u64) -> Result<Page, Refusal> {
    // Headers have some tens of bytes; statistics can make them longer.
    let mut tried = max_bytes.min(256);
    loop {
        let mut bytes = vec![0; tried as usize];
        read_at(file, at, &mut bytes)?;
        match header(&bytes) {
            Some(page) => return Ok(page),
            None if tried < max_bytes => tried = (tried * 8).min(max_bytes),
            None => return Err(DAMAGED),
        }
    }
}

fn header(bytes: &[u8]) -> Option<Page> {
    let (mut uncompressed, mut compressed, mut values) = (-1, -1, 0);
    let mut compact = Compact { bytes, at: 0 };
    compact.fields(&mut |compact, id, kind| match (id, kind) {
        (2, I32) => compact.zigzag().map(|size| uncompressed = size).map(|()| true),
        (3, I32) => compact.zigzag().map(|size| compressed = size).map(|()| true),
        // Headers of data, dictionary and second-version data pages begin with the number of values.
        (5 | 7 | 8, STRUCT) => {
            compact.fields(&mut |compact, id, kind| {
                let is_count = id == 1 && kind == I32;
                if is_count {
                    values += compact.zigzag()?.max(0);
                }
                Some(is_count)
            })?;
            Some(true)
        }
        _ => Some(false),
    })?;
    let fits = (0..=MAX_PAGE).contains(&uncompressed) && compressed >= 0;
    fits.then(|| Page {
        length: compact.at as u64 + compressed as u64,
        uncompressed: uncompressed as u64,
        values: values as u64,
    })
}

fn read_at(file: &mut File, at: u64, bytes: &mut [u8]) -> Result<(), Refusal> {
    file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes)).map_err(|_| "it cannot be read to its end")
}

// Types of Thrift's compact protocol.
const I32: u8 = 5;
const LIST: u8 = 9;
const STRUCT: u8 = 12;
/// Maximum nesting of skipped fields.
const DEEPEST_SKIPPED: usize = 32;

/// Reader of Thrift's compact protocol, limited to page headers; `None` if bytes are missing or invalid.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// Callback for a field: returns true if it read the value.
type Visit<'v, 'a> = &'v mut dyn FnMut(&mut Compact<'a>, i64, u8) -> Option<bool>;

impl<'a> Compact<'a> {
    fn byte(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.at).copied()?;
        self.at += 1;
        Some(byte)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Reads a list's number of elements and their type.
    fn list(&mut self) -> Option<(u64, u8)> {
        let byte = self.byte()?;
        let count = if byte >> 4 == 15 { self.varint()? } else { u64::from(byte >> 4) };
        Some((count, byte & 15))
    }

    /// Visits the fields of a structure.
    fn fields(&mut self, visit: Visit<'_, 'a>) -> Option<()> {
        self.fields_at(visit, 0)
    }

    fn fields_at(&mut self, visit: Visit<'_, 'a>, depth: usize) -> Option<()> {
        let mut id = 0_i64;
        loop {
            let byte = self.byte()?;
            let kind = byte & 15;
            if kind == 0 {
                return Some(());
            }
            id = if byte >> 4 == 0 { self.zigzag()? } else { id.checked_add(i64::from(byte >> 4))? };
            if !visit(self, id, kind)? {
                self.skip(kind, depth + 1)?;
            }
        }
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        if depth > DEEPEST_SKIPPED {
            return None;
        }
        let pass = |compact: &mut Compact<'a>, count: u64| {
            compact.at = usize::try_from(count).ok().and_then(|count| compact.at.checked_add(count))?;
            (compact.at <= compact.bytes.len()).then_some(())
        };
        match kind {
            1 | 2 => Some(()),
            3 => pass(self, 1),
            4..=6 => self.varint().map(drop),
            7 => pass(self, 8),
            8 => self.varint().and_then(|count| pass(self, count)),
            9 | 10 => {
                let (count, kind) = self.list()?;
                (0..count).try_for_each(|_| self.skip_element(kind, depth))
            }
            11 => {
                let count = self.varint()?;
                let kinds = if count > 0 { self.byte()? } else { 0 };
                (0..count).try_for_each(|_| {
                    self.skip_element(kinds >> 4, depth)?;
                    self.skip_element(kinds & 15, depth)
                })
            }
            12 => self.fields_at(&mut |_, _, _| Some(false), depth),
            _ => None,
        }
    }

    /// In a list a boolean takes a byte.
    fn skip_element(&mut self, kind: u8, depth: usize) -> Option<()> {
        if kind == 1 || kind == 2 { self.byte().map(drop) } else { self.skip(kind, depth + 1) }
    }
}
