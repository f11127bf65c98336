//! Placeholder: room for `report`.
