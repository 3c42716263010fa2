//! Reads every recording of a folder on one core and prints the rate: `cargo run --release --example read_rate -- DIR`.
use std::time::Instant;

fn main() -> lanesweep::Result<()> {
    let dir = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let inventory = lanesweep::trajectory::highd::inventory(dir.as_ref())?;
    let (start, mut bytes, mut rows) = (Instant::now(), 0, 0);
    for files in &inventory.recordings {
        let loaded = lanesweep::trajectory::highd::read(files)?;
        bytes += loaded.bytes;
        rows += loaded.rows;
    }
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{} recordings, {rows} rows, {:.1} MB in {seconds:.2} s: {:.0} MB/s",
        inventory.recordings.len(),
        bytes as f64 / 1e6,
        bytes as f64 / 1e6 / seconds
    );
    Ok(())
}
