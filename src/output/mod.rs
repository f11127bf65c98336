//! Placeholder: room for `output`.
