//! Ledgers that are complete, incomplete and damaged.

use std::fs;
use std::time::{Duration, Instant};

use serde_json::json;

use super::files::ledger_path;
use super::watcher::RESCAN_INTERVAL;
use super::*;

/// Appends an entry that supersedes all others.
fn append(dir: &Path, by: &str, worker: &str, frame: i64, status: EntryStatus) {
    let ledger = Ledger::read(dir).unwrap();
    let mut writer = LedgerWriter::new(dir, worker);
    let entry = LedgerEntry::new(ledger.next_seq, frame, status, &json!({ "by": by }));
    writer.append(&entry, true).unwrap();
}

fn text(dir: &Path, worker: &str) -> String {
    fs::read_to_string(ledger_path(dir, worker)).unwrap()
}

/// Writes a ledger with `count` entries.
fn write_ledger(dir: &Path, worker: &str, count: i64) {
    let mut writer = LedgerWriter::new(dir, worker);
    for frame in 1..=count {
        let seq = frame.unsigned_abs();
        let entry = LedgerEntry::new(seq, frame, EntryStatus::Done, &json!(null));
        writer.append(&entry, true).unwrap();
    }
}

#[test]
fn the_latest_entry_of_all_workers_counts() {
    let dir = tempfile::tempdir().unwrap();
    append(dir.path(), "1", "b", 1, EntryStatus::Failed);
    append(dir.path(), "2", "a", 1, EntryStatus::Done);
    append(dir.path(), "3", "d", -2, EntryStatus::Done);
    append(dir.path(), "4", "c", -2, EntryStatus::Failed);
    fs::write(dir.path().join("job.ledger..jsonl"), "not ours").unwrap();
    fs::write(dir.path().join("job.plan.json"), "not ours").unwrap();
    let ledger = Ledger::read(dir.path()).unwrap();
    let frames: Vec<i64> = ledger.entries().map(|e| e.frame).collect();
    assert_eq!(frames, [-2, 1]);
    assert_eq!(ledger.entry(1).unwrap().status, EntryStatus::Done);
    assert_eq!(ledger.entry(1).unwrap().details.value(), json!({ "by": "2" }));
    assert_eq!(ledger.entry(-2).unwrap().status, EntryStatus::Failed);
}

#[test]
fn of_two_concurrent_entries_the_finished_one_counts() {
    for names in [["a", "b"], ["b", "a"]] {
        let dir = tempfile::tempdir().unwrap();
        for (worker, status) in names.into_iter().zip([EntryStatus::Done, EntryStatus::Failed]) {
            let entry = LedgerEntry::new(5, 1, status, &json!(null));
            LedgerWriter::new(dir.path(), worker).append(&entry, true).unwrap();
        }
        let ledger = Ledger::read(dir.path()).unwrap();
        assert_eq!(ledger.entry(1).unwrap().status, EntryStatus::Done);
    }
}

#[test]
fn an_incomplete_last_line_is_ignored() {
    let dir = tempfile::tempdir().unwrap();
    write_ledger(dir.path(), "w", 1);
    let one = text(dir.path(), "w").len();
    fs::remove_file(ledger_path(dir.path(), "w")).unwrap();
    write_ledger(dir.path(), "w", 2);
    let two = text(dir.path(), "w");
    for length in one..two.len() {
        fs::write(ledger_path(dir.path(), "w"), &two[..length]).unwrap();
        let ledger = Ledger::read(dir.path()).unwrap();
        assert!(ledger.entry(1).is_some() && ledger.entry(2).is_none(), "cut at {length}");
    }
    // Power loss may leave zeros in place of the line
    fs::write(ledger_path(dir.path(), "w"), format!("{}\0\0\0\0", &two[..one])).unwrap();
    assert_eq!(Ledger::read(dir.path()).unwrap().entries().count(), 1);
}

#[test]
fn damage_in_the_middle_is_an_error_and_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    write_ledger(dir.path(), "w", 2);
    let good = text(dir.path(), "w");
    let with_details = |value: &str| {
        let damaged = good.replacen("\"details\":null", &format!("\"details\":{value}"), 1);
        assert_ne!(damaged, good);
        damaged
    };
    let cases = [
        (good.replacen("\"frame\":1", "\"frame\":?", 1), 1),
        (good.replacen("done", "dome", 1), 1),
        (format!("{good}\n{good}"), 3),
        (format!("{good}\0\0\n"), 3),
        (format!("{good}[]\n"), 3),
        // JSON that `RawValue` alone accepts
        (with_details("203E616"), 1),
        (with_details("[1e999]"), 1),
        (with_details("{\"a\":\"\\ud800\"}"), 1),
        (with_details("{\"\\ud800\":1}"), 1),
        (with_details(&("[".repeat(300) + &"]".repeat(300))), 1),
    ];
    for (damaged, expected) in cases {
        fs::write(ledger_path(dir.path(), "w"), &damaged).unwrap();
        let error = Ledger::read(dir.path()).unwrap_err();
        assert!(
            matches!(&error, JobError::LedgerDamaged { line, .. } if *line == expected),
            "{error}"
        );
        let text_of = error.to_string();
        assert!(text_of.contains("job.ledger.w.jsonl") && text_of.contains("not a ledger entry"));
        let mut watcher = LedgerWatcher::new(dir.path(), "me", &Ledger::default());
        assert!(watcher.refresh(&["w".to_owned()], Instant::now()).is_err());
        assert_eq!(text(dir.path(), "w"), damaged);
    }
}

