//! Placeholder: room for `survey`.
