#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    spherule_fuzz::vtk_xml(bytes);
});
