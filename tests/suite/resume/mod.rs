//! Jobs that are broken off, changed, damaged, and gone on with.

mod changed;
mod frames;
mod interrupted;
mod killed;
mod ledger;
mod report;
mod threads;
