//! Which format a file is: by content first, by name second.
