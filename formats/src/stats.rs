//! What `inspect` says of a frame.
