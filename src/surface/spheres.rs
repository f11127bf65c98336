//! Opaque or transmissive spheres, each a body of its own.
