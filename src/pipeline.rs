//! Placeholder: room for `pipeline`.
