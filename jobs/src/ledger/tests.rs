//! What is read of ledgers, whole, torn and damaged.

use std::fs;

use serde_json::json;

use super::files::ledger_path;
use super::*;

/// What process `by` says after it has read all.
fn append(dir: &Path, by: &str, worker: &str, frame: i64, status: Status) {
    let ledger = Ledger::read(dir).unwrap();
    let mut writer = LedgerWriter::new(dir, worker);
    let entry = Entry::new(ledger.next_seq, frame, status, &json!({ "by": by }));
    writer.append(&entry, true).unwrap();
}

fn text(dir: &Path, worker: &str) -> String {
    fs::read_to_string(ledger_path(dir, worker)).unwrap()
}

/// A ledger of `count` entries of one worker.
fn ledger_of(dir: &Path, worker: &str, count: i64) {
    let mut writer = LedgerWriter::new(dir, worker);
    for frame in 1..=count {
        let seq = frame.unsigned_abs();
        let entry = Entry::new(seq, frame, Status::Done, &json!(null));
        writer.append(&entry, true).unwrap();
    }
}

#[test]
fn the_last_word_counts_across_workers() {
    let dir = tempfile::tempdir().unwrap();
    append(dir.path(), "1", "b", 1, Status::Failed);
    append(dir.path(), "2", "a", 1, Status::Done);
    append(dir.path(), "3", "d", -2, Status::Done);
    append(dir.path(), "4", "c", -2, Status::Failed);
    fs::write(dir.path().join("job.ledger..jsonl"), "not ours").unwrap();
    fs::write(dir.path().join("job.plan.json"), "not ours").unwrap();
    let ledger = Ledger::read(dir.path()).unwrap();
    let frames: Vec<i64> = ledger.entries().map(|e| e.frame).collect();
    assert_eq!(frames, [-2, 1]);
    assert_eq!(ledger.entry(1).unwrap().status, Status::Done);
    assert_eq!(
        ledger.entry(1).unwrap().details.value(),
        json!({ "by": "2" })
    );
    assert_eq!(ledger.entry(-2).unwrap().status, Status::Failed);
}

#[test]
fn of_two_words_at_once_the_one_that_it_is_done_counts() {
    for names in [["a", "b"], ["b", "a"]] {
        let dir = tempfile::tempdir().unwrap();
        for (worker, status) in names.into_iter().zip([Status::Done, Status::Failed]) {
            let entry = Entry::new(5, 1, status, &json!(null));
            LedgerWriter::new(dir.path(), worker)
                .append(&entry, true)
                .unwrap();
        }
        let ledger = Ledger::read(dir.path()).unwrap();
        assert_eq!(ledger.entry(1).unwrap().status, Status::Done);
    }
}

#[test]
fn a_torn_last_line_is_dropped_wherever_it_tore() {
    let dir = tempfile::tempdir().unwrap();
    ledger_of(dir.path(), "w", 1);
    let one = text(dir.path(), "w").len();
    fs::remove_file(ledger_path(dir.path(), "w")).unwrap();
    ledger_of(dir.path(), "w", 2);
    let two = text(dir.path(), "w");
    for length in one..two.len() {
        fs::write(ledger_path(dir.path(), "w"), &two[..length]).unwrap();
        let ledger = Ledger::read(dir.path()).unwrap();
        assert!(
            ledger.entry(1).is_some() && ledger.entry(2).is_none(),
            "torn at {length}"
        );
    }
    // Power loss may leave zeros where the line was to be.
    fs::write(
        ledger_path(dir.path(), "w"),
        format!("{}\0\0\0\0", &two[..one]),
    )
    .unwrap();
    assert_eq!(Ledger::read(dir.path()).unwrap().entries().count(), 1);
}

