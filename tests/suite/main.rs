//! The program from outside, and the library across its rooms: one binary, a module a subject.

mod harness;
mod picture;
mod simd;

mod architecture;
mod arithmetic;
mod bad_input;
mod camera;
mod channels;
mod colors;
mod convert;
mod corpus;
mod crop;
mod damaged;
mod denoise;
mod export;
mod golden;
mod help;
mod in_place;
mod memory;
mod meshes;
mod parts;
mod printing;
mod progress;
mod resume;
mod rough_glass;
mod samples;
mod scale;
mod schema;
mod sequence;
mod status;
mod still;
mod structures;
mod surface;
mod thesis;
mod verify;
