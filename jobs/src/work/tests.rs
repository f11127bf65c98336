//! Claims among workers that live, end, fall silent and come back.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use crate::process::Process;

use super::*;

const PATIENT: Duration = Duration::from_secs(3600);

fn desk(dir: &Path) -> Arc<Desk> {
    Desk::take(dir, PATIENT).unwrap()
}

fn mine(claimed: Claimed) -> Claim {
    match claimed {
        Claimed::Mine(claim) => claim,
        other => panic!("{other:?}"),
    }
}

fn is_held(desk: &Arc<Desk>, frame: i64) -> bool {
    matches!(desk.claim_frame(frame).unwrap(), Claimed::Held(_))
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir.join(WORK_DIR))
        .map(|list| {
            list.map(|e| e.unwrap().file_name().into_string().unwrap())
                .collect()
        })
        .unwrap_or_default();
    names.sort();
    names
}

/// A worker that left its card and a claim of `frame`, on another machine.
fn stranger(dir: &Path, name: &str, frame: i64) -> PathBuf {
    left(dir, name, frame, "machine", "another".into())
}

/// The same of this machine, ended.
fn ended(dir: &Path, name: &str, frame: i64) -> PathBuf {
    left(dir, name, frame, "start", 1.into())
}

/// What a process would leave that is like this one but for a `field`.
fn left(dir: &Path, name: &str, frame: i64, field: &str, value: serde_json::Value) -> PathBuf {
    let mut process: serde_json::Value = serde_json::to_value(Process::this()).unwrap();
    process[field] = value;
    let card = Card {
        worker: name.to_owned(),
        process: serde_json::from_value(process).unwrap(),
        since_ms: 0,
        pause_ms: 0,
    };
    put(dir, &card, frame)
}

fn put(dir: &Path, card: &Card, frame: i64) -> PathBuf {
    let work = dir.join(WORK_DIR);
    fs::create_dir_all(&work).unwrap();
    let path = work.join(card.file_name());
    fs::write(&path, serde_json::to_string(card).unwrap() + "\n").unwrap();
    fs::hard_link(&path, work.join(format!("frame.{frame}.0"))).unwrap();
    path
}

#[test]
fn one_alone_has_a_frame_until_it_gives_it_back() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (desk(dir.path()), desk(dir.path()));
    let claim = mine(a.claim_frame(-7).unwrap());
    match b.claim_frame(-7).unwrap() {
        Claimed::Held(who) => assert!(who.contains(&std::process::id().to_string()), "{who}"),
        other => panic!("{other:?}"),
    }
    let other = mine(b.claim_frame(8).unwrap());
    drop(claim);
    let claim = mine(b.claim_frame(-7).unwrap());
    assert!(is_held(&a, -7) && is_held(&a, 8));
    assert_eq!(a.others().unwrap(), std::slice::from_ref(&b.card));
    drop((claim, other));
    drop(b);
    assert!(a.others().unwrap().is_empty());
    drop(a);
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn many_threads_agree_on_who_has_what() {
    let dir = tempfile::tempdir().unwrap();
    let taken: Vec<usize> = thread::scope(|scope| {
        let work = || {
            let desk = desk(dir.path());
            let mut kept = Vec::new();
            for frame in 0..200 {
                if let Claimed::Mine(claim) = desk.claim_frame(frame).unwrap() {
                    kept.push(claim);
                }
            }
            kept
        };
        let workers: Vec<_> = (0..4).map(|_| scope.spawn(work)).collect();
        let kept: Vec<Vec<Claim>> = workers.into_iter().map(|w| w.join().unwrap()).collect();
        kept.iter().map(Vec::len).collect()
    });
    assert_eq!(taken.iter().sum::<usize>(), 200, "{taken:?}");
}

