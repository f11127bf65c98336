//! The native frame file `.spf`.