#[test]
fn damage_in_the_middle_is_an_error_and_nothing_is_touched() {
    let dir = tempfile::tempdir().unwrap();
    ledger_of(dir.path(), "w", 2);
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
        // What the parser passes over in text that is kept for later.
        (with_details("203E616"), 1),
        (with_details("[1e999]"), 1),
        (with_details("{\"a\":\"\\ud800\"}"), 1),
        (with_details("{\"\\ud800\":1}"), 1),
        (with_details(&("[".repeat(300) + &"]".repeat(300))), 1),
    ];
    for (damaged, wanted) in cases {
        fs::write(ledger_path(dir.path(), "w"), &damaged).unwrap();
        let error = Ledger::read(dir.path()).unwrap_err();
        assert!(
            matches!(&error, JobError::LedgerDamaged { line, .. } if *line == wanted),
            "{error}"
        );
        let text_of = error.to_string();
        assert!(text_of.contains("job.ledger.w.jsonl") && text_of.contains("not a ledger entry"));
        let mut news = News::new(dir.path(), "me", &Ledger::default());
        assert!(news.refresh(&["w".to_owned()]).is_err());
        assert_eq!(text(dir.path(), "w"), damaged);
    }
}

#[test]
fn news_of_others_come_line_by_line() {
    let dir = tempfile::tempdir().unwrap();
    append(dir.path(), "1", "a", 1, Status::Failed);
    let begun = Ledger::read(dir.path()).unwrap();
    let mut news = News::new(dir.path(), "me", &begun);
    let others = ["b".to_owned()];
    news.refresh(&others).unwrap();
    assert_eq!(news.ended(1), None, "that was before");

    append(dir.path(), "2", "b", 1, Status::Done);
    let whole = text(dir.path(), "b");
    fs::write(ledger_path(dir.path(), "b"), &whole[..whole.len() - 3]).unwrap();
    news.refresh(&others).unwrap();
    assert_eq!(news.ended(1), None, "the line is not finished");
    fs::write(ledger_path(dir.path(), "b"), &whole).unwrap();
    news.refresh(&others).unwrap();
    assert_eq!(news.ended(1), Some(Status::Done));
    assert!(news.take_seq() > 1);
}

#[test]
fn what_ended_workers_said_is_brought_together_and_still_found() {
    let dir = tempfile::tempdir().unwrap();
    let mut news = News::new(dir.path(), "me", &Ledger::default());
    let names = ["a", "b", "c"].map(str::to_owned);
    append(dir.path(), "1", "a", 1, Status::Done);
    append(dir.path(), "2", "b", 2, Status::Failed);
    news.refresh(&names).unwrap();
    append(dir.path(), "3", "c", 2, Status::Done);
    for _ in 0..2 {
        let before = Ledger::read(dir.path()).unwrap();
        fold(dir.path(), &before, &ledger_files(dir.path()).unwrap()).unwrap();
        let after = Ledger::read(dir.path()).unwrap();
        assert!(before.entries().eq(after.entries()));
        let files = ledger_files(dir.path()).unwrap();
        assert_eq!(files.len(), 1);
        assert_eq!(files[0].worker, ENDED);
        news.refresh(&[]).unwrap();
        assert_eq!(news.ended(2), Some(Status::Done));
    }
}

#[test]
fn a_line_without_an_end_is_damage_beyond_a_limit() {
    let dir = tempfile::tempdir().unwrap();
    let path = ledger_path(dir.path(), "w");
    let file = fs::File::create(&path).unwrap();
    file.set_len(1 << 36).unwrap();
    let error = Ledger::read(dir.path()).unwrap_err().to_string();
    assert!(
        error.contains("line 1: not a ledger entry (longer"),
        "{error}"
    );
}

#[test]
fn a_frame_that_is_set_back_is_open_to_all() {
    let dir = tempfile::tempdir().unwrap();
    let mut news = News::new(dir.path(), "me", &Ledger::default());
    append(dir.path(), "1", "a", 1, Status::Done);
    news.refresh(&["a".to_owned()]).unwrap();
    assert_eq!(news.ended(1), Some(Status::Done));
    let entry = Entry::set_back(news.take_seq(), 1, "f.vtk: grown".to_owned());
    let mut writer = LedgerWriter::new(dir.path(), "b");
    writer.append(&entry, true).unwrap();
    news.refresh(&["b".to_owned()]).unwrap();
    assert_eq!(news.ended(1), None);
    let ledger = Ledger::read(dir.path()).unwrap();
    assert!(ledger.entry(1).unwrap().set_back);
    append(dir.path(), "3", "c", 1, Status::Done);
    news.refresh(&["c".to_owned()]).unwrap();
    assert_eq!(news.ended(1), Some(Status::Done));
}
