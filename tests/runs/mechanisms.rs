//! What every run stands on, by itself: journal, lock, shards.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use lanesweep::Error;
use lanesweep::run::parts::{Journal, Records};
use lanesweep::support::lock::FolderLock;

fn open(path: &Path) -> (Journal<Vec<u32>>, Records<Vec<u32>>) {
    Journal::open(path, "run", 0..10).unwrap()
}

#[test]
fn wherever_a_journal_is_cut_or_damaged_the_records_before_are_kept_and_no_other() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("journal");
    let written = [vec![1], vec![2, 3], vec![4]];
    let mut journal = open(&path).0;
    assert!(!path.exists());
    written.iter().for_each(|record| journal.append(std::slice::from_ref(record)).unwrap());
    drop(journal);
    let text = std::fs::read(&path).unwrap();
    let ends: Vec<usize> = (0..text.len()).filter(|&at| text[at] == b'\n').map(|at| at + 1).collect();
    for cut in 0..=text.len() {
        std::fs::write(&path, &text[..cut]).unwrap();
        let whole = ends.iter().filter(|&&end| end <= cut).count().saturating_sub(1);
        assert_eq!(open(&path).1.records, written[..whole], "cut at {cut}");
    }
    for at in ends[0]..text.len() {
        let mut damaged = text.clone();
        damaged[at] ^= 0x20;
        std::fs::write(&path, &damaged).unwrap();
        let (mut journal, kept) = open(&path);
        let whole = ends.iter().filter(|&&end| end <= at).count() - 1;
        assert_eq!(kept.records, written[..whole], "damaged at {at}");
        journal.append(&[vec![9]]).unwrap();
        assert_eq!(open(&path).1.records.len(), whole + 1, "what is appended after a repair is read");
    }
    for (run, units) in [("other", 0..10), ("run", 0..9)] {
        let error = Journal::<Vec<u32>>::open(&path, run, units).err().unwrap();
        assert!(error.to_string().contains("another run"), "{error}");
    }
}

#[test]
fn a_lock_has_one_holder_and_a_killed_ones_is_taken_over() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.lock");
    let lock = FolderLock::acquire(&path).unwrap();
    assert!(matches!(FolderLock::acquire(&path), Err(Error::Busy { .. })));
    drop(lock);
    assert!(!path.exists(), "a lock that was given back leaves no file");
    std::fs::write(&path, "my notes\n").unwrap();
    assert!(FolderLock::acquire(&path).is_err());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "my notes\n");
    std::fs::write(&path, "4000000000\n").unwrap();
    drop(FolderLock::acquire(&path).unwrap());
    // Many that come and go never hold it together.
    let (inside, taken) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let come_and_go = || {
        for _ in 0..200 {
            let Ok(lock) = FolderLock::acquire(&path) else { continue };
            assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0, "two hold the lock");
            taken.fetch_add(1, Ordering::SeqCst);
            inside.fetch_sub(1, Ordering::SeqCst);
            drop(lock);
        }
    };
    std::thread::scope(|scope| (0..8).for_each(|_| drop(scope.spawn(come_and_go))));
    assert!(taken.into_inner() > 0);
}