#[test]
fn what_an_ended_process_had_is_free_at_once() {
    let dir = tempfile::tempdir().unwrap();
    ended(dir.path(), "dead", 3);
    let (a, b) = (desk(dir.path()), desk(dir.path()));
    let claim = mine(a.claim_frame(3).unwrap());
    assert!(is_held(&b, 3), "the next generation is a's");
    claim.end();
    assert!(!names(dir.path()).iter().any(|n| n.starts_with("frame.")));
    drop((a, b));
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn what_another_machine_had_is_free_after_a_while_without_signs_of_life() {
    let dir = tempfile::tempdir().unwrap();
    let card = stranger(dir.path(), "far", 3);
    let a = Desk::take(dir.path(), Duration::from_millis(300)).unwrap();
    let step = Duration::from_millis(100);
    for _ in 0..8 {
        assert!(is_held(&a, 3));
        assert_eq!(a.others().unwrap().len(), 1);
        let text = fs::read_to_string(&card).unwrap();
        fs::write(&card, text + ".").unwrap();
        thread::sleep(step);
    }
    assert!(is_held(&a, 3));
    while is_held(&a, 3) {
        thread::sleep(step);
    }
    assert!(!card.exists(), "all are to agree that it is dead");
    let other = desk(dir.path());
    assert!(!is_held(&other, 3));
    drop((a, other));
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn who_comes_back_from_the_dead_knows() {
    let dir = tempfile::tempdir().unwrap();
    let a = Desk::take(dir.path(), Duration::from_millis(40)).unwrap();
    let claim = mine(a.claim_frame(1).unwrap());
    let b = desk(dir.path());
    assert!(is_held(&b, 1) && claim.is_valid());
    b.bury(&a.card).unwrap();
    assert!(!claim.is_valid());
    let _mine = mine(b.claim_frame(1).unwrap());
    while !a.is_buried() {
        thread::yield_now();
    }
}

#[test]
fn of_two_generations_one_gives_way() {
    let dir = tempfile::tempdir().unwrap();
    ended(dir.path(), "dead", 1);
    let (a, b) = (desk(dir.path()), desk(dir.path()));
    let claim = mine(a.claim_frame(1).unwrap());
    // Somebody has cleared away the dead one under it.
    fs::remove_file(dir.path().join(WORK_DIR).join("frame.1.0")).unwrap();
    assert!(is_held(&b, 1));
    drop(claim);
    assert!(!is_held(&b, 1));
}

#[test]
fn damaged_and_foreign_files_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let work = dir.path().join(WORK_DIR);
    fs::create_dir(&work).unwrap();
    fs::write(work.join("torn.worker"), "{\"worker\":").unwrap();
    fs::write(work.join("frame.1.0"), "").unwrap();
    fs::write(work.join("frame.2.0"), [0xff; 9]).unwrap();
    fs::write(work.join("notes.txt"), "mine").unwrap();
    fs::create_dir(work.join("frame.4.0")).unwrap();
    fs::create_dir(work.join("folder.worker")).unwrap();
    let a = Desk::take(dir.path(), Duration::from_millis(50)).unwrap();
    a.sweep().unwrap();
    assert!(!is_held(&a, 4), "no worker makes directories");
    assert!(is_held(&a, 1) && is_held(&a, 2));
    thread::sleep(Duration::from_millis(100));
    assert!(!is_held(&a, 1) && !is_held(&a, 2));
    a.sweep().unwrap();
    assert!(work.join("notes.txt").exists() && !work.join("torn.worker").exists());
    assert!(!is_held(&a, 3));
}

/// A claim that names a worker by a path must not lead out of the directory.
#[test]
fn a_forged_claim_deletes_nothing_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let (work, victim) = (dir.path().join(WORK_DIR), dir.path().join("victim.worker"));
    fs::write(&victim, "mine").unwrap();
    let stranger = stranger(dir.path(), "far", 3);
    let forged = |worker: &str| {
        let text = fs::read_to_string(&stranger).unwrap();
        text.replace("\"far\"", &format!("\"{worker}\""))
    };
    fs::write(work.join("frame.1.0"), forged("../victim")).unwrap();
    fs::write(work.join("forged.worker"), forged("../victim")).unwrap();
    // Nor may one card speak for another worker.
    let other = desk(dir.path());
    fs::write(work.join("liar.worker"), forged(other.worker())).unwrap();
    let a = Desk::take(dir.path(), Duration::from_millis(40)).unwrap();
    while is_held(&a, 1) {
        thread::sleep(Duration::from_millis(10));
    }
    while work.join("forged.worker").exists() {
        a.sweep().unwrap();
    }
    assert_eq!(fs::read_to_string(&victim).unwrap(), "mine");
    assert!(other.card_path.exists());
    drop((a, other));
    assert_eq!(fs::read_to_string(&victim).unwrap(), "mine");
}

/// Its ledger must not be taken for that of a worker that has ended.
#[test]
fn a_worker_with_a_damaged_card_keeps_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (desk(dir.path()), desk(dir.path()));
    let text = fs::read_to_string(&a.card_path).unwrap();
    fs::write(&a.card_path, text.replace("since_ms", "since_mx")).unwrap();
    assert!(b.names().unwrap().contains(&a.worker().to_owned()));
}

#[cfg(unix)]
#[test]
fn pipes_among_cards_and_claims_are_passed_by() {
    let dir = tempfile::tempdir().unwrap();
    let work = dir.path().join(WORK_DIR);
    fs::create_dir(&work).unwrap();
    for name in ["frame.1.0", "lock.0", "pipe.worker"] {
        let made = std::process::Command::new("mkfifo")
            .arg(work.join(name))
            .status();
        assert!(made.unwrap().success());
    }
    let a = desk(dir.path());
    a.lock().unwrap().end();
    a.sweep().unwrap();
    assert!(!is_held(&a, 1));
    assert!(a.others().unwrap().is_empty());
    assert_eq!(workers(dir.path()).unwrap().len(), 1);
}

#[test]
fn the_last_to_leave_clears_away_and_nobody_before() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (desk(dir.path()), desk(dir.path()));
    ended(dir.path(), "dead", 5);
    drop(a);
    assert!(names(dir.path()).contains(&"frame.5.0".to_owned()));
    drop(b);
    assert!(!dir.path().join(WORK_DIR).exists());
}

#[test]
fn the_right_to_the_plan_goes_around() {
    let dir = tempfile::tempdir().unwrap();
    let inside = std::sync::atomic::AtomicUsize::new(0);
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let desk = desk(dir.path());
                for _ in 0..20 {
                    let lock = desk.lock().unwrap();
                    assert_eq!(inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst), 0);
                    thread::yield_now();
                    inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                    lock.end();
                }
            });
        }
    });
}

/// File systems without second names: the claim is a file of its own with the card's first line.
#[test]
fn a_claim_without_links_lives_as_long_as_its_worker() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (desk(dir.path()), desk(dir.path()));
    let path = a.work.join("frame.1.0");
    assert!(files::create_alone(&path, &a.text).unwrap());
    assert!(!files::create_alone(&path, &b.text).unwrap());
    assert!(is_held(&b, 1));
    drop(a);
    assert!(!is_held(&b, 1));
}
