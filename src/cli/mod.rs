//! Placeholder: room for `cli`.