#[test]
fn the_watcher_reads_complete_lines() {
    let dir = tempfile::tempdir().unwrap();
    append(dir.path(), "1", "a", 1, EntryStatus::Failed);
    let ledger = Ledger::read(dir.path()).unwrap();
    let mut watcher = LedgerWatcher::new(dir.path(), "me", &ledger);
    let others = ["b".to_owned()];
    watcher.refresh(&others, Instant::now()).unwrap();
    assert_eq!(watcher.finished_by_other(1), None, "the entry is older than the watcher");

    append(dir.path(), "2", "b", 1, EntryStatus::Done);
    let whole = text(dir.path(), "b");
    fs::write(ledger_path(dir.path(), "b"), &whole[..whole.len() - 3]).unwrap();
    watcher.refresh(&others, Instant::now()).unwrap();
    assert_eq!(watcher.finished_by_other(1), None, "the line is incomplete");
    fs::write(ledger_path(dir.path(), "b"), &whole).unwrap();
    watcher.refresh(&others, Instant::now()).unwrap();
    assert_eq!(watcher.finished_by_other(1), Some(EntryStatus::Done));
    assert!(watcher.next_seq() > 1);
}

#[test]
fn compacted_entries_are_still_found() {
    let dir = tempfile::tempdir().unwrap();
    let mut watcher = LedgerWatcher::new(dir.path(), "me", &Ledger::default());
    let names = ["a", "b", "c"].map(str::to_owned);
    append(dir.path(), "1", "a", 1, EntryStatus::Done);
    append(dir.path(), "2", "b", 2, EntryStatus::Failed);
    watcher.refresh(&names, Instant::now()).unwrap();
    append(dir.path(), "3", "c", 2, EntryStatus::Done);
    for _ in 0..2 {
        let before = Ledger::read(dir.path()).unwrap();
        compact(dir.path(), &before, &ledger_files(dir.path()).unwrap()).unwrap();
        let after = Ledger::read(dir.path()).unwrap();
        assert!(before.entries().eq(after.entries()));
        let files = ledger_files(dir.path()).unwrap();
        assert_eq!(files.len(), 1);
        assert_eq!(files[0].worker, COMPACTED);
        watcher.refresh(&[], Instant::now()).unwrap();
        assert_eq!(watcher.finished_by_other(2), Some(EntryStatus::Done));
    }
}

#[test]
fn a_line_beyond_the_limit_is_damage() {
    let dir = tempfile::tempdir().unwrap();
    let path = ledger_path(dir.path(), "w");
    let file = fs::File::create(&path).unwrap();
    file.set_len(1 << 36).unwrap();
    let error = Ledger::read(dir.path()).unwrap_err().to_string();
    assert!(error.contains("line 1: not a ledger entry (longer"), "{error}");
}

#[test]
fn a_requeued_frame_is_pending_for_all_workers() {
    let dir = tempfile::tempdir().unwrap();
    let mut watcher = LedgerWatcher::new(dir.path(), "me", &Ledger::default());
    append(dir.path(), "1", "a", 1, EntryStatus::Done);
    watcher.refresh(&["a".to_owned()], Instant::now()).unwrap();
    assert_eq!(watcher.finished_by_other(1), Some(EntryStatus::Done));
    let entry = LedgerEntry::requeued(watcher.next_seq(), 1, "f.vtk: grown".to_owned());
    let mut writer = LedgerWriter::new(dir.path(), "b");
    writer.append(&entry, true).unwrap();
    watcher.refresh(&["b".to_owned()], Instant::now()).unwrap();
    assert_eq!(watcher.finished_by_other(1), None);
    let ledger = Ledger::read(dir.path()).unwrap();
    assert!(ledger.entry(1).unwrap().is_requeued);
    append(dir.path(), "3", "c", 1, EntryStatus::Done);
    watcher.refresh(&["c".to_owned()], Instant::now()).unwrap();
    assert_eq!(watcher.finished_by_other(1), Some(EntryStatus::Done));
}

#[test]
fn the_ledger_of_a_worker_that_came_and_went_is_found_at_the_next_scan() {
    let dir = tempfile::tempdir().unwrap();
    let mut watcher = LedgerWatcher::new(dir.path(), "me", &Ledger::default());
    let alone = ["me".to_owned()];
    let start = Instant::now();
    watcher.refresh(&alone, start).unwrap();
    watcher.refresh(&alone, start).unwrap();
    append(dir.path(), "1", "a", 1, EntryStatus::Done);
    let scan = start + RESCAN_INTERVAL;
    watcher.refresh(&alone, scan - Duration::from_millis(1)).unwrap();
    assert_eq!(watcher.finished_by_other(1), None);
    watcher.refresh(&alone, scan).unwrap();
    assert_eq!(watcher.finished_by_other(1), Some(EntryStatus::Done));
}
