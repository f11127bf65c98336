//! Jobs that are broken off, changed, damaged, and gone on with.

mod changed;
mod followed;
mod frames;
mod inputs;
mod interrupted;
mod isolated;
mod killed;
mod ledger;
mod mixed;
mod older;
mod report;
mod shared;
mod threads;
