//! Placeholder: room for `scene`.
