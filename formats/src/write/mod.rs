//! Writers of foreign formats.
