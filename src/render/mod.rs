//! Placeholder: room for `render`.
