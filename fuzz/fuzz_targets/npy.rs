#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    spherule_fuzz::npy(bytes);
});
