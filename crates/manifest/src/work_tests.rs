//! The table `[job]`, and every key as an argument of `--set`.

use std::path::Path;
use std::time::Duration;

use super::*;

/// Keys of `[job]`, each with a value other than the default, and with the settings that it requires.
const OTHERS: [(&str, &str); 11] = [
    ("threads=3", ""),
    ("progress=json", ""),
    ("isolate=true", ""),
    ("memory_ceiling=4GiB", "isolate=true"),
    ("retries=0", ""),
    ("takeover_after=0.5", ""),
    ("grace=0", ""),
    ("follow=true", ""),
    ("idle=1e9", ""),
    ("settle=0", ""),
    ("stop_file=../stop", ""),
];

fn with(sets: &[&str]) -> Result<Manifest, ManifestError> {
    let set = |set: &&str| Override::parse(set).unwrap();
    let text = "[input]\npath = \"data\"\n";
    Manifest::parse_with(text, Path::new("job.toml"), sets.iter().map(set).collect())
}

fn job(sets: [&str; 2]) -> Result<Manifest, ManifestError> {
    let sets: Vec<String> =
        sets.iter().filter(|set| !set.is_empty()).map(|set| format!("job.{set}")).collect();
    with(&sets.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn images_do_not_depend_on_job_settings() {
    let plain = Manifest::new("data");
    for entry in plain.entries().list() {
        let is_execution = entry.section == "job";
        let depends = plain.depends_on(entry.declared.affects);
        assert!(!is_execution || !depends, "{}", entry.key);
    }
    for (set, needs) in OTHERS {
        let manifest = job([needs, set]).unwrap();
        assert_ne!(manifest.job, plain.job, "{set}");
        assert_eq!(manifest.settings(), plain.settings(), "{set}");
        let again = Manifest::parse(&manifest.to_commented_toml(), Path::new("job.toml"));
        assert_eq!(again.unwrap(), manifest, "{set}");
    }
}

#[test]
fn invalid_values() {
    #[track_caller]
    fn refused(set: &str, what: &str) {
        let error = job([set, ""]).unwrap_err();
        assert_eq!(error.messages().len(), 1, "{error}");
        // The option names the key already
        let (_, what) = what.split_once(": ").unwrap();
        let expected = format!("--set job.{set}: {what}");
        assert!(error.to_string().starts_with(&expected), "{error}");
    }
    for wrong in ["0", "-1", "1025", "1.5", "many", "true"] {
        let expected = "threads: expected \"all\" or a whole number from 1 to 1024, found";
        refused(&format!("threads={wrong}"), expected);
    }
    refused(
        "progress=jsno",
        "progress: expected one of auto, plain, json, openjd, none, found the text \"jsno\"; did you mean json?",
    );
    refused("isolate=1", "isolate: expected true or false");
    refused("memory_ceiling=0", "memory_ceiling: expected a size above 0");
    refused(
        "memory_ceiling=4GiB",
        "memory_ceiling: applies to the process of a frame; set job.isolate = true too",
    );
    refused("retries=-1", "retries: expected a whole number from 0 to 100");
    refused("retries=101", "retries: expected a whole number from 0 to 100");
    for wrong in ["0", "-1", "1.1e9", "inf", "nan", "soon"] {
        for key in ["takeover_after", "idle"] {
            refused(
                &format!("{key}={wrong}"),
                &format!("{key}: expected seconds above 0, at most 1e9, found"),
            );
        }
    }
    refused("settle=-0.1", "settle: expected seconds from 0 to 1e9");
    refused("stop_file=\"\"", "stop_file: expected a name in quotes");
    refused("idel=3", "idel: unknown key; did you mean `job.idle`?");
    assert!(job(["threads=all", ""]).unwrap().job.threads.is_none());
}

#[test]
fn any_time_is_a_duration() {
    for (set, expected) in [
        ("settle=0", Duration::ZERO),
        ("settle=1e-300", Duration::ZERO),
        ("settle=0.25", Duration::from_millis(250)),
        ("settle=1e9", Duration::from_secs(1_000_000_000)),
    ] {
        let work = job([set, ""]).unwrap().job;
        assert_eq!(work.settle, expected, "{set}");
    }
}

/// Keys that require other keys, and these keys with values.
const NEEDS: [(&str, &[&str]); 3] = [
    ("camera.eye", &["camera.look_at=[1,2,3]"]),
    ("camera.look_at", &["camera.mode=fixed", "camera.eye=[1,2,3]"]),
    ("job.memory_ceiling", &["job.isolate=true"]),
];

#[test]
fn every_key_can_be_set() {
    for entry in Manifest::new("data").entries().list() {
        let (key, value) = (&entry.key, entry.sample());
        let needs = NEEDS.iter().find(|(of, _)| of == key);
        let mut sets = needs.map_or_else(Vec::new, |(_, needs)| needs.to_vec());
        let set = format!("{key}={value}");
        sets.push(&set);
        let manifest = with(&sets).unwrap_or_else(|e| panic!("{e}"));
        let all = manifest.entries();
        let found = all.list().iter().find(|e| e.key == *key).unwrap();
        assert_eq!(found.value.as_deref(), Some(value), "{set}");
        // The reader checks the key: it rejects a table with an unknown key.
        let error = with(&[&format!("{key}={{ no_such = 1 }}")]).unwrap_err();
        assert!(error.to_string().contains(key), "{error}");
    }
}
