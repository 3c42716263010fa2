//! The same tracks as other programs write them: compressed, in other characters, with other numbers and times.

use std::fs;
use std::io::Write;
use std::path::Path;

use lanesweep::model::plausibility::Implausible;
use lanesweep::traffic::trajectory::highd;
use lanesweep::traffic::trajectory::tracks::{Preset, TrackFile};
use lanesweep::traffic::trajectory::{InputFile, Inputs, Recording};

use crate::common::exid::Plain;
use crate::traffic::tracks::{fact, generated, understood};

fn table() -> Plain {
    let mut recording = generated();
    recording.tracks.truncate(80);
    Plain::of(&recording, 5)
}

/// What a file of this name and content is read as.
fn read(name: &str, content: &[u8]) -> lanesweep::Result<Recording> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    fs::write(&path, content).unwrap();
    let (files, problems) = Inputs::of(&path, None)?.files();
    assert!(problems.is_empty(), "{problems:?}");
    Ok(files[0].read(Implausible::Accepted)?.remove(0).recording)
}

fn packed(text: &str) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

fn from_frame_0(mut recording: Recording) -> Recording {
    let first = recording.tracks.iter().map(|track| track.first_frame).min().unwrap();
    recording.tracks.iter_mut().for_each(|track| track.first_frame -= first);
    recording
}

fn with_times(text: impl Fn(f64) -> String) -> Plain {
    let mut table = table();
    let t = table.at("t");
    table.rows.iter_mut().for_each(|row| row[t] = text(row[t].parse().unwrap()));
    table
}

#[test]
fn a_table_with_decimal_commas_is_the_one_with_points() {
    let right = read("own.csv", table().text().as_bytes()).unwrap();
    for delimiter in [";", "\t"] {
        let german = table().text().replace(',', delimiter).replace('.', ",");
        assert!(read("own.csv", german.as_bytes()).unwrap() == right);
    }
    // A point in a name is none of a number.
    let with_lane = |text: &str, delimiter: &str| -> String {
        let lines = text.lines().enumerate();
        lines.map(|(at, line)| format!("{line}{delimiter}{}\n", if at == 0 { "lane" } else { "1.2" })).collect()
    };
    let right = read("own.csv", with_lane(&table().text(), ",").as_bytes()).unwrap();
    let german = table().text().replace(',', ";").replace('.', ",");
    assert!(read("own.csv", with_lane(&german, ";").as_bytes()).unwrap() == right);
}

/// A comma that separates thousands would otherwise be read as a decimal one, and the other way round.
#[test]
fn a_table_with_decimal_points_and_commas_is_refused() {
    let x = table().at("x");
    for (own, other) in [(".", ","), (",", ".")] {
        let mut both = table();
        both.rows.iter_mut().flatten().for_each(|field| *field = field.replace('.', own));
        let last = both.rows.len() - 1;
        both.rows[last][x] = both.rows[last][x].replace(own, other);
        let lines = std::iter::once(&both.header).chain(&both.rows).map(|row| row.join(";") + "\n");
        let error = read("own.csv", lines.collect::<String>().as_bytes()).unwrap_err().to_string();
        assert!(error.contains("line ") && error.contains("decimal"), "{error}");
    }
}

#[test]
fn compressed_and_utf_16_texts_are_read() {
    let text = table().text();
    let right = read("own.csv", text.as_bytes()).unwrap();
    assert!(read("own.csv.gz", &packed(&text)).unwrap() == right);
    for unit in [u16::to_le_bytes, u16::to_be_bytes] {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        assert!(read("own.csv", &units.flat_map(unit).collect::<Vec<u8>>()).unwrap() == right);
    }
    let cut = packed(&text);
    let error = read("own.csv.gz", &cut[..cut.len() / 2]).unwrap_err();
    assert_eq!(error.help().as_deref(), Some("the file is truncated: copy it again"), "{error}");
}

#[test]
fn compressed_highd_files_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording { id: "01".to_owned(), ..generated() };
    highd::write(dir.path(), &recording).unwrap();
    let of = |dir: &Path| {
        let (files, problems) = Inputs::of(dir, None).unwrap().files();
        assert!(problems.is_empty(), "{problems:?}");
        files[0].read(Implausible::Refused).unwrap().remove(0)
    };
    let right = of(dir.path());
    for name in ["01_tracks.csv", "01_tracksMeta.csv"] {
        let path = dir.path().join(name);
        fs::write(dir.path().join(format!("{name}.gz")), packed(&fs::read_to_string(&path).unwrap())).unwrap();
        fs::remove_file(&path).unwrap();
    }
    let found = of(dir.path());
    assert!(found.recording == right.recording);
    // The checksum is that of the file as it lies there.
    let bytes = fs::metadata(dir.path().join("01_tracks.csv.gz")).unwrap().len();
    assert_eq!((found.checksum_sha256[0].file.as_str(), found.checksum_sha256[0].bytes), ("01_tracks.csv.gz", bytes));
}

