//! x
use lanesweep::conformance::*;
fn main() {
    let p = lanesweep::profile::Profile::load("paper").unwrap();
    let a: Vec<String> = std::env::args().collect();
    let s: Vec<lanesweep::scenario::Scenario> =
        std::fs::read_to_string(&a[1]).unwrap().lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let t = Table::read(std::path::Path::new(&a[2])).unwrap();
    let r = compare_lanes(&s, &t, &p).unwrap();
    println!("ties {}", r.ties.len());
    println!("lanes {} end differs {} f32 {:?}", r.lanes, r.end_differs, r.f32_different);
    for t in r.tallies {
        println!(
            "{} {:?} rows {} robust {} reacted {} coll {} lab {} typ {} frag {} pass {}",
            t.label,
            t.model,
            t.rows,
            t.robust,
            t.reacted,
            t.collided,
            t.labels_equal,
            t.types_equal,
            t.fragile_different,
            t.passes()
        );
        for d in &t.deviations {
            if d.largest > 1e-9 {
                println!("    {} {} {}", d.quantity, d.largest, d.place)
            }
        }
        for d in t.complaints.iter().take(4) {
            println!("    ! {d}")
        }
    }
}
