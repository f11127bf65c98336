//! Every target in one binary, which is built and linked once. The environment chooses:
//! `SPHERULE_FUZZ_TARGET` names the target, `SPHERULE_FUZZ_SIZE` makes inputs that large by repetition.
#![no_main]

use std::env;
use std::sync::LazyLock;

use spherule_fuzz::{Target, repeated, targets};

static TARGET: LazyLock<Target> = LazyLock::new(|| {
    let requested = env::var("SPHERULE_FUZZ_TARGET").unwrap_or_default();
    match targets().find(|(name, _)| *name == requested) {
        Some((_, target)) => target,
        None => {
            let names: Vec<&str> = targets().map(|(name, _)| name).collect();
            eprintln!("SPHERULE_FUZZ_TARGET: one of {}", names.join(", "));
            std::process::exit(2);
        }
    }
});

static SIZE: LazyLock<Option<usize>> =
    LazyLock::new(|| env::var("SPHERULE_FUZZ_SIZE").ok()?.parse().ok());

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match *SIZE {
        Some(size) => TARGET(&repeated(bytes, size)),
        None => TARGET(bytes),
    };
});