#[test]
fn times_in_any_notation_are_the_same_times_what_they_are_taken_for_is_said_and_midnight_is_refused() {
    let right = from_frame_0(read("own.csv", table().text().as_bytes()).unwrap());
    let of_day = |t: f64| format!("{:02}:{:02}:{:05.2}", (t / 3600.0) as u32, (t / 60.0) as u32 % 60, t % 60.0);
    let clock = |t: f64| of_day(t + 8.0 * 3600.0);
    let notations: [(&str, &dyn Fn(f64) -> String); 6] = [
        ("milliseconds", &|t| format!("{:.0}", 1_740_823_200_000.0 + 1000.0 * t)),
        ("microseconds", &|t| format!("{:.0}", 1_740_823_200_000_000.0 + 1e6 * t)),
        ("nanoseconds", &|t| format!("{}00", 17_408_232_000_000_000 + (1e7 * t).round() as u64)),
        ("times of day", &clock),
        ("SUMO's", &|t| format!("1:{}", clock(t))),
        ("dates", &|t| format!("2025-03-01T{}Z", clock(t))),
    ];
    for (name, notation) in notations {
        let found = from_frame_0(read("own.csv", with_times(notation).text().as_bytes()).unwrap());
        assert_eq!(found.frame_rate_hz, right.frame_rate_hz, "{name}");
        assert!(found == right, "{name}");
    }
    let about = understood(&with_times(notations[0].1)).unwrap();
    assert!(fact(&about, "columns").contains("time = t (ms since 1970)"), "{:?}", about.facts);
    // Times of day that pass midnight.
    let evening = |t: f64| of_day((t + 86_390.0) % 86_400.0);
    let error = read("own.csv", with_times(evening).text().as_bytes()).unwrap_err().to_string();
    assert!(error.contains("midnight") && error.contains("line "), "{error}");
}

#[test]
fn geographic_coordinates_are_named_as_such() {
    let mut table = table();
    for (column, name) in [("x", "longitude"), ("y", "Latitude")] {
        table.map(column, |metres, _| metres / 111_000.0);
        let at = table.at(column);
        table.header[at] = name.to_owned();
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.csv");
    fs::write(&path, table.text()).unwrap();
    let error = Inputs::of(&path, None).unwrap_err();
    assert!(error.to_string().contains("longitudes and latitudes (`longitude`, `Latitude`)"), "{error}");
    assert!(error.help().unwrap().contains("project"), "{error:?}");
    // A preset cannot take degrees for metres.
    let preset = dir.path().join("own.toml");
    let columns = "vehicle = \"track_id\"\ntime = \"t\"\nx = \"longitude\"\ny = \"Latitude\"\n";
    fs::write(&preset, format!("name = \"own\"\n[columns]\n{columns}")).unwrap();
    let preset = Preset::load(&preset.to_string_lossy()).unwrap();
    let read = InputFile::Tracks(TrackFile { path, id: "own".to_owned() }, Box::new(preset)).read(Implausible::Refused);
    assert!(read.is_err(), "{read:?}");
}

/// Without a preset that names another unit; every codec of the usual programs.
#[cfg(feature = "parquet")]
#[test]
fn parquet_with_gzip_or_lz4_and_microseconds_is_the_table_and_instants_are_refused() {
    use arrow_array::cast::AsArray;
    use arrow_array::types::{Int64Type, TimestampMicrosecondType};
    use parquet::basic::{Compression, GzipLevel};

    let right = from_frame_0(read("own.csv", table().text().as_bytes()).unwrap());
    let text = with_times(|t| format!("{}", 1_740_823_200_000_000 + (1e6 * t).round() as i64)).text();
    let mut columns = crate::traffic::tracks::columns(&text, &["track_id", "t"]);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.parquet");
    let through = |columns, codec| {
        crate::common::made::write(&path, columns, codec);
        read("own.parquet", &fs::read(&path).unwrap())
    };
    let gzip = Compression::GZIP(GzipLevel::default());
    for codec in [gzip, Compression::LZ4, Compression::LZ4_RAW, Compression::SNAPPY] {
        assert!(from_frame_0(through(columns.clone(), codec).unwrap()) == right, "{codec:?}");
    }
    let (_, times) = columns.iter_mut().find(|(name, _)| name == "t").unwrap();
    let instants = times.as_primitive::<Int64Type>().reinterpret_cast::<TimestampMicrosecondType>();
    *times = std::sync::Arc::new(instants);
    let error = through(columns, gzip).unwrap_err();
    assert!(error.help().unwrap().contains("cast times to int64"), "{error:?}");
}
