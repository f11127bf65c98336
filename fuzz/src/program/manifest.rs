//! Manifests: what is read can be written, and then reads as the same.

use std::path::Path;

use spherule::manifest::{Manifest, Override};

/// Frames whose images are named.
const FRAMES: [i64; 4] = [i64::MIN, -1, 0, i64::MAX];

/// Lines `--set KEY=VALUE`, then the manifest.
pub fn manifest(bytes: &[u8]) -> usize {
    let text = String::from_utf8_lossy(bytes);
    let mut rest = &*text;
    let mut overrides = Vec::new();
    while let Some(line) = rest.strip_prefix("--set ") {
        let (assignment, after) = line.split_once('\n').unwrap_or((line, ""));
        match Override::parse(assignment) {
            Ok(set) => overrides.push(set),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
        rest = after;
    }
    match Manifest::parse_with(rest, Path::new("job.toml"), overrides) {
        Ok(manifest) => {
            written(&manifest);
            1
        }
        Err(error) => {
            assert!(!error.messages().is_empty());
            assert!(error.messages().iter().all(|line| !line.is_empty()));
            0
        }
    }
}

fn written(manifest: &Manifest) {
    let text = manifest.to_commented_toml();
    let again = match Manifest::parse(&text, Path::new("job.toml")) {
        Ok(again) => again,
        Err(error) => panic!("{error}\n{text}"),
    };
    assert_eq!(&again, manifest);
    assert_eq!(again.settings(), manifest.settings());
    for frame in FRAMES {
        manifest.output.path.path_for(frame);
    }
    if let Some(frames) = &manifest.input.frames {
        frames.has_several();
    }
    // Of one frame or of many, it is refused or not.
    let _ = manifest.check_frame_count(usize::MAX);
}
