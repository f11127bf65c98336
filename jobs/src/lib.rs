//! Plans, records and resumes frame-by-frame work, and does not know what the work is: the caller
//! hands it frames, settings to fingerprint, and does the work itself.
//!
//! `formats` turns bytes into frames and knows no rays. `jobs` plans, records and resumes work and
//! does not know what the work is. `spherule` (accelerators, tracer, output, command line) joins
//! them. Arrows never point the other way.
#![deny(unsafe_code)]
