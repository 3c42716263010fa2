//! x
use lanesweep::conformance::*;
fn main() {
    let p = lanesweep::profile::Profile::load("jrc-2021").unwrap();
    for f in std::env::args().skip(1) {
        let t = Table::read(std::path::Path::new(&f)).unwrap();
        let r = match t.kind().unwrap() { TableKind::JrcCases => compare_jrc(&t, &p), TableKind::Functions => compare_functions(&t, &p) };
        for t in r.unwrap() {
            println!("{} {:?} rows {} robust {} reacted {} coll {} lab {} typ {} frag {} pass {}", t.label, t.model, t.rows, t.robust, t.reacted, t.collided, t.labels_equal, t.types_equal, t.fragile_different, t.passes());
            for d in &t.deviations { if d.largest>1e-9 {println!("    {} {} {}", d.quantity, d.largest, d.place)} }
            for d in t.complaints.iter().take(4) { println!("    ! {d}") }
        }
    }
}
