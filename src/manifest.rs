//! Placeholder: room for `manifest`.
